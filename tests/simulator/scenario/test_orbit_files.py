"""Orbit files of users: followed between their lines, read in their varieties, or named for what they are."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.orbit_files import read_orbit_file
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.flight.export import flight_messages
from flyaround.simulator.world.messages.tle import state_from_tle
from flyaround.simulator.world.time.instant import Instant

REPORTS = Path(__file__).parents[2] / "data" / "reports"
EPOCH = Instant.from_utc("2026-03-20T12:00:00Z")
MU_KM = 398600.4418
R0, V0 = np.array([6800.0, 300.0, -200.0]), np.array([-0.2, 5.1, 5.6])


def checked(line):
    """A line of elements with its checksum."""
    return line[:-1] + str(sum(int(c) if c.isdigit() else c == "-" for c in line[:-1]) % 10)


TLE = (
    checked("1 25544U 98067A   20153.50347222  .00000950  00000-0  25302-4 0  9990"),
    checked("2 25544  51.6443 242.0161 0004885 264.6060 207.3845 15.49000000212790"),
)
SCENARIO = """epoch_utc = {epoch}
duration_s = {duration}
[orbit]
{orbit}
[chaser]
{chaser}
"""
HOLD = 'mode = "hold"\nposition_lvlh_m = [0.0, -9.0, 0.0]'


def truth(times_s):
    """States [km], [km/s] of a body about a round Earth, by another integrator than ours."""

    def rate(_, y):
        return np.concatenate([y[3:], -MU_KM * y[:3] / np.linalg.norm(y[:3]) ** 3])

    order = np.argsort(times_s)
    back, ahead = times_s[order] < 0, times_s[order] >= 0
    out = np.empty((len(times_s), 6))
    for chosen in (back, ahead):
        t = times_s[order][chosen]
        if len(t):
            far = t[0] if t[0] < 0 else max(t[-1], 1.0)
            solved = solve_ivp(
                rate, (0.0, far), np.r_[R0, V0], method="LSODA", rtol=1e-12, atol=1e-9, dense_output=True
            )
            out[order[chosen]] = solved.sol(t).T
    return out


def oem(times_s, *, meta="", frame="GCRF", states=None):
    states = truth(times_s) if states is None else states
    rows = "\n".join(
        f"{EPOCH.plus(float(t)).iso()[:-1]} " + " ".join(f"{x:.12f}" for x in y)
        for t, y in zip(times_s, states, strict=True)
    )
    return (
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n"
        f"META_START\nOBJECT_NAME = A\nOBJECT_ID = 2026-001A\nCENTER_NAME = EARTH\nREF_FRAME = {frame}\n"
        f"TIME_SYSTEM = UTC\nSTART_TIME = 2026-01-01T00:00:00\nSTOP_TIME = "
        f"2026-12-01T00:00:00\n{meta}META_STOP\n{rows}\n"
    )


def scenario(folder, *, orbit, chaser=HOLD, duration=1800.0):
    path = folder / "s.toml"
    path.write_text(
        SCENARIO.format(epoch="2026-03-20T12:00:00Z", duration=duration, orbit=orbit, chaser=chaser)
    )
    return path


@pytest.mark.parametrize(
    ("meta", "step_s", "r_m", "v_m_s"),
    [
        ("", 60.0, 1e-3, 1e-5),
        ("INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 7\n", 60.0, 1e-3, 1e-4),
        ("INTERPOLATION = Lagrange\nINTERPOLATION_DEGREE = 7\n", 60.0, 0.01, 1e-3),
        ("INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 6\n", 30.0, 0.01, 1e-3),
        ("INTERPOLATION = LINEAR\nINTERPOLATION_DEGREE = 1\n", 1.0, 1.5, 2e-3),
    ],
)
def test_a_file_is_followed_by_the_interpolation_it_names(meta, step_s, r_m, v_m_s):
    """Against a dense ephemeris of an independent integrator, at the ends too."""
    found = read_orbit_file(
        oem(np.arange(-600.0, 1800.0 + step_s, step_s), meta=meta).encode(), "a.oem", EPOCH
    )
    assert not isinstance(found, tuple)
    times = np.linspace(0.0, 1500.0, 61) + 7.3
    y = truth(times) * 1e3
    for t, expected in zip(times.tolist(), y, strict=True):
        r, v, a = found(t)
        assert np.linalg.norm(r - expected[:3]) < r_m
        assert np.linalg.norm(v - expected[3:]) < v_m_s
        pull = -MU_KM * 1e9 * expected[:3] / np.linalg.norm(expected[:3]) ** 3
        assert np.linalg.norm(a - pull) < 0.01


def test_linear_interpolation_is_linear():
    """A chord lies some kilometres inside the arc of a minute."""
    text = oem(np.array([0.0, 60.0, 120.0]), meta="INTERPOLATION = LINEAR\nINTERPOLATION_DEGREE = 1\n")
    found = read_orbit_file(text.encode(), "a.oem", EPOCH)
    assert not isinstance(found, tuple)
    y = truth(np.array([0.0, 60.0])) * 1e3
    assert np.allclose(found(15.0)[0], 0.75 * y[0, :3] + 0.25 * y[1, :3], rtol=0, atol=1e-3)
    assert np.allclose(found(15.0)[1], 0.75 * y[0, 3:] + 0.25 * y[1, 3:], rtol=0, atol=1e-6)


def test_a_flight_follows_its_file_and_its_truth_is_consistent(tmp_path):
    """The target where the file has it after half an hour, and rates that are slopes of places."""
    (tmp_path / "a.oem").write_text(oem(np.arange(-600.0, 2401.0, 60.0)))
    flight = plan_flight(load_scenario(scenario(tmp_path, orbit='kind = "oem"\nfile = "a.oem"')), n=2).flight
    for t in (0.0, 613.7, 1800.0):
        state = flight.state(t)
        expected = truth(np.array([t, 1e-9]))[0] * 1e3
        assert np.allclose(state.r_target_eci_m, expected[:3], rtol=0, atol=2e-3)
        assert np.allclose(state.v_target_eci_m_s, expected[3:], rtol=0, atol=1e-4)
    before, now, after = (flight.state(900.0 + d) for d in (-0.5, 0.0, 0.5))
    for place, rate in (("r_target_eci_m", "v_target_eci_m_s"), ("relative_eci_m", "relative_eci_m_s")):
        slope = np.subtract(getattr(after, place), getattr(before, place))
        assert np.allclose(slope, getattr(now, rate), rtol=0, atol=1e-3)
    # without following, the oblate Earth of the scenario takes it elsewhere
    path = scenario(tmp_path, orbit='kind = "oem"\nfile = "a.oem"\nmotion = "propagate"')
    other = plan_flight(load_scenario(path), n=2).flight.state(1800.0)
    assert np.linalg.norm(np.subtract(other.r_target_eci_m, flight.state(1800.0).r_target_eci_m)) > 100.0


@pytest.mark.parametrize("spacing_s", [5.0, 7.0 / 3.0])
def test_a_flight_written_and_followed_is_the_same_flight(tmp_path, spacing_s):
    """Both craft by their files, to the millimetre, and the range between them too."""
    plan = plan_flight(load_scenario("tango-flyaround"), every_s=spacing_s)
    for name, text in flight_messages(plan.flight, plan.times_s, aem=False).items():
        (tmp_path / name).write_text(text)
    path = scenario(
        tmp_path, orbit='kind = "oem"\nfile = "target.oem"', chaser='mode = "oem"\nfile = "chaser.oem"'
    )
    text = path.read_text().replace("2026-03-20T12:00:00Z", plan.flight.epoch.iso()).replace("1800.0", "50.0")
    path.write_text(text)
    again = plan_flight(load_scenario(path), n=2).flight
    for t in (0.0, 3.3, 21.7, 50.0):
        was, now = plan.flight.state(t), again.state(t)
        assert np.allclose(now.r_target_eci_m, was.r_target_eci_m, rtol=0, atol=2e-3)
        assert np.allclose(now.relative_eci_m, was.relative_eci_m, rtol=0, atol=2e-3)
        assert np.allclose(now.relative_eci_m_s, was.relative_eci_m_s, rtol=0, atol=2e-3)


def burnt_oem():
    """Two segments: at 600 s a burn of 1 m/s along the velocity, as an operator writes it."""
    early = truth(np.arange(0.0, 601.0, 60.0))
    late = truth(np.arange(600.0, 1801.0, 60.0))
    late[:, :3] += np.outer(np.arange(0.0, 1201.0, 60.0), V0 / np.linalg.norm(V0) * 1e-3)
    late[:, 3:] += V0 / np.linalg.norm(V0) * 1e-3
    first, second = (
        oem(np.arange(0.0, 601.0, 60.0), states=early),
        oem(np.arange(600.0, 1801.0, 60.0), states=late),
    )
    return first + second[second.index("META_START") :]


def test_segments_meet_at_a_burn_and_nothing_is_interpolated_across_it(tmp_path):
    (tmp_path / "a.oem").write_text(burnt_oem())
    orbit = 'kind = "oem"\nfile = "a.oem"'
    flight = plan_flight(load_scenario(scenario(tmp_path, orbit=orbit)), n=2).flight
    before, after = (np.array(flight.state(t).v_target_eci_m_s) for t in (600.0 - 1e-6, 600.0))
    assert np.linalg.norm(after - before) == pytest.approx(1.0, abs=0.01)
    assert np.allclose(
        flight.state(590.0).r_target_eci_m, truth(np.array([590.0, 1.0]))[0, :3] * 1e3, rtol=0, atol=2e-3
    )
    drifting = 'mode = "drift"\nposition_lvlh_m = [0.0, -9.0, 0.0]'
    with pytest.raises(
        UserError, match=r"changes the target's velocity by 1 m/s in addition to gravity between 5\d\d"
    ):
        plan_flight(load_scenario(scenario(tmp_path, orbit=orbit, chaser=drifting)), n=2)


def test_free_flight_beside_a_followed_target_is_that_beside_a_propagated_one(tmp_path):
    """What is not in the scenario's forces acts on both craft: half an hour apart by millimetres, not by metres."""
    (tmp_path / "a.oem").write_text(oem(np.arange(0.0, 1801.0, 60.0)))
    chaser = 'mode = "drift"\nposition_lvlh_m = [3.0, -20.0, 1.0]\n[forces]\ngravity_degree = 0'
    ends = []
    for motion in ("oem", "propagate"):
        orbit = f'kind = "oem"\nfile = "a.oem"\nmotion = "{motion}"'
        flight = plan_flight(load_scenario(scenario(tmp_path, orbit=orbit, chaser=chaser)), n=2).flight
        ends.append(flight.state(1800.0).position_lvlh_m)
    assert np.allclose(ends[0], ends[1], rtol=0, atol=0.05)


