"""Pictures of the console for its page, drawn off screen: ``python -m tools.docs.console_pictures [NAME ...]``."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from flyaround.gui.panels.all import PANELS

FOLDER = Path("docs") / "images"
SCENARIO = "tango-vbar-closed-loop"
TILE = (640, 400)
COLUMNS, ROWS = 3, 3
FIRST_S, EACH_S, LOOK_S = 4.0, 4.0, 3.4
JPEG_QUALITY = 84


PICTURES = {
    "console": ("tango-flyaround", "6"),
    "console-map": ("tango-vbar-closed-loop", "1 burn.plan 90 0 0.02 0;2 window.enlarge lvlh-map;6"),
    "console-steering": ("tango-flyaround", "1 layout.fly;2 guidance.hold;2.5 burn.plan 90 0 0.02 0;12"),
    "console-docking": ("tango-flyaround", "1 layout.dock;2 docking.approach on;60"),
    "console-timeline": (
        "tango-flyaround",
        "1 panel.timeline on;4 timeline.bookmark start;8 timeline.bookmark end;9 timeline.seek 6;14",
    ),
    "console-estimator": (
        "tango-vbar-closed-loop",
        "1 layout.estimate;1.2 picture.detail full;1.4 time.rate 0.1;2 estimator.run on;40",
    ),
    "console-board-link": (
        "tango-vbar-closed-loop",
        "1 layout.link;1.4 time.rate 0.1;2 hil.start;3 hil.board hybrid;60",
    ),
    "console-capture": ("tango-flyaround", "1 layout.capture;2 capture.start 40;40"),
}
"""Scenario and script of each picture of the whole window; the picture is taken after the last line's time [s]."""


def main() -> None:
    """Take the named pictures, or all, and the sheets of every panel."""
    names = sys.argv[1:] or [*PICTURES, "panels"]
    for name in names:
        if name in PICTURES:
            _whole_window(name, *PICTURES[name])
    if "panels" in names:
        _sheets()


def _whole_window(name: str, scenario: str, script: str) -> None:
    *lines, end_s = script.split(";")
    target = (FOLDER / f"{name}.png").resolve()
    lines = [
        "0.1 help.tour-end",
        *lines,
        f"{end_s} window.screenshot {target}",
        f"{float(end_s) + 0.5} window.close",
    ]
    with tempfile.TemporaryDirectory() as place:
        _fly(Path(place), scenario, lines)


def _fly(folder: Path, scenario: str, lines: list[str]) -> None:
    (folder / "script").write_text("\n".join(lines))
    environment = os.environ | {"FLYAROUND_CONSOLE_LAYOUT": str(folder / "layout.json")}
    command = [sys.executable, "-m", "flyaround", "sim", scenario, "--off-screen", "--script", "script"]
    subprocess.run(command, cwd=folder, env=environment, check=True)


def _sheets() -> None:
    """Open each panel in turn, save a screenshot of the window, and write the sheets."""
    with tempfile.TemporaryDirectory() as place:
        looks = [_labelled(image, title) for image, title in _looks(Path(place))]
    size = COLUMNS * ROWS
    for k in range(0, len(looks), size):
        tiles = looks[k : k + size]
        tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % COLUMNS)
        sheet = np.vstack([np.hstack(tiles[r : r + COLUMNS]) for r in range(0, len(tiles), COLUMNS)])
        path = FOLDER / f"console-panels-{k // size + 1}.jpg"
        cv2.imwrite(str(path), sheet, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])


def _looks(folder: Path) -> list[tuple[np.ndarray, str]]:
    lines = ["0.500 estimator.run on", "0.600 overlay.keypoints on", "0.700 picture.detail full"]
    t_s = FIRST_S
    for panel in PANELS:
        lines += [
            f"{t_s:.3f} panel.{panel.name} on",
            f"{t_s + LOOK_S:.3f} window.screenshot {panel.name}.png",
        ]
        if panel.name != "camera":
            lines.append(f"{t_s + LOOK_S + 0.3:.3f} panel.{panel.name} off")
        t_s += EACH_S
    lines.append(f"{t_s + 1:.3f} window.close")
    _fly(folder, SCENARIO, lines)
    return [(np.asarray(cv2.imread(str(folder / f"{p.name}.png"))), p.title) for p in PANELS]


def _labelled(image: np.ndarray, title: str) -> np.ndarray:
    small = cv2.resize(image, TILE, interpolation=cv2.INTER_AREA)
    cv2.rectangle(small, (0, TILE[1] - 26), (TILE[0], TILE[1]), (24, 18, 14), -1)
    cv2.putText(
        small, title, (10, TILE[1] - 8), cv2.FONT_HERSHEY_SIMPLEX, 0.52, (250, 190, 90), 1, cv2.LINE_AA
    )
    return small


if __name__ == "__main__":
    main()
