"""Pictures of the console for its documentation, rendered off screen: ``python -m tools.docs.console_pictures``."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path("docs") / "images"
PICTURES = {
    "console": ("tango-flyaround", "1 picture.detail full;28"),
    "console-steering": ("tango-flyaround", "1 layout.fly;2 guidance.hold;2.5 burn.plan 150 0 0.02 0;75"),
    "console-docking": ("tango-flyaround", "1 layout.dock;2 docking.approach on;60"),
    "console-estimator": (
        "tango-vbar-closed-loop",
        "1 layout.estimate;1.2 picture.detail full;1.4 time.rate 0.1;2 estimator.run on;170",
    ),
    "console-board-link": (
        "tango-vbar-closed-loop",
        "1 layout.link;1.4 time.rate 0.1;2 hil.start;3 hil.board hybrid;60",
    ),
    "console-capture": ("tango-flyaround", "1 layout.capture;2 capture.start 200;30"),
}
"""Scenario and script of each picture of the whole window; the picture is taken at the last time of the script [s]."""


def main() -> None:
    """Take the named pictures, or all."""
    for name in sys.argv[1:] or PICTURES:
        _whole_window(name, *PICTURES[name])


def _whole_window(name: str, scenario: str, script: str) -> None:
    *lines, end_s = script.split(";")
    target = (FOLDER / f"{name}.png").resolve()
    target.unlink(missing_ok=True)
    lines = [
        "0.1 help.tour-end",
        *lines,
        f"{end_s} window.screenshot {target}",
        f"{float(end_s) + 0.5} window.close",
    ]
    command = [sys.executable, "-m", "flyaround", "sim", scenario, "--off-screen", "--script", "script"]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "script").write_text("\n".join(lines))
        environment = os.environ | {"FLYAROUND_CONSOLE_LAYOUT": str(Path(folder, "layout.json"))}
        subprocess.run(command, cwd=folder, env=environment, check=True)


if __name__ == "__main__":
    main()