def test_epochs_outside_the_useable_span_are_refused(tmp_path):
    meta = "USEABLE_START_TIME = 2026-03-20T12:01:00\nUSEABLE_STOP_TIME = 2026-03-20T12:20:00\n"
    (tmp_path / "a.oem").write_text(oem(np.arange(0.0, 1801.0, 60.0), meta=meta))
    with pytest.raises(UserError, match=r"covers 2026-03-20T12:01:00.* to 2026-03-20T12:20:00"):
        load_scenario(scenario(tmp_path, orbit='kind = "oem"\nfile = "a.oem"'))


@pytest.mark.parametrize("report", ["oem_bom/bom", "oem_repeated_epoch/rep", "oem_xml/iss_style"])
def test_reported_ephemerides_are_the_same_orbit(report):
    state = plan_flight(load_scenario(REPORTS / f"{report}.toml"), n=1).flight.state(0.0)
    assert np.allclose(state.r_target_eci_m, [-4261180.0, -4657605.6, 2514794.8], rtol=0, atol=0.1)
    assert np.allclose(state.v_target_eci_m_s, [2333.702, -5012.155, -5304.352], rtol=0, atol=1e-2)


def test_reported_elements_and_states_are_read():
    mean = plan_flight(load_scenario(REPORTS / "orbit_other_files/omm.toml"), n=1).flight.state(0.0)
    lines = state_from_tle(*TLE, Instant.from_utc("2020-06-01T12:05:00Z"))
    assert np.allclose(mean.r_target_eci_m, lines[0], rtol=0, atol=20.0)
    state = plan_flight(load_scenario(REPORTS / "orbit_other_files/opm.toml"), n=1).flight.state(0.0)
    assert np.allclose(state.r_target_eci_m, [-4261180.0, -4657600.0, 2514790.0], rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("report", "sentence"),
    [
        ("oem_variants/metres", "the values look like metres, and CCSDS has km"),
        ("orbit_other_files/stk", r"is an STK ephemeris \(\.e\)"),
        (
            "tle_long_before_epoch/decay_25d_before",
            "SGP4 propagates the two-line elements over 25.1 days to a position",
        ),
    ],
)
def test_reported_files_that_are_refused(report, sentence):
    with pytest.raises(UserError, match=sentence):
        load_scenario(REPORTS / f"{report}.toml")


