"""Nothing that the console writes is cut off or covered: every panel, in a small, a usual and a large window."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from flyaround.gui.panels.all import PANELS

ROOT = Path(__file__).parents[3]
SIZES = ("800x600", "1280x800", "1920x1080")
EACH_S = 0.8
LAYOUTS = ("first", "fly", "dock", "capture", "estimate", "link")

DRAWN = """
from flyaround.gui.canvas import Canvas
from tests.harness.legibility import drawn_texts, faults_of
from flyaround.gui.off_screen import OffScreen
from flyaround.gui.widgets import Widgets

with OffScreen((640, 480)) as window:
    imgui, w = window.imgui, Widgets(window)
    for _ in range(3):
        with window.frame():
            imgui.set_next_window_pos(w.vec(10, 10))
            imgui.set_next_window_size(w.vec(150, 200))
            imgui.begin("narrow")
            imgui.text_unformatted("this sentence is longer than its window is wide")
            imgui.button("so is the label of this button", w.vec(100, 0))
            imgui.text_unformatted(w.elided("and this one, which ends early", w.width))
            imgui.end()
            imgui.set_next_window_pos(w.vec(200, 10))
            imgui.set_next_window_size(w.vec(400, 300))
            imgui.begin("wide")
            imgui.text_unformatted("whole")
            canvas = Canvas(window)
            canvas.text((230, 100), "outlined")
            canvas.text((230, 140), "below")
            canvas.text((235, 143), "above")
            imgui.end()
    print(*faults_of(drawn_texts(window)), sep="\\n")
"""

CONSOLE = """
import json
import sys
from pathlib import Path

from flyaround.gui import app, off_screen
from flyaround.gui.command_table import Command, CommandTable
from tests.harness.legibility import drawn_texts, faults_of

windows, faults, checks = [], [], []


class Watched(off_screen.OffScreen):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        windows.append(self)


def check(_console):
    checks.append(1)
    faults.extend(faults_of(drawn_texts(windows[-1])))


def command_table():
    ours = Command("window.check-text", "Check text", "find texts that are cut off or covered", check)
    return CommandTable((*app.COMMANDS, *app.panel_commands(), ours))


off_screen.OffScreen, app.command_table = Watched, command_table
script, screenshot, width, height = sys.argv[1:]
request = app.Request(
    scenario="tango-vbar-approach",
    size=(int(width), int(height)),
    off_screen=True,
    script=Path(script),
    screenshot=Path(screenshot),
    seconds=200.0,
)
app.run(request)
print(json.dumps({"checks": len(checks), "faults": faults}))
"""
"""The console with one more command, which looks at the texts of the last frame."""


@pytest.mark.gui
def test_texts_that_are_cut_or_covered_are_found() -> None:
    done = subprocess.run(
        [sys.executable, "-c", DRAWN],
        cwd=Path.cwd(),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = done.stdout.splitlines()
    assert len(found) == 3, found
    assert "narrow" in found[0]
    assert "this" in found[0]
    assert "label" in found[1] or "so" in found[1]
    assert found[2] == "wide: 'below' and 'above' lie over each other"


def script_of_panels() -> str:
    """Open each panel, have the texts checked, and close what lies over the others."""
    lines = ["0.1 overlay.keypoints on", "0.1 overlay.names on", "0.1 time.pause"]
    for k, panel in enumerate(PANELS):
        t = 0.5 + k * (EACH_S + 0.2)
        lines += [f"{t:.1f} panel.{panel.name} on", f"{t + EACH_S:.1f} window.check-text"]
        if panel.place == "over":
            lines.append(f"{t + EACH_S + 0.1:.1f} panel.{panel.name} off")
    return "\n".join([*lines, f"{0.5 + (len(PANELS) + 1) * (EACH_S + 0.2):.1f} window.close"]) + "\n"


def script_of_layouts() -> str:
    """Open each layout, with everything that is drawn over the view, a dark picture and burns, and check the texts."""
    lines = [f"0.1 overlay.{name} on" for name in ("keypoints", "names", "box", "axes", "wireframe")]
    lines += [
        "0.2 overlay.docking on",
        "0.2 burn.plan 60 0 1.5 0.02",
        "0.2 burn.plan 200 -0.15 0 0.02",
        "0.3 picture.exposure -8",
    ]
    for k, name in enumerate(LAYOUTS):
        # the picture of the new size has to come
        lines += [f"{1.0 + 4 * k:.1f} layout.{name}", f"{4.5 + 4 * k:.1f} window.check-text"]
    return "\n".join([*lines, f"{5.0 + 4 * len(LAYOUTS):.1f} window.close"]) + "\n"


@pytest.mark.gui
@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(
    ("script_text", "checks"),
    [
        pytest.param(script_of_panels(), len(PANELS), id="panels"),
        pytest.param(script_of_layouts(), len(LAYOUTS), id="layouts"),
    ],
)
def test_every_panel_and_layout_is_legible(tmp_path: Path, size: str, script_text: str, checks: int) -> None:
    script = tmp_path / "panels.script"
    script.write_text(script_text)
    width, height = size.split("x")
    done = subprocess.run(
        [sys.executable, "-c", CONSOLE, str(script), str(tmp_path / "panels.png"), width, height],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT), "FLYAROUND_CONSOLE_LAYOUT": str(tmp_path / "layout.json")},
        capture_output=True,
        text=True,
        timeout=1200,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout.splitlines()[-1])
    assert answer["checks"] == checks
    assert not answer["faults"], "\n".join(answer["faults"])
