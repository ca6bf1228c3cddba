"""The timeline of a flight: any place of it again, playing, flying on from there, the future that was left."""

import pickle
import time

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.flight_history import MAX_BOOKMARKS, SAMPLE_INTERVAL_S, Timeline
from flyaround.simulator.piloting.orders import PilotCommand, Stop
from flyaround.simulator.piloting.recorder import FlightRecorder
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.world.guidance.manual_control import ChaserState
from tests.harness.pilot import TICK_S, fly


@pytest.fixture
def session():
    return FlightSession.of(load_scenario("tango-flyaround"))


def chaser(t_s):
    return ChaserState(
        t_s=t_s,
        position_eci_m=(10.0 + t_s, np.sin(t_s), 3.0),
        velocity_eci_m_s=(1.0, np.cos(t_s), 0.0),
        q_camera_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
    )


def test_an_hour_takes_a_few_megabytes_and_any_place_of_it_a_moment():
    timeline = Timeline()
    # controls that change at every sample, as while a turn key is held
    for k in range(36_001):
        timeline.add(
            k * SAMPLE_INTERVAL_S,
            chaser(k * SAMPLE_INTERVAL_S),
            {"aim": (0.1 * k, np.sin(k), 1.0), "braking": False},
        )
    assert len(timeline) == 36_001
    assert timeline.memory_bytes < 20e6
    took = []
    for t_s in np.random.default_rng(1).uniform(0.0, 3600.0, 200):
        began = time.perf_counter()
        place = timeline.place(timeline.at(t_s))
        took.append(time.perf_counter() - began)
        assert place.t_s == pytest.approx(t_s, abs=SAMPLE_INTERVAL_S)
        assert place.steered == chaser(place.t_s)
    assert np.median(took) < 0.01


def test_a_place_is_what_was_flown_to_the_last_bit(session):
    fly(session, 1.0)
    fly(session, 1.0, "forward", "yaw-left")
    was = session.t_s, session.craft.steered, pickle.dumps(session.craft.controls()), session.scene()
    fly(session, 2.0, "left")
    end = session.scene()
    assert session.look_back.seek(was[0]) == pytest.approx(2.0)
    assert session.look_back.active
    now = session.t_s, session.craft.steered, pickle.dumps(session.craft.controls()), session.scene()
    assert now == was
    session.look_back.seek(1e9)
    assert not session.look_back.active
    assert session.scene() == end
    session.look_back.seek(0.5)
    assert session.craft.mode == "guidance"
    assert session.scene().t_s == pytest.approx(0.5)


def test_playing_shows_what_was_flown_and_stops_at_its_end(session):
    fly(session, 1.0, "forward")
    fly(session, 1.0)
    end = session.scene()
    ranges = {}
    session.look_back.seek(0.0)
    for _ in range(99):
        fly(session, TICK_S)
        ranges[session.t_s] = session.craft.world.range_m
    assert session.look_back.active
    # a cubic between samples: the flight itself, to a hundredth of a millimetre
    again = FlightSession.of(load_scenario("tango-flyaround"))
    for k in range(99):
        fly(again, TICK_S, *(("forward",) if k < 50 else ()))
        t_s = min(ranges, key=lambda t: abs(t - again.t_s))
        assert ranges[t_s] == pytest.approx(again.craft.world.range_m, abs=1e-5)
    fly(session, 1.0)
    assert session.clock.paused
    assert not session.look_back.active
    assert session.scene() == end


@pytest.mark.parametrize("rate", [1.0, 100.0])
def test_the_path_has_no_gap_at_any_rate_nor_while_looking_back(session, rate):
    session.clock.set_rate(rate)
    for _ in range(4):
        session.step(PilotCommand(), 0.5)
    live = session.look_back.path(session.craft.world)
    assert live[-1] == pytest.approx(session.craft.world.position_lvlh_m)
    longest_m = np.linalg.norm(np.diff(live, axis=0), axis=1).max()
    # a turn of the window takes up to 50 s of flight, 15 m
    assert longest_m < 1.0
    session.look_back.seek(0.5 * session.t_s)
    past = session.look_back.path(session.craft.world)
    assert len(past) >= len(live) - 1
    assert np.linalg.norm(np.diff(past, axis=0), axis=1).max() <= longest_m


