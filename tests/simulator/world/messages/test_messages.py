"""TLE, OEM and AEM: published vectors, round trips, one-sentence errors."""

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.flight.export import flight_messages
from flyaround.simulator.world.frames.rotation import quat_from_rotvec, quat_multiply, rotation_angle_rad
from flyaround.simulator.world.messages.aem import read_aem_state, write_aem
from flyaround.simulator.world.messages.ccsds import read_time
from flyaround.simulator.world.messages.oem import write_oem
from flyaround.simulator.world.messages.tle import R_eci_from_teme, check_line, state_from_tle
from flyaround.simulator.world.time.instant import Instant
from tests.harness.oem import oem_state

# Vanguard 1, the first verification case of Vallado et al. (2006), and its state at the epoch in TEME
LINE1 = "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753"
LINE2 = "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667"
R_TEME_KM = [7022.46529266, -1400.08296755, 0.03995155]
V_TEME_KM_S = [1.893841015, 6.405893759, 4.534807250]
EPOCH = Instant.from_utc("2000-06-27T18:50:19.733568Z")

# CCSDS 502.0-B-3, annex: a Mars mission's message there; here with the Earth as its centre
OEM = """CCSDS_OEM_VERS = 2.0
CREATION_DATE = 1996-11-04T17:22:31
ORIGINATOR = NASA/JPL

META_START
OBJECT_NAME = PROBE
OBJECT_ID = 1996-062A
CENTER_NAME = EARTH
REF_FRAME = EME2000
TIME_SYSTEM = UTC
START_TIME = 1996-12-18T12:00:00.331
STOP_TIME = 1996-12-18T12:03:00.331
INTERPOLATION = HERMITE
INTERPOLATION_DEGREE = 7
META_STOP
COMMENT  This file was produced by hand
1996-12-18T12:00:00.331 2789.619 -280.045 -1746.755 4.73372 -2.49586 -1.04195
1996-12-18T12:01:00.331 2783.419 -308.143 -1877.071 5.18604 -2.42124 -1.99608
1996-12-18T12:02:00.331 2776.033 -336.859 -2008.682 5.63678 -2.33951 -1.94687
COVARIANCE_START
EPOCH = 1996-12-18T12:00:00.331
3.3313494e-04
COVARIANCE_STOP
"""


def test_sgp4_gives_the_published_state():
    r, v = state_from_tle(LINE1, LINE2, EPOCH)
    R = R_eci_from_teme(EPOCH)
    assert np.allclose(R.T @ r / 1e3, R_TEME_KM, atol=1e-5)
    assert np.allclose(R.T @ v / 1e3, V_TEME_KM_S, atol=1e-8)


def test_teme_turns_as_vallado_has_it():
    """Vallado (2013), example 3-15: one position in TEME and in J2000 (IAU 1976/1980 with its corrections)."""
    t = Instant.from_utc("2004-04-06T07:51:28.386009Z")
    teme = np.array([5094.18016210, 6127.64465950, 6380.34453270])
    gcrf = np.array([5102.50895790, 6123.01140070, 6378.13692820])
    assert np.linalg.norm(R_eci_from_teme(t) @ teme - gcrf) < 1e-3


@pytest.mark.parametrize(
    ("line1", "line2", "utc", "sentence"),
    [
        (LINE1[:-1] + "4", LINE2, "2000-06-28T00:00:00Z", "checksum 4"),
        (LINE1[:-2], LINE2, "2000-06-28T00:00:00Z", "69 characters"),
        (LINE2, LINE1, "2000-06-28T00:00:00Z", "line 1"),
        (LINE1, LINE2, "2001-06-28T00:00:00Z", "365 days older"),
    ],
)
def test_mistakes_of_a_tle(line1, line2, utc, sentence):
    with pytest.raises(UserError, match=sentence):
        state_from_tle(line1, line2, Instant.from_utc(utc))


