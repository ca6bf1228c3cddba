"""Sixty starts of the console on a busy machine, in three groups: none may die, and no drawing process of one.

Once in fifteen one did (`flyaround.simulator.render.gl.fences`). Two to a processor start at once and are each other's load.
`make test-starts` runs them, some ten minutes on two processors.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from queue import SimpleQueue

import pytest

from tests.harness.screen import virtual_screen, xdotool

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(3600)]

GROUPS, STARTS = 3, 20
FLOWN_S = 4.0
TIMEOUT_S = 240.0
KEYS = ("w", "s", "a", "d", "r", "f", "i", "k", "j", "l")


@pytest.mark.parametrize("group", range(GROUPS))
def test_no_start_on_a_busy_machine_dies(group: int, tmp_path: Path) -> None:
    at_once = 2 * (os.cpu_count() or 1)
    with ExitStack() as stack, ThreadPoolExecutor(at_once) as pool:
        # each console has a screen of its own, and so the keys
        screens: SimpleQueue[str] = SimpleQueue()
        for _ in range(at_once):
            screens.put(stack.enter_context(virtual_screen()))

        def start(k: int) -> str:
            folder, display = tmp_path / str(k), screens.get()
            folder.mkdir()
            try:
                return fly(display, folder, KEYS[(group + k) % len(KEYS)])
            finally:
                screens.put(display)

        troubles = list(pool.map(start, range(STARTS)))
    assert not any(troubles), "\n".join(f"start {k}: {what}" for k, what in enumerate(troubles) if what)


def fly(display: str, folder: Path, key: str) -> str:
    """Start a console, press thrust with its first picture and another key later; what went wrong."""
    command = [sys.executable, "-m", "flyaround", "-v", "sim", "tango-flyaround", "--json"]
    command += ["--seconds", str(FLOWN_S), "--record", "flown"]
    environment = {**os.environ, "DISPLAY": display}
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as console:
        assert console.stderr is not None
        # a hang ends by this, and is told as an exit code
        end = threading.Timer(TIMEOUT_S, console.kill)
        end.start()
        lines = []
        for line in console.stderr:
            lines.append(line)
            if "first picture" in line:
                break
        xdotool(display, "key", "Insert")
        for pressed in ("w", key):
            xdotool(display, "keydown", pressed)
            time.sleep(1.0)
            xdotool(display, "keyup", pressed)
        out, err = console.communicate()
        end.cancel()
    if console.returncode:
        return f"exit code {console.returncode}: {''.join(lines)}{err}"
    state = json.loads(out)
    if state["drawing_restarts"]:
        return f"its drawing process died: {err}"
    if not (folder / "flown" / "replay.toml").is_file():
        return "its flight is not recorded"
    return "" if state["mode"] == "steer" else "the keys did not reach it"