def test_the_path_ends_at_the_state_of_an_earlier_picture(session):
    fly(session, 2.0)
    pictured = session.craft.world
    fly(session, 2.0)
    path = session.look_back.path(pictured)
    assert path[-1] == pytest.approx(pictured.position_lvlh_m)
    assert len(path) < len(session.look_back.trail.points)


def test_steering_flies_on_from_the_place_and_the_old_future_comes_back(session):
    fly(session, 1.0, "forward")
    fly(session, 2.0)
    end = session.scene()
    trail = len(session.look_back.trail.points)
    session.look_back.seek(1.0)
    fly(session, 1.0, "back")
    assert not session.look_back.active
    assert session.look_back.timeline.end_s == pytest.approx(2.0, abs=0.11)
    assert len(session.look_back.trail.points) < trail
    other = session.scene()
    assert session.look_back.timeline.left_s == pytest.approx((1.0, 3.0))
    assert session.look_back.swap_future() == pytest.approx(1.0)
    session.look_back.seek(3.0)
    assert session.scene() == end
    session.look_back.swap_future()
    session.look_back.seek(9.0)
    assert session.scene() == other


def test_a_command_that_changes_who_flies_takes_the_flight_up(session):
    fly(session, 2.0)
    session.look_back.seek(1.0)
    session.order(Stop())
    fly(session, 0.5)
    assert not session.look_back.active
    assert session.craft.steering.braking
    assert session.t_s == pytest.approx(1.5)


def test_flying_on_without_a_key_flies_the_same_again(session):
    fly(session, 1.0, "forward", "yaw-left")
    fly(session, 2.0)
    end = session.scene()
    session.look_back.seek(1.5)
    session.look_back.fly_on()
    fly(session, end.t_s - session.t_s)
    assert session.scene() == end


def test_a_restart_is_a_future_that_was_left(session):
    fly(session, 1.0, "forward")
    end = session.scene()
    session.restart()
    assert session.craft.mode == "guidance"
    fly(session, 0.5)
    session.look_back.swap_future()
    session.look_back.seek(1.0)
    assert session.scene() == end


def test_the_recording_follows(tmp_path):
    recorder = FlightRecorder()
    session = FlightSession.of(load_scenario("tango-flyaround"), recorder=recorder)
    recorder.keep_in(tmp_path, session.plan.scenario)
    fly(session, 3.0, "forward")
    session.look_back.seek(1.0)
    fly(session, 1.0, "back")
    times = recorder.recording.arrays["t_s"]
    assert times[-1] == pytest.approx(1.9)
    assert np.all(np.diff(times) > 0)
    session.look_back.swap_future()
    assert recorder.end_s == pytest.approx(2.9)
    assert recorder.close() is not None


def test_nothing_to_look_back_at_and_no_future_left(session):
    with pytest.raises(UserError, match="there is no flight to replay yet"):
        session.look_back.seek(0.0)
    fly(session, 1.0)
    with pytest.raises(UserError, match="no future was left"):
        session.look_back.swap_future()


def test_a_very_long_flight_is_kept_at_half_the_density(monkeypatch):
    monkeypatch.setattr("flyaround.simulator.piloting.flight_history.MAX_SAMPLES", 100)
    timeline = Timeline()
    t_s = 0.0
    for _ in range(400):
        if timeline.is_due(t_s):
            timeline.add(t_s, chaser(t_s), int(t_s))
        t_s += SAMPLE_INTERVAL_S
    assert len(timeline) <= 101
    assert timeline.time_of(0) == 0.0
    assert timeline.end_s > 38.0
    for k in range(len(timeline)):
        place = timeline.place(k)
        assert place.steered == chaser(place.t_s)
        assert place.controls == int(place.t_s)


def test_bookmarks_are_in_order_and_bounded():
    timeline = Timeline()
    for t_s in (3.0, 1.0, 2.0):
        timeline.bookmark(t_s, f"at {t_s}")
    timeline.bookmark(2.0, "  two\nlines ")
    assert [(b.t_s, b.note) for b in timeline.bookmarks] == [
        (1.0, "at 1.0"),
        (2.0, "two lines"),
        (3.0, "at 3.0"),
    ]
    timeline.unbookmark(2.2)
    assert [b.t_s for b in timeline.bookmarks] == [1.0, 3.0]
    for k in range(MAX_BOOKMARKS - 2):
        timeline.bookmark(10.0 + k, "x")
    with pytest.raises(UserError, match="bookmarks; remove one"):
        timeline.bookmark(5000.0, "one more")
