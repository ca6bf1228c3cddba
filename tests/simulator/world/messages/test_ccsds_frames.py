"""CCSDS messages in various frames and time systems, and in the layouts of the standards' annexes."""

import erfa
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.messages.aem import read_aem_state
from flyaround.simulator.world.messages.ccsds import read_segments, read_time
from flyaround.simulator.world.messages.ccsds_frames import EARTH_RATE_RAD_S, R_gcrf_from, state_in_gcrf
from flyaround.simulator.world.messages.tle import R_eci_from_teme
from flyaround.simulator.world.time.instant import Instant
from tests.harness.oem import oem_state

EPOCH = Instant.from_utc("2024-05-10T06:00:00Z")


def message(frame, *, system="UTC", times=(), more=""):
    """A message in the layout of 502.0-B: all optional keys, accelerations, two segments, a covariance."""
    stamps = times or tuple(f"2024-05-10T0{h}:{m:02d}:00.000" for h in (5, 6) for m in range(0, 60, 10))
    rows = []
    for k, t in enumerate(stamps):
        turn = 1e-3 * 600 * (k - 6)
        c, s = np.cos(turn), np.sin(turn)
        r, v = 7000 * np.array([c, s, 0.1 * s]), 7.0 * np.array([-s, c, 0.1 * c])
        a = -7e-3 * np.array([c, s, 0.1 * s])
        rows.append(f"{t} " + " ".join(f"{x:.9f}" for x in (*r, *v, *a)))
    first = rows[:2]
    body = "\n".join(rows)
    meta = f"""META_START
COMMENT   a segment with every key
OBJECT_NAME          = PROBE
OBJECT_ID            = 2024-001A
CENTER_NAME          = EARTH
REF_FRAME            = {frame}
{more}TIME_SYSTEM          = {system}
START_TIME           = {stamps[0]}
USEABLE_START_TIME   = {stamps[1]}
USEABLE_STOP_TIME    = {stamps[-2]}
STOP_TIME            = {stamps[-1]}
INTERPOLATION        = HERMITE
INTERPOLATION_DEGREE = 7
META_STOP
"""
    early = "\n".join(row.replace("2024-05-10", "2024-05-09") for row in first)
    return (
        "CCSDS_OEM_VERS = 2.0\nCOMMENT made for a test\nCREATION_DATE = 2024-131T00:00:00\nORIGINATOR = TEST\n\n"
        + meta.replace("2024-05-10", "2024-05-09").split("USEABLE")[0]
        + f"STOP_TIME = {stamps[1].replace('2024-05-10', '2024-05-09')}\nMETA_STOP\n{early}\n\n"
        + meta
        + "COMMENT data follow\n"
        + body
        + "\n\nCOVARIANCE_START\nEPOCH = "
        + stamps[0]
        + "\nCOV_REF_FRAME = RTN\n3.3e-04\n4.6e-04 6.7e-04\nCOVARIANCE_STOP\n"
    )


@pytest.mark.parametrize("frame", ["GCRF", "EME2000", "TOD", "TEME"])
def test_frames_of_date_turn_the_state(frame):
    r, v = oem_state(message(frame), "x.oem", EPOCH)
    R = R_gcrf_from(frame, EPOCH)
    assert np.allclose(R.T @ r, [7000e3, 0.0, 0.0], atol=1e-6)
    assert np.allclose(R.T @ v, [0.0, 7000.0, 700.0], atol=1e-6)
    # a quarter of a degree of precession since 2000 for the frames of date, nothing like it for the others
    tilt = np.degrees(np.arccos(min(R[0, 0], 1.0)))
    assert (0.2 < tilt < 0.4) == (frame in {"TOD", "TEME"})


def test_true_and_mean_equinox_differ_by_the_equation_of_the_equinoxes():
    between = R_gcrf_from("TOD", EPOCH).T @ R_eci_from_teme(EPOCH)
    angle = np.arctan2(between[1, 0], between[0, 0])
    expected = erfa.ee06a(EPOCH.tt1, EPOCH.tt2)
    # the sidereal times of 1982 and of 2006 differ by some milliarcseconds
    assert abs(angle) == pytest.approx(abs(expected), abs=np.radians(0.1 / 3600))


def test_a_craft_at_rest_on_the_earth_moves_with_it():
    h = 10.0
    r_itrs = np.array([4.2e7, 1e6, -2e5])
    _, v = state_in_gcrf("ITRF", EPOCH, r_itrs, np.zeros(3))
    before, after = (R_itrs_from_eci(EPOCH.plus(s)).T @ r_itrs for s in (-h, h))
    assert np.allclose(v, (after - before) / (2 * h), atol=3e-4)
    assert np.linalg.norm(v) == pytest.approx(EARTH_RATE_RAD_S * np.hypot(4.2e7, 1e6), rel=1e-5)
    moved = oem_state(message("ITRF-97"), "x.oem", EPOCH)[1] - oem_state(message("GCRF"), "x.oem", EPOCH)[1]
    assert np.linalg.norm(moved) > 500.0


def test_a_frozen_frame_of_date_keeps_its_epoch():
    frozen = message("TOD", more="REF_FRAME_EPOCH = 2000-01-01T12:00:00\n")
    r, _ = oem_state(frozen, "x.oem", EPOCH)
    R = R_gcrf_from("TOD", Instant.from_utc("2000-01-01T12:00:00Z"))
    assert np.allclose(R.T @ r, [7000e3, 0.0, 0.0], atol=1e-6)