GOOD = oem(np.arange(-60.0, 121.0, 60.0))


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (GOOD.replace("OBJECT_NAME", "object_name").encode(), "key object_name is not in upper case"),
        (GOOD.replace("REF_FRAME", "REF_FRAM").encode(), "unknown key 'REF_FRAM', did you mean REF_FRAME"),
        (GOOD.replace("GCRF", "MOD").encode(), "REF_FRAME is MOD, allowed: GCRF"),
        (GOOD.replace("= UTC", "= SCLK").encode(), "TIME_SYSTEM is SCLK, allowed: UTC"),
        (GOOD.replace("= A\n", "= A\nOBJECT_NAME = B\n").encode(), "key OBJECT_NAME is given twice"),
        (GOOD.encode("utf-16"), "is UTF-16 text: save it as UTF-8"),
        (
            GOOD.replace("= TEST", "= Orbité").encode("latin-1"),
            "line 3: byte 0xe9; it may be Latin-1",
        ),
        (b"\0\1\2" * 50, "is a binary file"),
        (b"", "is empty"),
        (b"DAF/SPK NAIF" + bytes(90), "is an SPK kernel"),
        (b"#cP2020  6  1  0  0  0.00000000      96 ORBIT IGS14 HLM  IGS\n", "is an SP3 orbit file"),
        (b"H1 CPF  2  SGF 2020 06 01 12  153 01 lageos1\n", "is a CPF"),
        (b"*******\n Ephemeris / API_USER\n$$SOE\n", "is Horizons' text"),
        (b"CCSDS_OCM_VERS = 3.0\n", "is a CCSDS OCM"),
        (b"<!DOCTYPE html><html></html>", "is a web page"),
        (b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><oem/>', "declares a DTD"),
        (b"<kml></kml>", "is XML of kind <kml>"),
        (b"<oem><body>", "is not well-formed XML"),
        (b"\x1f\x8b\x08", "is compressed by gzip"),
        (b'[{"NAME": 1}]', "unknown key 'NAME'"),
        (b"[" * 100, "nests more than"),
        (b"hello\n", "is not in a known orbit format"),
    ],
)
def test_a_file_that_is_not_read_is_named(data, sentence):
    with pytest.raises(UserError, match=sentence) as caught:
        read_orbit_file(data, "a.oem", EPOCH)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "changed",
    [
        GOOD.replace("\n", "\r\n"),
        "\ufeff" + GOOD,
        GOOD.replace("= TEST", "= TEST\nCOMMENT x = y\n"),
        GOOD.replace(".000000 6", ".000000 +6"),
        GOOD.replace("CENTER_NAME = EARTH", "CENTER_NAME = Earth"),
    ],
)
def test_harmless_varieties_of_a_file_are_the_same_ephemeris(changed):
    found, plain = (read_orbit_file(t.encode(), "a.oem", EPOCH) for t in (changed, GOOD))
    assert not isinstance(found, tuple)
    assert not isinstance(plain, tuple)
    assert np.array_equal(found(30.0), plain(30.0))


