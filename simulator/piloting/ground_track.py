"""Ground track of the last orbit and the next, with eclipses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.integrate import solve_ivp

from flyaround.simulator.world.ephemeris.body import bodies_at
from flyaround.simulator.world.ephemeris.eclipse import add_shares, sun_fraction_past_body
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import elements_from_state

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.flight.flight import Flight

SAMPLES_PER_ORBIT = 181
"""Points of the track per orbit."""

SEARCH_ORBITS = 1.7
"""Orbits searched for eclipses; one of them is drawn."""

# Steps per orbit between which the light is compared: some 40 s in low orbit; a shorter shadow may be missed.
STEPS_PER_ORBIT = 150

# Tolerance of the time of an eclipse [s].
_TIME_TOLERANCE_S = 0.05
_FULL_SUN = 1.0 - 1e-9  # visible share of the Sun that counts as full sunlight


@dataclass(frozen=True, eq=False)
class GroundTrack:
    """The ground track around a time.

    Parameters
    ----------
    t_s : float
        Time of the flight.
    times_s : (n,) array
        Times from one orbit before to one after it.
    latitude_deg : (n,) array
        Geodetic latitude below the target.
    longitude_deg : (n,) array
        Longitude below the target.
    sunlit : (n,) array
        Share of the Sun's disc visible from the target.
    enters_s : float or None
        Start of the next eclipse; None if there is none within `SEARCH_ORBITS`.
    leaves_s : float or None
        End of the next eclipse, or None.
    """

    t_s: float
    times_s: FloatArray
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    sunlit: FloatArray
    enters_s: float | None
    leaves_s: float | None


def ground_track(flight: Flight, t_s: float) -> GroundTrack:
    """Compute the last and the next orbit around a time, with central gravity and J2, to about a kilometre.

    Burns are ignored, and the flight need not be propagated so far.

    Parameters
    ----------
    flight : Flight
        Flight of the target.
    t_s : float
        Time within it.

    Returns
    -------
    GroundTrack
        Latitudes and longitudes [deg], and times of shadow [s].
    """
    r, v = flight.orbit(t_s)
    body, mu = flight.body, flight.body.mu_m3_s2
    period = 2 * math.pi * math.sqrt(elements_from_state(r, v, mu).semi_major_axis_m ** 3 / mu)
    now = flight.epoch.plus(t_s)
    gravity = Gravity.from_body(body, now)
    before, after = (_arc(r, v, span, gravity) for span in (-period, SEARCH_ORBITS * period))
    steps = np.linspace(0.0, period, SAMPLES_PER_ORBIT)
    offsets = np.concatenate([-steps[:0:-1], steps])
    r_eci = np.vstack([before(-steps[:0:-1]), after(steps)])
    fixed = r_eci @ matrix_from_quat(body.q_fixed_from_eci(now)).T
    latitude, longitude = geodetic_deg(fixed, body)
    longitude = longitude - np.degrees(body.turn_rad_s * offsets)
    sunlit = _sunlight(flight, t_s, SEARCH_ORBITS * period)
    enters, leaves = _shadow(
        lambda dt: float(sunlit(after(dt)[None], np.array([dt]))[0]), SEARCH_ORBITS * period
    )
    return GroundTrack(
        t_s,
        t_s + offsets,
        latitude,
        (longitude + 180.0) % 360.0 - 180.0,
        sunlit(r_eci, offsets),
        None if enters is None else t_s + enters,
        None if leaves is None else t_s + leaves,
    )


def _arc(
    r: FloatArray, v: FloatArray, span_s: float, gravity: Gravity
) -> Callable[[float | FloatArray], FloatArray]:
    """Return a function of positions (3,) or (n, 3) at times from now, forward or backward."""

    def rate(_: float, y: FloatArray) -> FloatArray:
        return np.concatenate([y[3:], gravity.acceleration(y[:3])])

    solved = solve_ivp(
        rate, (0.0, span_s), np.concatenate([r, v]), "DOP853", rtol=1e-9, atol=1e-3, dense_output=True
    )
    dense = cast("Callable[[float | FloatArray], FloatArray]", solved.sol)
    return lambda t: np.asarray(dense(t)[:3].T)


def _sunlight(flight: Flight, t_s: float, span_s: float) -> Callable[[FloatArray, FloatArray], FloatArray]:
    """Return a function for the share of the Sun visible from positions (n, 3) at times (n,) from now."""
    now, end = flight.epoch.plus(t_s), flight.epoch.plus(t_s + span_s)
    sun, sun_then = sun_eci_m(now.tt1, now.tt2), sun_eci_m(end.tt1, end.tt2)
    bodies = bodies_at(now, flight.body)
    ways = [
        np.subtract(later.r_eci_m, state.r_eci_m)
        for state, later in zip(bodies, bodies_at(end, flight.body), strict=True)
    ]
    centre = next(k for k, state in enumerate(bodies) if state.name == flight.body.name)

    def visible_fraction(r: FloatArray, offset_s: FloatArray) -> FloatArray:
        fraction = (offset_s / span_s)[:, None]
        suns = sun + fraction * (sun_then - sun)
        geocentric = r + bodies[centre].r_eci_m + fraction * ways[centre]
        # bodies move: shift the positions instead
        shares = [
            sun_fraction_past_body(state, geocentric - fraction * offset, suns - fraction * offset)
            for state, offset in zip(bodies, ways, strict=True)
        ]
        return np.maximum(add_shares(shares), 0.0)

    return visible_fraction


def _shadow(sunlit: Callable[[float], float], span_s: float) -> tuple[float | None, float | None]:
    """Return the times from now at which the next shadow begins and ends."""
    times = np.linspace(0.0, span_s, int(SEARCH_ORBITS * STEPS_PER_ORBIT))
    is_sunlit = np.array([sunlit(float(t)) >= _FULL_SUN for t in times])
    crossings: dict[bool, float | None] = {False: None, True: None}
    for k in np.flatnonzero(is_sunlit[1:] != is_sunlit[:-1]):
        becomes_lit = bool(is_sunlit[k + 1])
        if crossings[becomes_lit] is None:
            low, high = float(times[k]), float(times[k + 1])
            while high - low > _TIME_TOLERANCE_S:
                middle = (low + high) / 2
                low, high = (low, middle) if (sunlit(middle) >= _FULL_SUN) == becomes_lit else (middle, high)
            crossings[becomes_lit] = high
    return crossings[False], crossings[True]


def geodetic_deg(r_fixed_m: FloatArray, body: Body) -> tuple[FloatArray, FloatArray]:
    """Compute geodetic latitude and longitude of body-fixed places (..., 3), to a metre below 2000 km.

    Returns
    -------
    latitude_deg : (...) array
        Latitude on the body's ellipsoid [deg], north positive.
    longitude_deg : (...) array
        East longitude [deg], -180 to 180.

    References
    ----------
    Bowring (1976), Transformation from spatial to geographical coordinates, Survey Review 23.
    """
    x, y, z = (np.asarray(r_fixed_m, float)[..., k] for k in range(3))
    flattening = body.flattening
    a, b = body.radius_m, body.radius_m * (1 - flattening)
    e2, second = flattening * (2 - flattening), (a * a - b * b) / (b * b)
    p = np.hypot(x, y)
    reduced = np.arctan2(z * a, p * b)
    latitude = np.arctan2(z + second * b * np.sin(reduced) ** 3, p - e2 * a * np.cos(reduced) ** 3)
    return np.degrees(latitude), np.degrees(np.arctan2(y, x))


def split_at_map_edge(latitude_deg: FloatArray, longitude_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Insert NaN where a line leaves the map at one side and returns at the other.

    Returns
    -------
    latitude_deg : array
        Latitudes with a NaN at each break [deg].
    longitude_deg : array
        Longitudes with NaN at the same places [deg]. A break is a step of more than 180 degrees of longitude.
    """
    jumps = np.flatnonzero(np.abs(np.diff(longitude_deg)) > 180.0) + 1
    return np.insert(latitude_deg, jumps, np.nan), np.insert(longitude_deg, jumps, np.nan)


