"""Why a picture gives no estimate, as the estimator's panel, the board's and the messages say it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.jobs.estimates import compared
from flyaround.gui.jobs.estimator_process import Answer
from flyaround.gui.panels.estimator import EstimatorPanel
from flyaround.gui.picture.decline_cause import IN_SCENARIO, decline_cause
from flyaround.gui.picture.feed import Picture
from flyaround.gui.picture.view_settings import reduced_camera
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow

GREY, DARK, FULL = 90, 1, 255


@pytest.fixture(scope="module")
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-space-10m"))


def picture_of(
    session: FlightSession, t_m: tuple[float, float, float], level: int, *, sunlit: float = 1.0
) -> Picture:
    """A picture of one level with the target at a place in camera axes."""
    scene = session.scene()
    camera = reduced_camera(scene.camera, 4)
    scene = replace(scene, camera=camera, t_camera_from_target_m=t_m, sun_visible_fraction=sunlit)
    frame = Frame(scene, np.full((camera.height_px, camera.width_px), level, np.uint8), NO_RADIANCE)
    return Picture(frame, session.state, session.plan.target, 4)


@pytest.mark.parametrize(
    ("t_m", "level", "sunlit", "words"),
    [
        ((0.0, 0.0, 10.0), GREY, 1.0, ()),
        ((20.0, 0.0, 10.0), GREY, 1.0, ("out of the picture", "has to be in view", "Centre target")),
        ((0.0, 0.0, -10.0), GREY, 1.0, ("out of the picture", "has to be in view")),
        ((0.0, 0.0, 0.4), GREY, 1.0, ("fills the picture", "fly back")),
        ((3.3, 0.0, 10.0), GREY, 1.0, ("cut off", "% of its edges")),
        ((0.0, 0.0, 10.0), DARK, 1.0, ("is dark: 100% of the pixels", "raise the exposure", "meter")),
        ((0.0, 0.0, 10.0), DARK, 0.0, ("in the shadow of the Earth", "raise the exposure")),
        ((0.0, 0.0, 10.0), FULL, 1.0, ("burnt out: 100% of the lit pixels", "lower the exposure")),
    ],
)
def test_a_picture_says_why_it_gives_no_estimate(
    session: FlightSession, t_m: tuple[float, float, float], level: int, sunlit: float, words: tuple[str, ...]
) -> None:
    picture = picture_of(session, t_m, level, sunlit=sunlit)
    cause = decline_cause(picture.frame, picture.target)
    assert bool(cause) == bool(words)
    for word in words:
        assert word in cause
    # the scenario's exposure is that of a board's pictures
    assert ("exposure_s" in decline_cause(picture.frame, picture.target, IN_SCENARIO)) == (
        "exposure" in cause
    )


ANSWER = Answer(
    accepted=False,
    reason="no target found",
    q_camera_from_target_wxyz=None,
    t_camera_from_target_m=None,
    confidence=0.0,
    stages_ms={},
)


def test_panel_and_message_say_that_the_target_is_not_in_view(session: FlightSession) -> None:
    console, window = console_flying("tango-space-10m"), HeadlessWindow()

    def texts() -> list[str]:
        window.noted.clear()
        with window.panel("estimator", 420.0, 1400.0):
            EstimatorPanel(window).draw(console)
        return [n.label for n in window.noted if n.what == "text"]

    said: list[str] = []
    jobs = console.jobs
    jobs.say = lambda text, *_, **__: said.append(text)
    try:
        assert any("the target has to be in it" in text for text in texts())
        console.feed.newest = away = picture_of(session, (20.0, 0.0, 10.0), GREY)
        assert any("out of the picture: it has to be in view" in text for text in texts())
        # the message comes once, also while the figures in it change
        for place_m in (3.3, 3.35):
            cut = picture_of(session, (place_m, 0.0, 10.0), GREY)
            jobs.estimates.newest = None
            jobs.estimates.update = lambda _, cut=cut: (
                setattr(jobs.estimates, "newest", compared(cut, "hybrid", ANSWER, 0.0)) or True
            )
            jobs.update(console.session, cut, 0)
        assert [text.partition(";")[0].partition(":")[0] for text in said] == ["hybrid declines its pictures"]
        # nothing of it beside a fresh accepted pose
        jobs.estimates.newest = compared(away, "hybrid", replace(ANSWER, accepted=True), 0.0)
        assert not any("out of the picture" in text for text in texts())
    finally:
        window.close()
        console.close()