def test_fortran_exponents_are_numbers():
    rows = GOOD.splitlines()
    words = rows[-1].split()
    rows[-1] = " ".join([words[0], *(f"{float(w):.15e}".replace("e", "D") for w in words[1:])])
    found, plain = (read_orbit_file(t.encode(), "a.oem", EPOCH) for t in ("\n".join(rows), GOOD))
    assert not isinstance(found, tuple)
    assert not isinstance(plain, tuple)
    assert np.allclose(found(110.0)[0], plain(110.0)[0], rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda y: np.c_[y[:, :3] * 0.8, y[:, 3:]], "the position is .* allowed: at least 6478 km"),
        (lambda y: np.c_[y[:, :3], y[:, 3:] * 1e3], "the velocities look like m/s"),
        (
            lambda y: np.c_[y[:, :3], y[:, [4, 3, 5]]],
            "the velocities differ by .* m/s from the rate of change of the positions",
        ),
    ],
)
def test_values_that_are_no_orbit_are_refused(change, sentence):
    times = np.arange(-60.0, 121.0, 60.0)
    with pytest.raises(UserError, match=sentence):
        read_orbit_file(oem(times, states=change(truth(times))).encode(), "a.oem", EPOCH)  # type: ignore[operator]


TLE_EPOCH = Instant.from_utc("2020-06-01T12:05:00Z")