def subsolar_deg(r_sun_eci_m: FloatArray, R_fixed_from_eci: FloatArray) -> tuple[float, float]:
    """Return latitude and longitude [deg] of the subsolar point, on a sphere.

    Parameters
    ----------
    r_sun_eci_m : (3,) array
        Position of the Sun from the body's centre.
    R_fixed_from_eci : (3, 3) array
        Rotation from ECI to body-fixed axes.

    Returns
    -------
    tuple of float
        Latitude and longitude [deg].
    """
    x, y, z = R_fixed_from_eci @ r_sun_eci_m
    return math.degrees(math.atan2(z, math.hypot(x, y))), math.degrees(math.atan2(y, x))


def terminator_deg(
    subsolar_latitude_deg: float, subsolar_longitude_deg: float, samples: int = 241
) -> tuple[FloatArray, FloatArray]:
    """Compute the terminator, the great circle with the Sun on its horizon.

    Returns
    -------
    latitude_deg : array
        Latitudes [deg] of ``samples`` points, and NaN where the line crosses the edge of the map.
    longitude_deg : array
        East longitudes [deg], -180 to 180, with NaN at the same places.
    """
    lat, lon = math.radians(subsolar_latitude_deg), math.radians(subsolar_longitude_deg)
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    north = np.array([-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat)])
    turn = np.linspace(-np.pi, np.pi, samples)[:, None]
    x, y, z = (np.cos(turn) * east + np.sin(turn) * north).T
    return split_at_map_edge(np.degrees(np.arcsin(np.clip(z, -1, 1))), np.degrees(np.arctan2(y, x)))
