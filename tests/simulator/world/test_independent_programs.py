"""The world against independent programs, whose raw outputs and generators are stored beside this file."""

from pathlib import Path

import erfa
import numpy as np

from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.ephemeris.sun_moon import moon_eci_m, sun_eci_m
from flyaround.simulator.world.orbit.forces import EarthForces, Forces
from flyaround.simulator.world.orbit.propagation import propagate
from flyaround.simulator.world.orbit.spherical_harmonics import egm96
from flyaround.simulator.world.time.instant import Instant

HERE = Path(__file__).parents[2] / "reference"
SKYFIELD = np.genfromtxt(HERE / "skyfield.csv", delimiter=",", skip_header=1)
BASILISK = np.genfromtxt(HERE / "basilisk.csv", delimiter=",", skip_header=1)


def arcsec(a, b):
    sine = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.degrees(np.arctan2(sine, np.sum(a * b, axis=-1))) * 3600


def test_sun_and_moon_agree_with_de421():
    """Skyfield 1.55 with DE421, 2000 to 2050."""
    jd = SKYFIELD[:, 0]
    assert arcsec(sun_eci_m(jd, 0 * jd), SKYFIELD[:, 2:5]).max() < 0.05
    assert arcsec(moon_eci_m(jd, 0 * jd), SKYFIELD[:, 5:8]).max() < 15.0


def test_earth_is_turned_as_in_skyfield():
    """By its own IAU 2000A series, where both have measured UT1; no polar motion there, 0.6 arcsec here."""
    for row in SKYFIELD[SKYFIELD[:, 0] < 2460000.0]:
        t = Instant(float(row[0]), 0.0)
        celestial = erfa.c2t06a(t.tt1, t.tt2, *t.ut1, 0.0, 0.0)
        theirs = row[8:].reshape(3, 3)
        assert arcsec(celestial, theirs).max() < 0.1
        assert arcsec(R_itrs_from_eci(t), theirs).max() < 0.8


def test_a_day_agrees_with_basilisk():
    """EGM96 20x20 + Sun + Moon at 600 km: 1 m after a day; 1 mm between the two over an orbit."""
    epoch = Instant.from_utc("2025-03-21T06:00:00Z")
    forces = EarthForces(
        sky=EphemerisTable.build(epoch, 86400.0), harmonics=egm96(20), forces=Forces(sun=True, moon=True)
    )
    start, chaser = BASILISK[0, 1:4], BASILISK[0, 4:7]
    v, w = np.array([0.0, -1049.0, 7485.0]), np.array([0.0, -0.013, 0.002])
    track = propagate(start, v, 86400.0, forces, (chaser - start, w))
    for t, *positions in BASILISK:
        theirs, beside = np.array(positions[:3]), np.array(positions[3:])
        assert np.linalg.norm(track(t)[0] - theirs) < 0.01
        apart = np.linalg.norm(track.relative(t)[0] - (beside - theirs))
        assert apart < (1e-5 if t <= 6000 else 1e-3)
