"""Sixty starts of the console on a busy machine, in six groups: none may die, and no drawing process of one.

Once in fifteen one did (`simulator.render.fences`). `make test-starts` runs them, twenty minutes on two processors.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.harness.screen import virtual_screen, xdotool

pytestmark = [pytest.mark.gui, pytest.mark.slow]

GROUPS, STARTS = 6, 10
FLOWN_S = 4.0
TIMEOUT_S = 240.0
KEYS = ("w", "s", "a", "d", "r", "f", "i", "k", "j", "l")


@contextmanager
def busy_machine() -> Iterator[None]:
    """Twice as many programs that compute as there are processors."""
    command = [sys.executable, "-c", "while True: pass"]
    load = [subprocess.Popen(command) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        yield
    finally:
        for one in load:
            one.kill()
            one.wait()


@pytest.mark.parametrize("group", range(GROUPS))
def test_no_start_on_a_busy_machine_dies(group: int, tmp_path: Path) -> None:
    died = []
    with virtual_screen() as display, busy_machine():
        for start in range(STARTS):
            folder = tmp_path / str(start)
            folder.mkdir()
            trouble = fly(display, folder, KEYS[(group + start) % len(KEYS)])
            if trouble:
                died.append(f"start {start}: {trouble}")
    assert not died, "\n".join(died)


def fly(display: str, folder: Path, key: str) -> str:
    """Start a console, press thrust with its first picture and another key later; what went wrong."""
    command = [sys.executable, "-m", "flyaround", "-v", "sim", "tango-flyaround", "--json"]
    command += ["--seconds", str(FLOWN_S), "--record", "flown"]
    environment = {**os.environ, "DISPLAY": display}
    with subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as console:
        assert console.stderr is not None
        lines = []
        for line in console.stderr:
            lines.append(line)
            if "first picture" in line:
                break
        for pressed in ("w", key):
            xdotool(display, "keydown", pressed)
            time.sleep(1.0)
            xdotool(display, "keyup", pressed)
        try:
            out, err = console.communicate(timeout=TIMEOUT_S)
        except subprocess.TimeoutExpired:
            console.kill()
            return "it hangs"
    if console.returncode:
        return f"exit code {console.returncode}: {''.join(lines)}{err}"
    state = json.loads(out)
    if state["drawing_restarts"]:
        return f"its drawing process died: {err}"
    if not (folder / "flown" / "replay.toml").is_file():
        return "its flight is not recorded"
    return "" if state["mode"] == "steer" else "the keys did not reach it"
