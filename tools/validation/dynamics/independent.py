"""Comparison of the world with independent programs, whose raw outputs and generators are in ``tests/reference``."""

from __future__ import annotations

import csv
from importlib.resources import files
from typing import TYPE_CHECKING

import erfa
import numpy as np
from sgp4.api import Satrec

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.constants import DAY_S
from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.ephemeris.sun_moon import moon_eci_m, sun_eci_m
from flyaround.simulator.world.messages.tle import R_eci_from_teme, state_from_tle
from flyaround.simulator.world.orbit.forces import EarthForces, ForceModel, Forces
from flyaround.simulator.world.orbit.moon_forces import MoonForces
from flyaround.simulator.world.orbit.propagation import propagate
from flyaround.simulator.world.orbit.spherical_harmonics import egm96
from flyaround.simulator.world.time.instant import Instant
from tools.validation.rows import Row, arcsec, read_table, require_reference

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import FloatArray

EARTH_EPOCH = "2025-03-21T06:00:00Z"
MOON_EPOCH = "2024-06-06T05:00:00Z"
EARTH_ORBIT_S, MOON_ORBIT_S = 6_100.0, 7_700.0
"""Slightly more than one revolution, up to the next row of the reference."""


def independent(reference: Path) -> list[Row]:
    """Return all comparisons with other programs.

    Raises
    ------
    UserError
        If the reference outputs are missing.
    """
    return [
        *against_basilisk(reference),
        *against_skyfield(reference),
        against_astropy(reference),
        *against_sgp4(),
    ]


def against_basilisk(reference: Path) -> list[Row]:
    """Compare a day of two craft 10 m apart: 600 km above the Earth (EGM96 20x20, Sun, Moon), 200 km above the Moon."""
    rows = []
    epoch = Instant.from_utc(EARTH_EPOCH)
    earth = EarthForces(
        sky=EphemerisTable.build(epoch, DAY_S), harmonics=egm96(20), forces=Forces(sun=True, moon=True)
    )
    start = np.array([0.0, -1049.0, 7485.0]), np.array([0.0, -0.013, 0.002])
    table = read_table(reference / "basilisk.csv")
    rows += _day(table, earth, start, EARTH_ORBIT_S, "at 600 km, EGM96 20x20 + Sun + Moon")
    epoch = Instant.from_utc(MOON_EPOCH)
    moon = MoonForces(epoch=epoch, sky=EphemerisTable.build(epoch, DAY_S), forces=Forces(sun=True))
    start = np.array([0.0, -1160.0, 1090.0]), np.array([0.0, -0.005, 0.002])
    table = read_table(reference / "basilisk_moon.csv")
    return rows + _day(table, moon, start, MOON_ORBIT_S, "200 km above the Moon, Earth + Sun")


def _day(
    table: FloatArray,
    forces: ForceModel,
    velocities: tuple[FloatArray, FloatArray],
    orbit_s: float,
    label: str,
) -> list[Row]:
    track = propagate(
        table[0, 1:4], velocities[0], DAY_S, forces, (table[0, 4:7] - table[0, 1:4], velocities[1])
    )
    inertial = [float(np.linalg.norm(track(row[0])[0] - row[1:4])) for row in table]
    error_m = [float(np.linalg.norm(track.relative(row[0])[0] - (row[4:7] - row[1:4]))) for row in table]
    orbit = int(np.searchsorted(table[:, 0], orbit_s))
    against = "Basilisk 2.12.1 (RK4, 1 s)"
    return [
        Row(what=f"position over a day {label}", against=against, unit="m", goal=1.0, measured=max(inertial)),
        Row(
            what=f"relative position over an orbit {label}",
            against=against,
            unit="m",
            goal=1e-3,
            measured=max(error_m[:orbit]),
        ),
        Row(
            what=f"relative position over a day {label}",
            against=against,
            unit="m",
            goal=1e-2,
            measured=max(error_m),
        ),
    ]