@pytest.mark.parametrize("name", ["", "ISS (ZARYA)\n", "0 ISS (ZARYA)\n", "# from a web page\n\n"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "   \n"])
def test_varieties_of_element_files(name, end):
    found = read_orbit_file((name + end.join([*TLE, ""])).encode(), "a.tle", TLE_EPOCH)
    assert isinstance(found, tuple)
    assert np.array_equal(found[0], state_from_tle(*TLE, TLE_EPOCH)[0])


def test_several_satellites_are_chosen_by_name_or_number():
    other = [checked(line.replace("25544", "T0042")) for line in TLE]
    text = "\n".join(["ISS", *TLE, "0 MINE", *other, ""]).encode()
    with pytest.raises(UserError, match=r"has 2 sets of elements: choose one by key orbit.satellite"):
        read_orbit_file(text, "a.tle", TLE_EPOCH)
    with pytest.raises(UserError, match=r"no satellite 'X': it has ISS \(25544\), MINE \(T0042\)"):
        read_orbit_file(text, "a.tle", TLE_EPOCH, satellite="X")
    for satellite in ("iss", "25544", "T0042", "Mine"):
        assert isinstance(read_orbit_file(text, "a.tle", TLE_EPOCH, satellite=satellite), tuple)
    with pytest.raises(UserError, match="line 2: line 1 of the two-line elements has checksum"):
        read_orbit_file(
            text.replace(TLE[0].encode(), TLE[0][:-1].encode() + str((int(TLE[0][-1]) + 1) % 10).encode(), 1),
            "a.tle",
            TLE_EPOCH,
        )


OMM = {
    "OBJECT_NAME": "ISS (ZARYA)",
    "OBJECT_ID": "1998-067A",
    "EPOCH": "2020-06-01T12:05:00.000000",
    "MEAN_MOTION": "15.49",
    "ECCENTRICITY": "0.0004885",
    "INCLINATION": "51.6443",
    "RA_OF_ASC_NODE": "242.0161",
    "ARG_OF_PERICENTER": "264.606",
    "MEAN_ANOMALY": "207.3845",
    "EPHEMERIS_TYPE": "0",
    "CLASSIFICATION_TYPE": "U",
    "NORAD_CAT_ID": "25544",
    "ELEMENT_SET_NO": "999",
    "REV_AT_EPOCH": "21279",
    "BSTAR": "2.5302E-05",
    "MEAN_MOTION_DOT": "9.5E-06",
    "MEAN_MOTION_DDOT": "0",
}


def test_mean_elements_are_the_same_in_every_form():
    fixed = {"CENTER_NAME": "EARTH", "REF_FRAME": "TEME", "TIME_SYSTEM": "UTC", "MEAN_ELEMENT_THEORY": "SGP4"}
    whole = {**fixed, **OMM}
    kvn = "CCSDS_OMM_VERS = 2.0\nORIGINATOR = X\n" + "\n".join(f"{k} = {v}" for k, v in whole.items())
    tags = "".join(f"<{k}>{v}</{k}>" for k, v in whole.items())
    body = f"<body><segment><data>{tags}</data></segment></body>"
    xml = f'<ndm><omm id="CCSDS_OMM_VERS" version="2.0"><header/>{body}</omm></ndm>'
    table = ",".join(OMM) + "\n" + ",".join(OMM.values()) + "\n"
    json_text = "[{" + ",".join(f'"{k}":"{v}"' for k, v in OMM.items()) + ',"GP_ID":"1","DECAY_DATE":null}]'
    forms = [read_orbit_file(t.encode(), "a", TLE_EPOCH) for t in (kvn, xml, table, json_text)]
    lines = state_from_tle(*TLE, TLE_EPOCH)
    for found in forms:
        assert isinstance(found, tuple)
        assert np.array_equal(found[0], forms[0][0])  # type: ignore[index]
        # the lines have their epoch to 0.4 ms
        assert np.allclose(found[0], lines[0], rtol=0, atol=20.0)
    with pytest.raises(UserError, match="MEAN_ELEMENT_THEORY is DSST, allowed: SGP4"):
        read_orbit_file(kvn.replace("= SGP4", "= DSST").encode(), "a", TLE_EPOCH)
    with pytest.raises(UserError, match="EPHEMERIS_TYPE is 4, allowed"):
        read_orbit_file(
            json_text.replace('"EPHEMERIS_TYPE":"0"', '"EPHEMERIS_TYPE":"4"').encode(), "a", TLE_EPOCH
        )


OPM = """CCSDS_OPM_VERS = 2.0
OBJECT_NAME = T
OBJECT_ID = 2020-000A
CENTER_NAME = EARTH
REF_FRAME = GCRF
TIME_SYSTEM = UTC
EPOCH = 2026-03-20T12:00:00
{values}
"""


