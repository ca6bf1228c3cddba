"""A mouse button counts where the pointer was when it went down or up, also in a slow window."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.harness.screen import xdotool
from tests.harness.sitting import Sitting

pytestmark = [pytest.mark.gui, pytest.mark.timeout(1200)]
STRIP_Y = 752
"""Height of the strip with the clock, in a window of 1280 x 800."""
FAST_X, SLOW_X, TIMELINE_X = 300, 222, 700
"""Places on the slider of the rate, and on that of the timeline."""


def rates(log: Path) -> list[float]:
    """Return the rates that were set, in order."""
    words = [line.split() for line in log.read_text().splitlines()]
    return [float(line[2]) for line in words if line[1:2] == ["time.rate"]]


def test_a_drag_ends_where_the_button_was_released(display: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with Sitting(tmp_path, "tango-flyaround", "--log", str(log), display=display) as sitting:
        sitting.wait_for("first picture")
        xdotool(display, "mousemove", str(FAST_X), str(STRIP_Y), "sleep", "1", "mousedown", "1", "sleep", "1")
        # the next events come in one frame
        sitting.process.send_signal(signal.SIGSTOP)
        xdotool(display, "mousemove", str(SLOW_X), str(STRIP_Y), "mouseup", "1")
        xdotool(display, "mousemove", str(TIMELINE_X), str(STRIP_Y), "click", "1", "sleep", "1")
        sitting.process.send_signal(signal.SIGCONT)
        xdotool(display, "sleep", "2")
        state, _ = sitting.quit()
    fast, *later = rates(log)
    assert fast > 10.0
    assert later
    assert max(later) < fast, "the slider did not follow the pointer to the timeline"
    assert later[-1] == state["rate"] == 1.0
    assert "timeline.seek" in log.read_text(), "the click on the timeline came, too"