def test_oem_of_the_standard_is_read():
    r, v = oem_state(OEM, "x.oem", Instant.from_utc("1996-12-18T12:01:00.331Z"))
    # the frame bias of 23 mas moves 3,400 km by 0.4 m
    assert np.allclose(r, [2783419.0, -308143.0, -1877071.0], atol=0.5)
    assert np.allclose(v, [5186.04, -2421.24, -1996.08], atol=0.01)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("CCSDS_OEM_VERS", "CCSDS_OPM_VERS", "not a CCSDS OEM"),
        ("EME2000", "TDR", "REF_FRAME is TDR, allowed: GCRF"),
        ("= UTC", "= MET", "TIME_SYSTEM is MET, allowed: UTC"),
        ("= EARTH", "= MARS", "CENTER_NAME is MARS"),
        ("12:01:00.331 2783", "11:01:00.331 2783", "not later than the line before"),
        ("12:01:00.331 2783.419", "12:01:00.331 nan", "finite"),
        ("-1.94687", "", "has 5 values"),
        ("12:02:00.331 2776", "12:72:00.331 2776", "line 19: 1996-12-18T12:72"),
        ("TIME_SYSTEM = UTC\n", "", "lacks the key TIME_SYSTEM"),
    ],
)
def test_mistakes_of_an_oem(old, new, sentence):
    with pytest.raises(UserError, match=sentence):
        oem_state(OEM.replace(old, new), "x.oem", Instant.from_utc("1996-12-18T12:00:30Z"))


def test_epoch_outside_and_in_a_gap():
    with pytest.raises(UserError, match="covers 1996-12-18T12:00:00"):
        oem_state(OEM, "x.oem", Instant.from_utc("1996-12-19T00:00:00Z"))
    row = "1996-12-18T{} 2776.033 -336.859 -2008.682 5.63678 -2.33951 -1.94687\n"
    gap = OEM.replace("COVARIANCE_START", row.format("14:00:00") + "COVARIANCE_START")
    with pytest.raises(UserError, match="are missing before it"):
        oem_state(gap, "x.oem", Instant.from_utc("1996-12-18T13:00:00Z"))


@pytest.mark.parametrize(("system", "ahead_s"), [("UTC", 0.0), ("TAI", 37.0), ("TT", 69.184), ("GPS", 18.0)])
def test_time_systems_are_converted_to_utc(system, ahead_s):
    same = read_time("2026-079T12:00:00", system, "x")
    assert Instant.from_utc("2026-03-20T12:00:00Z").minus(same) == pytest.approx(ahead_s, abs=1e-4)


def test_flight_round_trips_through_messages(tmp_path):
    """To the millimetre, at lines and between them; and a scenario starts from the files."""
    plan = plan_flight(load_scenario("tango-flyaround"), every_s=5.0)
    messages = flight_messages(plan.flight, plan.times_s)
    assert sorted(messages) == ["chaser.aem", "chaser.oem", "target.aem", "target.oem"]
    for t in (0.0, 17.3, 60.0):
        state, epoch = plan.flight.state(t), plan.flight.epoch.plus(t)
        for name in ("target", "chaser"):
            r, v = oem_state(messages[f"{name}.oem"], name, epoch)
            assert np.allclose(r, getattr(state, f"r_{name}_eci_m"), atol=1e-3)
            assert np.allclose(v, getattr(state, f"v_{name}_eci_m_s"), atol=1e-5)
        q, rate = read_aem_state(messages["target.aem"], "target", epoch)
        assert rotation_angle_rad(q, state.q_eci_from_target_wxyz) < 3e-4
        assert np.allclose(rate, state.omega_target_rad_s, atol=5e-4)
    for name, text in messages.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "s.toml").write_text(
        'epoch_utc = 2026-08-20T09:30:20Z\nduration_s = 5.0\norbit = {kind = "oem", file = "target.oem"}\n'
        'attitude = {aem_file = "target.aem"}\nchaser = {mode = "hold", position_lvlh_m = [0, 9, 0]}\n'
    )
    again = plan_flight(load_scenario(tmp_path / "s.toml"), n=1).flight.state(5.0)
    there = plan.flight.state(25.0)
    assert np.allclose(again.r_target_eci_m, there.r_target_eci_m, atol=2e-3)
    assert rotation_angle_rad(again.q_eci_from_target_wxyz, there.q_eci_from_target_wxyz) < 5e-3