def test_barycentric_time_is_terrestrial_time_to_two_milliseconds():
    tdb = read_time("2024-05-10T06:01:09.184", "TDB", "x")
    tt = read_time("2024-05-10T06:01:09.184", "TT", "x")
    assert 1e-6 < abs(tdb.minus(tt)) < 2e-3
    assert tt.minus(EPOCH) == pytest.approx(0.0, abs=1e-6)
    # there and back
    tdb1, tdb2 = tdb.tdb
    assert ((tdb1 - tt.tt1) + (tdb2 - tt.tt2)) * 86400 == pytest.approx(0.0, abs=1e-5)


def test_a_message_about_another_planet_is_read_and_refused_as_an_orbit():
    mars = message("EME2000").replace("= EARTH", "= MARS BARYCENTER")
    segments = read_segments(mars, "mars.oem", "OEM")
    assert [len(s.rows) for s in segments] == [2, 12]
    assert segments[1].numbers(6).shape == (12, 6)
    with pytest.raises(UserError, match="CENTER_NAME is MARS BARYCENTER, allowed: EARTH"):
        oem_state(mars, "mars.oem", EPOCH)


AEM = """CCSDS_AEM_VERS = 1.0
CREATION_DATE = 2024-131T17:22:31
ORIGINATOR = TEST

META_START
COMMENT  made for a test, laid out as in 504.0-B
OBJECT_NAME          = PROBE
OBJECT_ID            = 2024-001A
CENTER_NAME          = mars barycenter
REF_FRAME_A          = EME2000
REF_FRAME_B          = SC_BODY_1
ATTITUDE_DIR         = A2B
TIME_SYSTEM          = UTC
START_TIME           = 2024-05-10T05:59:07.2555
USEABLE_START_TIME   = 2024-05-10T05:59:08.2555
USEABLE_STOP_TIME    = 2024-05-10T06:02:00.5555
STOP_TIME            = 2024-05-10T06:02:04.5555
ATTITUDE_TYPE        = {kind}
{more}INTERPOLATION_METHOD = hermite
INTERPOLATION_DEGREE = 7
META_STOP

DATA_START
{rows}
DATA_STOP
"""
TIMES = ("2024-05-10T05:59:07.2555", "2024-05-10T06:00:00.000", "2024-05-10T06:02:04.5555")


def aem(kind, more, values):
    return AEM.format(kind=kind, more=more, rows="\n".join(f"{t}  {values}" for t in TIMES))


def test_every_kind_of_attitude_gives_the_same_one():
    # 90 degrees about z, then 30 about the new x
    half = np.radians(15)
    c, s, r = np.cos(half), np.sin(half), np.sqrt(0.5)
    w, x, y, z = r * c, r * s, r * s, r * c
    texts = [
        aem("QUATERNION", "QUATERNION_TYPE = LAST\n", f"{x} {y} {z} {w}"),
        aem("QUATERNION", "QUATERNION_TYPE = FIRST\n", f"{w} {x} {y} {z}"),
        aem("QUATERNION/DERIVATIVE", "QUATERNION_TYPE = FIRST\n", f"{w} {x} {y} {z} 0 0 0 0"),
        aem("EULER_ANGLE", "EULER_ROT_SEQ = 313\n", "90.0 30.0 0.0"),
        aem("EULER_ANGLE/RATE", "EULER_ROT_SEQ = ZXZ\n", "90.0 30.0 0.0 0 0 0"),
        # its z axis 60 degrees up at right ascension 0
        aem("SPIN", "", "0.0 60.0 90.0 0.0"),
    ]
    R = [matrix_from_quat(read_aem_state(text, "a.aem", EPOCH)[0]) for text in texts]
    bias = R_gcrf_from("EME2000", EPOCH)
    Rz = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    Rx = np.array(
        [[1, 0, 0], [0, np.cos(2 * half), -np.sin(2 * half)], [0, np.sin(2 * half), np.cos(2 * half)]]
    )
    for found in R[:5]:
        assert np.allclose(found, bias @ Rz @ Rx, atol=1e-12)
    axis = R[5][:, 2]
    assert np.allclose(axis, bias @ [0.5, 0.0, np.sqrt(0.75)], atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "more", "sentence"),
    [
        ("EULER_ANGLE", "", "lacks the key EULER_ROT_SEQ"),
        ("EULER_ANGLE", "EULER_ROT_SEQ = 331\n", "EULER_ROT_SEQ is 331, allowed: three axes such as 321"),
        ("SPIN/NUTATION", "", "ATTITUDE_TYPE is SPIN/NUTATION, allowed"),
    ],
)
def test_mistakes_of_an_aem(kind, more, sentence):
    with pytest.raises(UserError, match=sentence):
        read_aem_state(aem(kind, more, "0 0 0 1"), "a.aem", EPOCH)


@pytest.mark.parametrize("frame", ["EME2000", "J2000"])
def test_the_pole_and_equinox_of_j2000_are_off_those_of_gcrf_by_the_frame_bias(frame):
    """IERS Conventions (2010), 5.21 and 5.33: the mean pole of J2000.0 in GCRS, and the offset in right ascension."""
    x_pole, y_pole, ascension = np.radians(np.array([-16.6170, -6.8192, -14.6]) / 3.6e6)
    R = R_gcrf_from(frame, EPOCH)
    assert R[:, 2] == pytest.approx([x_pole, y_pole, 1.0], abs=1e-12)
    assert R[:, 0] == pytest.approx([1.0, ascension, -x_pole], abs=1e-10)
