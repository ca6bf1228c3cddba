"""A new user at the console: a fresh profile, no argument, keys and nothing else, until the craft is docked with."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import ImageGrab

from tests.harness.screen import virtual_screen
from tests.harness.sitting import Sitting

pytestmark = [pytest.mark.gui, pytest.mark.slow, pytest.mark.timeout(3600)]

ESTIMATE_WITHIN_S, DOCKED_WITHIN_S = 60.0, 600.0
"""Limits of processor time of the console: a busy machine has as long as it needs."""
KEEP = os.environ.get("FLYAROUND_TEST_PICTURES", "")
"""Folder for looks of the window, if one is named."""


def look(display: str, name: str) -> np.ndarray:
    """Return what is on the screen."""
    image = ImageGrab.grab(xdisplay=display)
    if KEEP:
        image.save(Path(KEEP) / f"new-user-{name}.png")
    return np.asarray(image)


def processor_s(sitting: Sitting) -> float:
    """Return the processor time that the console has used [s]."""
    fields = Path(f"/proc/{sitting.process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_from_a_fresh_profile_to_a_docked_craft(tmp_path: Path) -> None:
    began = time.monotonic()

    def passed(event: str) -> float:
        sys.stdout.write(
            f"{time.monotonic() - began:7.1f} s, {processor_s(sitting):6.1f} s of processor: {event}\n"
        )
        return processor_s(sitting)

    with virtual_screen() as display, Sitting(tmp_path, display=display) as sitting:
        sitting.wait_for("first picture")
        start_s = passed("first picture")
        look(display, "start")
        sitting.command("help.tour-end")
        # the estimator is given what is on the screen
        sitting.command("picture.detail full")
        sitting.command("estimator.run on", "first accepted pose")
        assert passed("first accepted pose") - start_s < ESTIMATE_WITHIN_S
        look(display, "estimate")
        sitting.command("panel.docking on")
        sitting.keys("Insert", "b")
        sitting.wait_for("the autopilot flies")
        sitting.keys("plus", "plus")
        # go at each hold point, refused until the chaser rests there
        sitting.wait_for("docked at", meanwhile=lambda: sitting.keys("Return"))
        assert passed("docked") - start_s < DOCKED_WITHIN_S
        assert look(display, "docked").std() > 8.0
        sitting.keys("ctrl+q", "ctrl+q")
        state, _ = sitting.end()
    assert state["docking"] is not None
    assert state["docking"]["docked"]
    assert state["docking"]["score"] > 50
    assert sitting.layout.is_file()
