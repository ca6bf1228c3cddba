"""Reference frames of CCSDS navigation messages, and the transformation of each to GCRF."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import erfa
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.ephemeris.earth_orientation import R_itrs_from_eci, celestial_and_polar
from flyaround.simulator.world.frames.vectors import cross
from flyaround.simulator.world.messages.tle import R_eci_from_teme

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

FRAMES = ("GCRF", "ICRF", "EME2000", "J2000", "TOD", "TEME", "ITRF")
"""Supported frames. ITRF may have any year. TOD: true equator and equinox of date; TEME: true equator, mean equinox."""

EARTH_RATE_RAD_S = 7.292115146706979e-5
"""Rate of the Earth rotation angle, IERS Conventions (2010), eq. 5.15, per second of UT1."""

_ITRF = re.compile(r"ITRF(-?\d{2,4})?")


def known_frame(name: str) -> str | None:
    """Return the frame of ``FRAMES`` that a message names, or None."""
    upper = name.upper()
    if _ITRF.fullmatch(upper):
        return "ITRF"
    return upper if upper in FRAMES else None


def require_frame(name: str, source: str) -> str:
    """Return the frame of ``FRAMES`` that a message names.

    Raises
    ------
    UserError
        If the frame is not supported.
    """
    frame = known_frame(name)
    if frame is None:
        raise UserError(f"{source}: REF_FRAME is {name}, allowed: {', '.join(FRAMES)}")
    return frame


def R_gcrf_from(frame: str, instant: Instant) -> FloatArray:
    """Return the (3, 3) rotation to GCRF from one of ``FRAMES``."""
    match frame:
        case "EME2000" | "J2000":
            bias, _, _ = erfa.bp06(2451545.0, 0.0)
            return np.asarray(bias.T, float)
        case "TOD":
            return np.asarray(erfa.pnm06a(instant.tt1, instant.tt2).T, float)
        case "TEME":
            return R_eci_from_teme(instant)
        case "ITRF":
            return R_itrs_from_eci(instant).T
        case _:
            return np.eye(3)


def state_in_gcrf(
    frame: str, instant: Instant, r_m: FloatArray, v_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Convert position and velocity from a frame of ``FRAMES`` to GCRF; see `motion_in_gcrf`.

    Returns
    -------
    r_m : (3,) array
        Position, GCRF [m].
    v_m_s : (3,) array
        Velocity, GCRF [m s-1]; from ITRF it includes the Earth's rotation.
    """
    return motion_in_gcrf(frame, instant, r_m, v_m_s, np.zeros(3))[:2]


def motion_in_gcrf(
    frame: str, instant: Instant, r_m: FloatArray, v_m_s: FloatArray, a_m_s2: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Convert position, velocity and acceleration from a frame of ``FRAMES`` to GCRF.

    For ITRF, velocity and acceleration include the Earth's rotation.
    """
    R = R_gcrf_from(frame, instant)
    if frame == "ITRF":
        # the Earth rotates about the pole of date, up to half an arcsecond from the frame's z axis
        axis = celestial_and_polar(instant)[1] @ np.array([0.0, 0.0, EARTH_RATE_RAD_S])
        rotation_velocity = cross(axis, r_m)
        a_m_s2 = a_m_s2 + 2 * cross(axis, v_m_s) + cross(axis, rotation_velocity)
        v_m_s = v_m_s + rotation_velocity
    return R @ r_m, R @ v_m_s, R @ a_m_s2
