"""Recordings: bit-exact at their samples, close between them, and refused when broken."""

import os
import zipfile

import msgspec
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.docking_port import docking_port
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scenario.write import replay_scenario
from flyaround.simulator.world.flight import recording
from flyaround.simulator.world.flight.flight import record
from flyaround.simulator.world.flight.recording import Recording
from flyaround.simulator.world.frames.rotation import rotation_angle_rad


@pytest.mark.parametrize("name", ["tango-flyaround", "tango-vbar-approach", "tango-eclipse-pass"])
def test_replay_is_bit_exact(name, tmp_path):
    plan = plan_flight(load_scenario(name), n=50)
    (tmp_path / "flight.npz").write_bytes(record(plan.flight, plan.times_s).to_bytes())
    (tmp_path / "replay.toml").write_text(replay_scenario(plan.scenario, "flight.npz"))
    again = plan_flight(load_scenario(tmp_path / "replay.toml"), n=50)
    for k in range(50):
        assert again.flight.state(again.times_s[k]) == plan.flight.state(plan.times_s[k])
        assert again.scene(k) == plan.scene(k)


def test_replay_about_the_moon_draws_the_same(tmp_path):
    plan = plan_flight(load_scenario("lunar-orbit"), n=7)
    (tmp_path / "flight.npz").write_bytes(record(plan.flight, plan.times_s).to_bytes())
    (tmp_path / "replay.toml").write_text(replay_scenario(plan.scenario, "flight.npz"))
    again = plan_flight(load_scenario(tmp_path / "replay.toml"), n=7)
    assert [again.scene(k) for k in range(7)] == [plan.scene(k) for k in range(7)]


@pytest.mark.parametrize(
    "name", ["tango-vbar-approach", "tango-earth-10m", "geo-inspection", "lunar-orbit", "tango-flyaround"]
)
def test_a_replay_has_the_docking_port_of_the_flight(name, tmp_path):
    """The port is on the approach axis, LVLH, or in the model; its roll follows the camera's down side."""
    plan = plan_flight(load_scenario(name), n=20)
    (tmp_path / "flight.npz").write_bytes(record(plan.flight, plan.times_s).to_bytes())
    (tmp_path / "replay.toml").write_text(replay_scenario(plan.scenario, "flight.npz"))
    again = plan_flight(load_scenario(tmp_path / "replay.toml"), n=20)
    flown, replayed = (docking_port(p.target, p.flight) for p in (plan, again))
    assert replayed.origin_m == pytest.approx(flown.origin_m, abs=1e-4)
    assert rotation_angle_rad(replayed.q_target_from_port_wxyz, flown.q_target_from_port_wxyz) < 1e-4


def test_a_replay_of_a_replay_keeps_the_axis_of_approach_and_one_of_no_length_is_refused(tmp_path):
    plan = plan_flight(load_scenario("tango-flyaround"), n=5)
    (tmp_path / "flight.npz").write_bytes(record(plan.flight, plan.times_s).to_bytes())
    text = replay_scenario(plan.scenario, "flight.npz")
    (tmp_path / "replay.toml").write_text(text)
    assert "approach_axis_lvlh = [0.0, 1.0, 0.0]" in text
    again = replay_scenario(load_scenario(tmp_path / "replay.toml"), "flight.npz")
    assert "approach_axis_lvlh = [0.0, 1.0, 0.0]" in again
    (tmp_path / "replay.toml").write_text(text.replace("[0.0, 1.0, 0.0]", "[0.0, 0.0, 0.0]"))
    with pytest.raises(UserError, match=r"approach_axis_lvlh is \[0, 0, 0\], allowed: a direction"):
        load_scenario(tmp_path / "replay.toml")


def test_a_recording_of_no_length_does_not_take_the_scenario_s():
    scenario = load_scenario("tango-flyaround")
    assert "\nduration_s = 0.0\n" in replay_scenario(scenario, "flight.npz", 0.0)
    assert f"\nduration_s = {scenario.duration_s}\n" in replay_scenario(scenario, "flight.npz")


@pytest.mark.parametrize("guard", ["scenario", "port", "lifted", None])
def test_a_replay_keeps_the_keep_out_sphere_and_the_pilots_choice(guard, tmp_path):
    plan = plan_flight(load_scenario("tango-vbar-approach"), n=5)
    (tmp_path / "flight.npz").write_bytes(record(plan.flight, plan.times_s).to_bytes())
    (tmp_path / "replay.toml").write_text(replay_scenario(plan.scenario, "flight.npz", guard=guard))
    kept = load_scenario(tmp_path / "replay.toml")
    assert kept.chaser.keep_out.radius_m == plan.scenario.chaser.keep_out.radius_m
    assert FlightSession.of(kept).craft.steering.guard == (guard or "scenario")