def against_skyfield(reference: Path) -> list[Row]:
    """Compare the apparent Sun and Moon from 2000 to 2050, and the Earth's orientation where UT1 is known."""
    table = read_table(reference / "skyfield.csv")
    jd = table[:, 0]
    turned = []
    for row in table[jd < 2460000.0]:
        t = Instant(float(row[0]), 0.0)
        rotation = R_itrs_from_eci(t, polar_motion=False)
        turned.append(arcsec(rotation, row[8:].reshape(3, 3)).max())
    name = "Skyfield 1.55, DE421"
    sun = float(arcsec(sun_eci_m(jd, 0 * jd), table[:, 2:5]).max())
    moon = float(arcsec(moon_eci_m(jd, 0 * jd), table[:, 5:8]).max())
    return [
        Row(what="apparent Sun, 2000-2050", against=name, unit="arcsec", goal=1.0, measured=sun),
        Row(what="apparent Moon, 2000-2050", against=name, unit="arcsec", goal=15.0, measured=moon),
        Row(
            what="GCRS to ITRS with UT1, without polar motion",
            against="Skyfield 1.55",
            unit="arcsec",
            goal=0.1,
            measured=float(max(turned)),
        ),
    ]


def against_astropy(reference: Path) -> Row:
    """Compare the rotation from GCRS to ITRS, with polar motion and UT1 from the same table."""
    path = reference / "astropy.csv"
    require_reference(path)
    worst = 0.0
    with path.open(newline="") as file:
        for epoch, *values in list(csv.reader(file))[1:]:
            expected = np.array(values, float).reshape(3, 3)
            worst = max(worst, float(arcsec(R_itrs_from_eci(Instant.from_utc(epoch)), expected).max()))
    return Row(
        what="GCRS to ITRS, 1973-2026", against="astropy 8.0.2", unit="arcsec", goal=1e-6, measured=worst
    )


def against_sgp4() -> list[Row]:
    """Compare TLE propagation with Vallado's verification cases in the package ``sgp4``, up to 30 days from epoch."""
    folder = files("sgp4")
    lines = [
        line[:69]
        for line in folder.joinpath("SGP4-VER.TLE").read_text().splitlines()
        if line[:2] in {"1 ", "2 "}
    ]
    published = _published(folder.joinpath("tcppver.out").read_text())
    position, velocity, count = 0.0, 0.0, 0
    for line1, line2 in zip(lines[::2], lines[1::2], strict=True):
        satellite = Satrec.twoline2rv(line1, line2)
        for minutes, *state in published.get(int(line1[2:7]), ()):
            days = satellite.jdsatepochF + minutes / 1440
            try:
                epoch = _instant_of_utc(satellite.jdsatepoch, days)
                r, v = state_from_tle(line1, line2, epoch)
            except UserError:
                # cases that must fail: decayed, or more than a month from the epoch
                continue
            R = R_eci_from_teme(epoch)
            position = max(position, float(np.linalg.norm(R.T @ r - np.array(state[:3]) * 1e3)))
            velocity = max(velocity, float(np.linalg.norm(R.T @ v - np.array(state[3:6]) * 1e3)))
            count += 1
    against = f"Vallado et al. (2006), {count} states"
    return [
        Row(what="TLE by SGP4, position", against=against, unit="m", goal=0.1, measured=position),
        Row(what="TLE by SGP4, velocity", against=against, unit="m/s", goal=1e-4, measured=velocity),
    ]


def _instant_of_utc(utc1: float, utc2: float) -> Instant:
    tt1, tt2 = erfa.taitt(*erfa.utctai(utc1, utc2))
    return Instant(float(tt1), float(tt2))


def _published(text: str) -> dict[int, list[list[float]]]:
    """Return minutes, position [km] and velocity [km s-1] by satellite."""
    states: dict[int, list[list[float]]] = {}
    current: list[list[float]] = []
    for line in text.splitlines():
        cells = line.split()
        if cells[1:] == ["xx"]:
            current = states.setdefault(int(cells[0]), [])
        elif len(cells) >= 7:
            current.append([float(w) for w in cells[:7]])
    return states