def test_an_opm_has_a_state_or_elements_or_both(caplog):
    axes = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
    cartesian = "\n".join(
        f"{k} = {v} [{'km/s' if 'DOT' in k else 'km'}]" for k, v in zip(axes, [*R0, *V0], strict=True)
    )
    elements = (
        "SEMI_MAJOR_AXIS = 7000\nECCENTRICITY = 0.01\nINCLINATION = 50\nRA_OF_ASC_NODE = 10\nARG_OF_PERICENTER = 20\n"
        "TRUE_ANOMALY = 30\nGM = 398600.4418"
    )
    r, v = read_orbit_file(OPM.format(values=cartesian).encode(), "a.opm", EPOCH)  # type: ignore[misc]
    assert np.allclose(r, R0 * 1e3)
    assert np.allclose(v, V0 * 1e3)
    r, v = read_orbit_file(OPM.format(values=elements).encode(), "a.opm", EPOCH)  # type: ignore[misc]
    assert np.linalg.norm(r) == pytest.approx(7000e3 * (1 - 0.01**2) / (1 + 0.01 * np.cos(np.radians(30))))
    # eccentric anomaly 29.71 and mean anomaly 29.43 degrees
    mean = elements.replace("TRUE_ANOMALY = 30", "MEAN_ANOMALY = 29.4317")
    other, _ = read_orbit_file(OPM.format(values=mean).encode(), "a.opm", EPOCH)  # type: ignore[misc]
    assert np.allclose(other, r, rtol=0, atol=200.0)
    for gm in ("0", "-398600.4418"):
        with pytest.raises(UserError, match=rf"GM is {gm[:5]}.* km\*\*3/s\*\*2, allowed: more than 0"):
            read_orbit_file(OPM.format(values=mean.replace("398600.4418", gm)).encode(), "a.opm", EPOCH)
    with pytest.raises(UserError, match="the Keplerian elements put the craft"):
        read_orbit_file(OPM.format(values=cartesian + "\n" + elements).encode(), "a.opm", EPOCH)
    with pytest.raises(UserError, match="X is in m, allowed: km"):
        read_orbit_file(OPM.format(values=cartesian.replace("[km]", "[m]", 1)).encode(), "a.opm", EPOCH)
    with pytest.raises(UserError, match="set epoch_utc to the state's"):
        read_orbit_file(OPM.format(values=cartesian).encode(), "a.opm", EPOCH.plus(60.0))
    burnt = cartesian + "\nMAN_EPOCH_IGNITION = 2026-03-20T12:10:00\nMAN_DURATION = 1\nCX_X = 1\nMASS = 5"
    read_orbit_file(OPM.format(values=burnt).encode(), "a.opm", EPOCH)
    assert "manoeuvres (write them as [[burns]]), a covariance, mass and areas" in caplog.text


def test_burns_and_thrusters_do_not_go_with_followed_craft(tmp_path):
    (tmp_path / "a.oem").write_text(oem(np.arange(0.0, 1801.0, 60.0)))
    orbit = 'kind = "oem"\nfile = "a.oem"'
    burn = '\n[[burns]]\ncraft = "target"\nstart_s = 1.0\ndelta_v_lvlh_m_s = [0.0, 1.0, 0.0]'
    with pytest.raises(UserError, match="which follows an OEM with its burns in it"):
        load_scenario(scenario(tmp_path, orbit=orbit, chaser=HOLD + burn))
    own = 'mode = "oem"\nfile = "a.oem"\n[chaser.thrusters]'
    with pytest.raises(UserError, match=r"section \[chaser.thrusters\] has no part"):
        load_scenario(scenario(tmp_path, orbit=orbit, chaser=own))
    with pytest.raises(
        UserError, match=r"a.oem starts 0 m from the target, allowed: 1.5 .* the other craft's file"
    ):
        load_scenario(scenario(tmp_path, orbit=orbit, chaser='mode = "oem"\nfile = "a.oem"'))
    (tmp_path / "a.tle").write_text("\n".join(TLE))
    path = scenario(tmp_path, orbit='kind = "oem"\nfile = "a.tle"\nmotion = "oem"')
    path.write_text(path.read_text().replace("2026-03-20T12:00:00Z", "2020-06-01T12:05:00Z"))
    with pytest.raises(UserError, match="has a single state but no ephemeris"):
        load_scenario(path)
