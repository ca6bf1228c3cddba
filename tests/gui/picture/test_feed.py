"""The live feed with a renderer of the test's own: what is asked for, when, and at which size."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from flyaround.gui.picture.feed import DIVISORS, Feed
from flyaround.gui.picture.view_settings import ViewSettings
from flyaround.gui.views.camera import shown_passes
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest
from flyaround.simulator.piloting.orders import PilotCommand
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.runtime.worker_pool import JobsLostError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.state import SceneState
from tests.harness.turned_clock import TurnedClock


class FakeRenderer:
    """Finishes pictures when told to, at a price per megapixel."""

    def __init__(self, ms_per_mpx: float = 40.0) -> None:
        self.timed: list[bool] = []
        self.asked: list[tuple[SceneState, bool]] = []
        self.pending: list[SceneState] = []
        self.done: list[Frame] = []
        self.ms_per_mpx = ms_per_mpx
        self.lose: str | None = None
        self.room = True

    def submit(self, request: FrameRequest) -> bool:
        if not self.room:
            return False
        self.timed.append(bool(request.timed))
        self.asked.append((request.scene, bool(request.labels)))
        self.pending.append(request.scene)
        return True

    def finished(self) -> Iterable[Frame]:
        if self.lose is not None:
            why, self.lose = self.lose, None
            raise JobsLostError(why)
        done, self.done = self.done, []
        return done

    def finish(self) -> None:
        scene = self.pending.pop(0)
        image = np.zeros((scene.camera.height_px, scene.camera.width_px), np.uint8)
        ms = self.ms_per_mpx * image.size / 1e6
        stage_ms = {
            "render": ms,
            "sensor": 2.0,
            "render.earth.surface": 0.75 * ms,
            "render.target.shadow": 0.0,
        }
        self.done.append(Frame(scene, image, image.astype(np.float32), stage_ms=stage_ms))


@pytest.fixture
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-flyaround"))


def look_of(session: FlightSession) -> ViewSettings:
    scene = session.scene()
    return ViewSettings(bands=scene.bands, environment=scene.environment)


def live(session: FlightSession, ms_per_mpx: float, pictures: int) -> Feed:
    source, clock = FakeRenderer(ms_per_mpx), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    for _ in range(pictures):
        session.step(PilotCommand(), 0.1)
        feed.update(session, settings)
        clock.now_s += 0.1
        source.finish()
    feed.update(session, settings)
    return feed


def test_no_more_than_two_pictures_are_asked_for(session: FlightSession) -> None:
    source, clock = FakeRenderer(), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    for _ in range(20):
        session.step(PilotCommand(), 0.1)
        clock.now_s += 1.0
        feed.update(session, settings)
    assert len(source.asked) == 2


def test_a_paused_picture_is_drawn_once_and_whole(session: FlightSession) -> None:
    source, clock = FakeRenderer(), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    session.clock.toggle_pause()
    for _ in range(5):
        clock.now_s += 1.0
        feed.update(session, settings)
        if source.pending:
            source.finish()
    assert [scene for scene, _ in source.asked] == [session.scene()]
    assert feed.newest is not None
    assert feed.newest.frame.scene.camera == session.plan.camera


def test_changed_exposure_redraws_a_paused_picture(session: FlightSession) -> None:
    source, clock = FakeRenderer(), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    session.clock.toggle_pause()
    feed.update(session, settings)
    source.finish()
    settings.exposure_stops = 1.0
    feed.update(session, settings)
    assert source.asked[1][0].exposure_s == 2 * source.asked[0][0].exposure_s


@pytest.mark.parametrize(
    ("ms_per_mpx", "expected"), [(2.0, 1), (60.0, 2), (200.0, 3), (5000.0, DIVISORS[-1])]
)
def test_auto_detail_draws_what_fits(session: FlightSession, ms_per_mpx: float, expected: int) -> None:
    feed = live(session, ms_per_mpx, 30)
    assert feed.newest is not None
    assert feed.newest.divisor == expected


def test_a_slow_start_does_not_cost_detail(session: FlightSession) -> None:
    source, clock = FakeRenderer(5000.0), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    for _ in range(20):
        session.step(PilotCommand(), 0.1)
        feed.update(session, settings)
        clock.now_s += 0.1
        source.finish()
        source.ms_per_mpx = 60.0
    assert feed.newest is not None
    assert feed.newest.divisor == 2


def test_saving_asks_for_a_whole_picture_with_labels(session: FlightSession) -> None:
    source, clock = FakeRenderer(), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    feed.ask_to_save()
    feed.update(session, settings)
    assert source.asked == [(session.scene(), True)]
    assert feed.saving
    source.finish()
    feed.update(session, settings)
    assert [p.frame.scene for p in feed.saved] == [session.scene()]
    assert not feed.saving


def test_lost_pictures_are_asked_for_again(session: FlightSession) -> None:
    source, clock = FakeRenderer(), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    session.clock.toggle_pause()
    feed.ask_to_save()
    feed.update(session, settings)
    source.lose = "the drawing process died"
    source.pending.clear()
    assert not feed.update(session, settings)
    assert feed.take_trouble() == "the drawing process died"
    assert feed.take_trouble() is None
    assert feed.saving
    feed.update(session, settings)
    source.finish()
    assert feed.update(session, settings)
    assert [p.frame.scene for p in feed.saved] == [session.scene()]
    assert feed.restarts == 1


def test_passes_are_timed_on_request_only_and_a_still_picture_is_drawn_again_for_it(
    session: FlightSession,
) -> None:
    source, clock = FakeRenderer(), TurnedClock()
    feed, settings = Feed(source, clock), look_of(session)
    session.clock.toggle_pause()
    for timed in (False, False, *(8 * [True])):
        feed.update(session, settings, timed=timed)
        clock.now_s += 1.0
        if source.pending:
            source.finish()
    # a paused picture is drawn once, and as often again as the medians need
    assert source.timed == [False, *(5 * [True])]
    passes = dict(shown_passes(feed.pass_ms))
    assert list(passes) == ["earth surface", "other", "sensor"]
    assert passes["other"] == pytest.approx(passes["earth surface"] / 3)
    session.clock.toggle_pause()
    for _ in range(3):
        session.step(PilotCommand(), 0.1)
        feed.update(session, settings)
        clock.now_s += 1.0
        source.finish()
    assert feed.pass_ms == {}


def test_nothing_of_an_earlier_flight_is_shown_as_the_new_one(session: FlightSession) -> None:
    renderer, clock = FakeRenderer(), TurnedClock()
    feed = Feed(renderer, clock)
    feed.update(session, look_of(session))
    renderer.finish()
    feed.update(session, look_of(session))
    assert feed.newest is not None
    # a second picture of it is under way when another scenario is opened
    session.step(PilotCommand(), 0.2)
    feed.update(session, look_of(session))
    other = FlightSession.of(load_scenario("tango-space-10m"))
    feed.update(other, look_of(other))
    assert feed.newest is None
    while renderer.pending and feed.newest is None:
        renderer.finish()
        feed.update(other, look_of(other))
    assert feed.newest is not None
    assert feed.newest.state == other.state


def test_a_picture_that_is_not_replaced_is_late_and_counts_no_rate(session: FlightSession) -> None:
    renderer, clock = FakeRenderer(), TurnedClock()
    feed = Feed(renderer, clock)
    for _ in range(10):
        session.step(PilotCommand(), 0.2)
        feed.update(session, look_of(session))
        clock.now_s += 0.2
        renderer.finish()
        feed.update(session, look_of(session))
    assert feed.late_s == 0.0
    assert feed.frames_s == pytest.approx(5.0, rel=0.05)
    clock.now_s += 40.0
    assert feed.late_s == pytest.approx(40.0, abs=0.5)
    assert feed.frames_s == 0.0
    # as late is a picture for which the renderer, busy with another view, has no room
    renderer.finish()
    feed.update(session, look_of(session))
    assert feed.late_s == 0.0
    renderer.room = False
    session.step(PilotCommand(), 0.2)
    feed.update(session, look_of(session))
    clock.now_s += 10.0
    assert feed.late_s == pytest.approx(10.0, abs=0.5)
    assert feed.frames_s == 0.0