def test_aem_directions_and_order_of_the_scalar():
    q = quat_multiply(quat_from_rotvec([0.3, -0.2, 0.9]), [1, 0, 0, 0])
    times = ["2026-03-20T12:00:00.000000Z", "2026-03-20T12:00:10.000000Z"]
    turned = quat_multiply(q, quat_from_rotvec([0.0, 0.0, 0.5]))
    text = write_aem(name="A", body_frame="SC_BODY_1", epochs_utc=times, q_eci_from_body_wxyz=[q, turned])
    epoch = Instant.from_utc("2026-03-20T12:00:04Z")
    found, rate = read_aem_state(text, "a.aem", epoch)
    assert np.allclose(rate, [0, 0, 0.05], atol=1e-10)
    assert rotation_angle_rad(found, quat_multiply(q, quat_from_rotvec([0, 0, 0.2]))) < 1e-10
    swapped = text.replace("A2B", "B2A").replace("FRAME_A = GCRF", "FRAME_A = X")
    swapped = swapped.replace("FRAME_B = SC_BODY_1", "FRAME_B = GCRF")
    # naming the frames the other way round and the direction too is the same attitude
    assert rotation_angle_rad(read_aem_state(swapped, "a.aem", epoch)[0], found) < 1e-10
    with pytest.raises(UserError, match="ATTITUDE_TYPE is SPIN/NUTATION"):
        read_aem_state(text.replace("= QUATERNION\n", "= SPIN/NUTATION\n"), "a.aem", epoch)
    with pytest.raises(UserError, match="neither REF_FRAME_A = LVLH nor"):
        read_aem_state(text.replace("GCRF", "LVLH"), "a.aem", epoch)


def test_oem_keeps_micrometres():
    times = ["2026-03-20T12:00:00.000000Z", "2026-03-20T12:01:00.000000Z"]
    r = np.array([[7078137.123456, -1.000001, 3.25], [7000000.5, 450000.0, 1.0]])
    v = np.array([[1.123456789, 7500.0, -3.0], [-500.0, 7480.0, 2.0]])
    text = write_oem(name="A", epochs_utc=times, r_eci_m=r, v_eci_m_s=v)
    back = oem_state(text, "a.oem", Instant.from_utc(times[0]))
    assert np.allclose(back[0], r[0], atol=1e-6, rtol=0)
    assert np.allclose(back[1], v[0], atol=1e-9, rtol=0)


@pytest.mark.parametrize("place", [20, -1])
def test_a_digit_that_is_not_ascii_is_refused(place):
    line = list(LINE1)
    line[place] = "\N{SUPERSCRIPT TWO}"
    with pytest.raises(UserError, match="line 1 of the two-line elements is"):
        check_line("".join(line), 1)


def test_scenario_starts_from_a_tle(tmp_path):
    path = tmp_path / "s.toml"
    text = (
        'epoch_utc = 2000-06-27T18:50:19.733568Z\nduration_s = 5.0\norbit = {{kind = "tle", line1 = "{}", '
        'line2 = "{}"}}\nchaser = {{mode = "hold", position_lvlh_m = [0, 9, 0]}}\n'
    )
    path.write_text(text.format(LINE1, LINE2))
    state = plan_flight(load_scenario(path), n=1).flight.state(0.0)
    assert np.allclose(state.r_target_eci_m, state_from_tle(LINE1, LINE2, EPOCH)[0], atol=1e-6)
    path.write_text(text.format(LINE1[:-1] + "0", LINE2))
    with pytest.raises(UserError, match=r"s\.toml: line 1 of the two-line elements has checksum 0"):
        load_scenario(path)
