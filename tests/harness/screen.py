"""A virtual screen, and keys pressed on it."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

SCREEN = (1280, 800)


@contextmanager
def virtual_screen(size: tuple[int, int] = SCREEN) -> Iterator[str]:
    """Name of the display; skips where a part is missing."""
    for program in ("Xvfb", "xdotool"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed (apt-get install xvfb xdotool)")
    pytest.importorskip("glfw", reason="the gui extra is not installed", exc_type=ImportError)
    receiving, sending = os.pipe()
    # -displayfd: the server picks a free number and tells it when it is ready
    server = subprocess.Popen(
        [
            "Xvfb",
            "-displayfd",
            str(sending),
            "-screen",
            "0",
            f"{size[0]}x{size[1]}x24",
            "-nolisten",
            "tcp",
        ],
        pass_fds=(sending,),
        stderr=subprocess.DEVNULL,
    )
    os.close(sending)
    with os.fdopen(receiving) as pipe:
        number = pipe.readline().strip()
    try:
        yield f":{number}"
    finally:
        server.terminate()
        server.wait(timeout=60)


def xdotool(display: str, *arguments: str) -> str:
    """What xdotool answers to some arguments."""
    environment = {**os.environ, "DISPLAY": display}
    done = subprocess.run(
        ["xdotool", *arguments], env=environment, capture_output=True, text=True, check=False
    )
    return done.stdout.strip()
