"""Recordings of an operator's flight: on disk while it is flown, whole after a full disk, replayed to the bit."""

import shutil

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.recorder import FlightRecorder
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.flight.recording import Recording, csv_header
from tests.harness.full_device import FULL, needs_full_device
from tests.harness.pilot import fly
from tests.harness.small_disk import small_disk
from tests.harness.turned_clock import TurnedClock


def test_a_flight_is_on_disk_while_it_is_flown(tmp_path):
    clock = TurnedClock()
    recorder = FlightRecorder(clock)
    session = FlightSession.of(load_scenario("tango-flyaround"), recorder=recorder)
    recorder.keep_in(tmp_path / "flown", session.plan.scenario)
    for _ in range(3):
        fly(session, 0.5, "forward", "yaw-left")
        clock.now_s += 1.01
    fly(session, 0.5)
    lines = tmp_path / "flown" / "flight.csv"
    # what a console leaves that is killed while it writes a line
    with lines.open("a") as file:
        file.write("2.0,6778137.0,")
    replay = load_scenario(tmp_path / "flown" / "replay.toml")
    assert replay.duration_s == pytest.approx(1.5)
    flight = plan_flight(replay, n=1).flight
    flown = recorder.recording.arrays
    times = [t for t in flown["t_s"] if t <= replay.duration_s]
    for name, values in Recording.from_states(flight.state(float(t)) for t in times).arrays.items():
        assert np.array_equal(values, flown[name][: len(times)]), name
    assert recorder.close() == tmp_path / "flown" / "replay.toml"
    assert sorted(path.name for path in (tmp_path / "flown").iterdir()) == ["flight.npz", "replay.toml"]
    assert load_scenario(tmp_path / "flown" / "replay.toml").duration_s == recorder.end_s


def test_a_restart_begins_another_recording(tmp_path):
    clock = TurnedClock()
    recorder = FlightRecorder(clock)
    session = FlightSession.of(load_scenario("tango-flyaround"), recorder=recorder)
    recorder.keep_in(tmp_path, session.plan.scenario)
    clock.now_s = 2.0
    fly(session, 1.0)
    assert (tmp_path / "replay.toml").is_file()
    session.restart()
    assert [path.name for path in tmp_path.iterdir()] == ["flight.csv"]
    # nothing to replay
    assert recorder.close() is None
    assert list(tmp_path.iterdir()) == []


def test_a_recording_is_not_written_over(tmp_path):
    (tmp_path / "flight.npz").write_bytes(b"an earlier one")
    with pytest.raises(UserError, match="is not empty; name a new one with --record"):
        FlightRecorder().keep_in(tmp_path, load_scenario("tango-flyaround"))


@needs_full_device
def test_a_full_disk_ends_the_recording_and_not_the_flight(tmp_path):
    recorder = FlightRecorder()
    session = FlightSession.of(load_scenario("tango-flyaround"), recorder=recorder)
    recorder.keep_in(tmp_path, session.plan.scenario)
    (tmp_path / "flight.csv").unlink()
    (tmp_path / "flight.csv").symlink_to(FULL)
    session.restart()
    fly(session, 1.0)
    assert "No space left on device" in str(recorder.take_trouble())
    assert recorder.take_trouble() is None
    # whole at the end, from memory
    replay = recorder.close()
    assert replay is not None
    assert load_scenario(replay).duration_s == recorder.end_s


def test_a_recording_whose_folder_is_gone_is_told_and_made_again_at_the_end(tmp_path):
    clock = TurnedClock()
    recorder = FlightRecorder(clock)
    session = FlightSession.of(load_scenario("tango-flyaround"), recorder=recorder)
    recorder.keep_in(tmp_path / "flown", session.plan.scenario)
    shutil.rmtree(tmp_path / "flown")
    clock.now_s = 2.0
    fly(session, 1.0)
    assert "recording stopped" in str(recorder.take_trouble())
    replay = recorder.close()
    assert replay is not None
    assert load_scenario(replay).duration_s == recorder.end_s


def test_a_disk_that_stays_full_leaves_no_half_flight(tmp_path):
    with small_disk(tmp_path / "disk", 40) as disk:
        recorder = FlightRecorder()
        session = FlightSession.of(load_scenario("tango-flyaround"), recorder=recorder)
        recorder.keep_in(disk / "flown", session.plan.scenario)
        (disk / "other").write_bytes(bytes(24 * 1024))
        fly(session, 8.0)
        # either file may be the first to meet the full disk; the replay file's message is the simulator's own
        assert "no space left" in str(recorder.take_trouble()).lower()
        assert session.t_s > 7.0
        with pytest.raises(UserError, match="no space left"):
            recorder.close()
        assert not (disk / "flown" / "flight.npz").exists()
        # its lines stay, as far as they went
        assert Recording.read(disk / "flown" / "flight.csv").duration_s > 0.5


def test_lines_that_are_no_flight_are_refused(tmp_path):
    path = tmp_path / "flight.csv"
    for text in ("", "t_s,x\n0.0,1.0\n", csv_header() + "0.0,1.0\n", csv_header()):
        path.write_text(text)
        with pytest.raises(UserError, match=r"flight\.csv"):
            Recording.read(path)


def test_a_steered_flight_is_replayed_bit_for_bit(tmp_path):
    recorder = FlightRecorder()
    session = FlightSession.of(load_scenario("tango-flyaround"), recorder=recorder)
    fly(session, 1.0)
    fly(session, 1.5, "forward", "yaw-left")
    fly(session, 0.5)
    recorder.keep_in(tmp_path / "flown", session.plan.scenario)
    path = recorder.close()
    assert path is not None
    replay = load_scenario(path)
    assert replay.duration_s == pytest.approx(2.9)
    flight = plan_flight(replay, n=1).flight
    flown = recorder.recording.arrays
    assert flown["t_s"][:3] == pytest.approx([0.0, 0.1, 0.2])
    for name, values in Recording.from_states(flight.state(float(t)) for t in flown["t_s"]).arrays.items():
        assert np.array_equal(values, flown[name]), name
    # back to the start: another flight
    session.restart()
    assert not recorder.long_enough
