"""Frame rates of the console on a virtual screen: of its window and of its images.

``python -m tools.console_rates`` opens a window of 1280x800 with a camera of 640x400, flies a scenario, and prints both
rates and the time of each step. The goals on two llvmpipe cores are 30 and 20 per second. Run it on an idle machine.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.scenario.load import load_scenario

if TYPE_CHECKING:
    from collections.abc import Iterator

SIZE, CAMERA_PX = (1280, 800), (640, 400)  # size of the window, and of the camera's image [px]
GOALS = {"window_per_s": 30.0, "pictures_per_s": 20.0}  # minimum rates [1/s]


@contextmanager
def virtual_screen() -> Iterator[str]:
    """Start a separate X server and return the name of its display."""
    receiving, sending = os.pipe()
    screen = f"{SIZE[0]}x{SIZE[1]}x24"
    command = ["Xvfb", "-displayfd", str(sending), "-screen", "0", screen, "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=(sending,), stderr=subprocess.DEVNULL) as server:
        os.close(sending)
        with os.fdopen(receiving) as pipe:
            number = pipe.readline().strip()
        try:
            yield f":{number}"
        finally:
            server.terminate()


def write_scenario(name: str, path: Path) -> None:
    """Write a built-in scenario with the same field of view on `CAMERA_PX` pixels."""
    scenario = load_scenario(name)
    camera = msgspec.to_builtins(scenario.camera)
    scale = CAMERA_PX[0] / camera["width_px"]
    camera |= {"width_px": CAMERA_PX[0], "height_px": CAMERA_PX[1]}
    camera |= {key: camera[key] * scale for key in ("fx_px", "fy_px", "cx_px", "cy_px")}
    path.write_text(to_toml(msgspec.to_builtins(scenario) | {"camera": camera}))


def measure(name: str, seconds: float, extra: list[str]) -> dict[str, float]:
    """Return the last state of a console after a flight of that duration.

    Parameters
    ----------
    name : str
        Built-in scenario.
    seconds : float
        Duration after the first image.
    extra : list of str
        Options for ``flyaround sim``.
    """
    with tempfile.TemporaryDirectory() as folder, virtual_screen() as display:
        write_scenario(name, Path(folder) / "rates.toml")
        environment = os.environ | {
            "DISPLAY": display,
            "FLYAROUND_CONSOLE_LAYOUT": str(Path(folder) / "layout.json"),
        }
        command = [sys.executable, "-m", "flyaround", "sim", str(Path(folder) / "rates.toml"), "--json"]
        command += ["--size", f"{SIZE[0]}x{SIZE[1]}", "--seconds", str(seconds), *extra]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as console:
            out = console.stdout.read() if console.stdout is not None else ""
        if console.returncode:
            raise SystemExit(console.returncode)
    state: dict[str, float] = json.loads(out)
    return state


def main() -> None:
    """Print the rates and return the exit code, 1 if a goal is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="tango-flyaround")
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--json", action="store_true", help="print the whole last state")
    arguments, extra = parser.parse_known_args()
    state = measure(arguments.scenario, arguments.seconds, extra)
    if arguments.json:
        print(json.dumps(state, indent=1))
        return
    for name, goal in GOALS.items():
        print(f"{name:16} {state[name]:6.1f}   goal {goal:.0f}")
    for name in ("window_ms", "picture_ms"):
        print(f"{name:16} {state[name]:6.1f}")
    sys.exit(any(state[name] < goal for name, goal in GOALS.items()))


if __name__ == "__main__":
    main()