def test_a_replay_without_the_choice_or_the_sphere_still_loads(tmp_path):
    plan = plan_flight(load_scenario("tango-vbar-approach"), n=5)
    (tmp_path / "flight.npz").write_bytes(record(plan.flight, plan.times_s).to_bytes())
    text = replay_scenario(plan.scenario, "flight.npz", guard="port")
    (tmp_path / "replay.toml").write_text(text.replace('pilot_choice = "port"\n', ""))
    assert FlightSession.of(load_scenario(tmp_path / "replay.toml")).craft.steering.guard == "scenario"
    without = msgspec.structs.replace(
        plan.scenario, chaser=msgspec.structs.replace(plan.scenario.chaser, keep_out=None)
    )
    (tmp_path / "replay.toml").write_text(replay_scenario(without, "flight.npz", guard="port"))
    assert load_scenario(tmp_path / "replay.toml").chaser.keep_out is None


def test_between_the_samples_it_is_close(tmp_path):
    plan = plan_flight(load_scenario("tango-flyaround"), every_s=1.0)
    (tmp_path / "flight.npz").write_bytes(record(plan.flight, plan.times_s).to_bytes())
    (tmp_path / "replay.toml").write_text(replay_scenario(plan.scenario, "flight.npz"))
    again = plan_flight(load_scenario(tmp_path / "replay.toml"), n=1).flight
    for t in (0.5, 17.25, 59.9):
        a, b = again.state(t), plan.flight.state(t)
        assert np.allclose(a.relative_eci_m, b.relative_eci_m, atol=1e-6)
        assert np.allclose(a.r_target_eci_m, b.r_target_eci_m, atol=1e-6)
        assert np.allclose(a.relative_eci_m_s, b.relative_eci_m_s, atol=1e-5)
        assert rotation_angle_rad(a.q_eci_from_target_wxyz, b.q_eci_from_target_wxyz) < 1e-3
        assert rotation_angle_rad(a.q_camera_from_eci_wxyz, b.q_camera_from_eci_wxyz) < 1e-3


def test_broken_recordings_are_named(tmp_path):
    with pytest.raises(UserError, match="cannot be read"):
        Recording.read(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no recording")
    with pytest.raises(UserError, match="is not a recording"):
        Recording.read(tmp_path / "text.npz")
    plan = plan_flight(load_scenario("tango-flyaround"), n=5)
    good = record(plan.flight, plan.times_s)
    backwards = {**good.arrays, "t_s": good.arrays["t_s"][::-1]}
    (tmp_path / "back.npz").write_bytes(Recording(backwards).to_bytes())
    with pytest.raises(UserError, match="must start at 0 s"):
        Recording.read(tmp_path / "back.npz")
    (tmp_path / "flight.npz").write_bytes(good.to_bytes())
    text = replay_scenario(plan.scenario, "flight.npz").replace("duration_s = 60.0", "duration_s = 90.0")
    (tmp_path / "long.toml").write_text(text)
    with pytest.raises(UserError, match="at most the 60 s of recording"):
        load_scenario(tmp_path / "long.toml")


def test_what_never_ends_or_unpacks_to_too_much_is_one_sentence(tmp_path, monkeypatch):
    for ending in ("csv", "npz"):
        os.mkfifo(tmp_path / f"pipe.{ending}")
        (tmp_path / f"zero.{ending}").symlink_to("/dev/zero")
        for name in ("pipe", "zero"):
            with pytest.raises(UserError, match="is a pipe or a device"):
                Recording.read(tmp_path / f"{name}.{ending}")
    bomb = tmp_path / "bomb.npz"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("t_s.npy", bytes(5_000_000))
    assert bomb.stat().st_size < 100_000
    monkeypatch.setattr(recording, "MAX_BYTES", 1_000_000)
    with pytest.raises(
        UserError, match=r"bomb.npz is not a recording of a flight: unpacked it has 5,000,000"
    ):
        Recording.read(bomb)
    (tmp_path / "long.csv").write_bytes(bytes(1_000_001))
    with pytest.raises(UserError, match="are read; make it smaller"):
        Recording.read(tmp_path / "long.csv")


@pytest.mark.parametrize("times", [np.array(0.0), np.zeros((3, 2)), np.array(["a"]), np.zeros(2, "f8,f8")])
def test_times_that_are_no_times_are_one_sentence(tmp_path, times):
    good = record(plan_flight(load_scenario("tango-flyaround"), n=3).flight, [0.0, 1.0])
    np.savez(tmp_path / "odd.npz", **{**good.arrays, "t_s": times})
    with pytest.raises(UserError, match=r"recording"):
        Recording.read(tmp_path / "odd.npz")
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(UserError, match="is not a recording"):
        Recording.read(tmp_path / "one.npy")
