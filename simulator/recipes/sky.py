"""The sky of a sample: Sun and nadir drawn in camera axes, then a matching date and position.

A random time of the year determines the Sun's direction. The target is then placed where the angle between Sun and
nadir equals the drawn one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.random_draws import direction_about_z, uniform_direction
from flyaround.simulator.world.ephemeris.body import bodies_at, body_named
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.frames.rotation import quat_from_matrix
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from numpy.random import Generator

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.recipe import Sky
    from flyaround.simulator.world.ephemeris.body import Body, BodyState

YEAR_START_UTC = "2026-01-01T00:00:00Z"

# Length of the year from which times are drawn [s].
YEAR_S = 365.0 * 86400.0

# Maximum number of draws until a time meets all conditions.
MAX_DRAWS = 1000

MAX_DIP_SHARE = 0.9
"""Largest depression of the Sun below the horizontal for a sunlit target, relative to the horizon's dip."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PlaceInSky:
    """Position and attitude of the camera, and the bodies around it.

    Parameters
    ----------
    now : Instant
        Time of the sample.
    body : Body
        Central body.
    R_eci_from_camera : (3, 3) array
        Attitude of the camera.
    camera_eci_m : (3,) array
        Camera position.
    centre_m_s : (3,) array
        Its velocity.
    along_eci : (3,) array
        Direction of motion about the body, not normalised.
    r_sun_eci_m : (3,) array
        Apparent position of the Sun.
    bodies : tuple of BodyState
        States of the bodies, see `SceneState`.
    origin_eci_m : (3,) array, optional
        Origin of the model, if placed.
    """

    now: Instant
    body: Body
    R_eci_from_camera: FloatArray
    camera_eci_m: FloatArray
    centre_m_s: FloatArray
    along_eci: FloatArray
    r_sun_eci_m: FloatArray
    bodies: tuple[BodyState, ...]
    origin_eci_m: FloatArray | None = None

    def velocity_m_s(self, r_eci_m: FloatArray) -> FloatArray:
        """Return the velocity of a circular orbit through a position (3,) [m s-1]."""
        centre = next(np.asarray(b.r_eci_m) for b in self.bodies if b.name == self.body.name)
        speed = np.sqrt(self.body.mu_m3_s2 / np.linalg.norm(r_eci_m - centre))
        return np.asarray(self.centre_m_s + speed * self.along_eci / np.linalg.norm(self.along_eci))

    @property
    def q_camera_from_eci_wxyz(self) -> FloatArray:
        """Attitude of the camera."""
        return quat_from_matrix(self.R_eci_from_camera.T)


def random_moment(rng: Generator) -> Instant:
    """Draw a whole second of the year."""
    return Instant.from_utc(YEAR_START_UTC).plus(float(np.floor(rng.uniform(0, YEAR_S))))


def choose_sky(rng: Generator, skies: list[Sky]) -> Sky:
    """Draw one of the skies by its share; with a single one no random number is used."""
    if len(skies) == 1:
        return skies[0]
    shares = np.array([s.share for s in skies])
    return skies[int(rng.choice(len(skies), p=shares / shares.sum()))]


def sun_and_nadir(rng: Generator, sky: Sky) -> tuple[FloatArray, FloatArray]:
    """Draw directions to the Sun and to nadir in camera axes, each (3,); the target is always sunlit.

    The phase angle is between the camera and the Sun, seen from the target; nadir is given by its angle from the
    boresight.

    Raises
    ------
    UserError
        If no draw has a sunlit target above ground as dark or lit as drawn.
    """
    night = rng.random() < sky.night_share
    radius = body_named(sky.body).radius_m
    dip = np.sin(np.arccos(radius / (radius + sky.altitude_km * 1e3)))
    lowest = -MAX_DIP_SHARE * dip if sky.least_sun_elevation_sine is None else sky.least_sun_elevation_sine
    for _ in range(MAX_DRAWS):
        sun = direction_about_z(rng, 0.0, sky.max_phase_deg) * (1.0, 1.0, -1.0)
        nadir = direction_about_z(rng, *sky.nadir_off_boresight_deg)
        elevation = float(-nadir @ sun)  # sine of the Sun's elevation above the target's horizon
        if (elevation < 0.0) == night and elevation > lowest:
            return sun, nadir
    low, high = sky.nadir_off_boresight_deg
    raise UserError(
        f"section [[sky]]: nadir_off_boresight_deg [{low:g}, {high:g}] and max_phase_deg {sky.max_phase_deg:g} leave "
        f"no {'dark' if night else 'lit'} ground below a sunlit target (night_share {sky.night_share:g}): widen one"
    )


def place_in_sky(rng: Generator, sky: Sky, t_m: FloatArray, sun: FloatArray, nadir: FloatArray) -> PlaceInSky:
    """Draw a date and a position at which Sun and nadir have the given directions.

    Parameters
    ----------
    rng : Generator
        Random generator.
    sky : Sky
        Directions of Sun and nadir.
    t_m : (3,) array
        Model's origin, camera axes, at the sky's altitude.
    sun : (3,) array
        Direction of the Sun, camera axes.
    nadir : (3,) array
        Direction of nadir, camera axes.
    """
    body = body_named(sky.body)
    now = random_moment(rng)
    r_sun = sun_eci_m(now.tt1, now.tt2)
    centre, v_centre = body.geocentric_state(now)
    to_sun = r_sun - centre
    to_sun /= np.linalg.norm(to_sun)
    # the target's zenith is at the drawn angle from the Sun, at a random azimuth
    side = np.cross(to_sun, uniform_direction(rng))
    side /= np.linalg.norm(side)
    cosine = float(-nadir @ sun)
    up = cosine * to_sun + np.sqrt(max(1 - cosine**2, 0.0)) * side
    R_eci_from_camera = _triad(to_sun, -up) @ _triad(sun, nadir).T
    origin = centre + (body.radius_m + sky.altitude_km * 1e3) * up
    return PlaceInSky(
        now=now,
        body=body,
        R_eci_from_camera=R_eci_from_camera,
        camera_eci_m=origin - R_eci_from_camera @ t_m,
        centre_m_s=v_centre,
        along_eci=np.cross(up, uniform_direction(rng)),
        origin_eci_m=origin,
        r_sun_eci_m=r_sun,
        bodies=bodies_at(now, body),
    )


def _triad(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return right-handed axes (columns): the first direction, then the part of the second normal to it."""
    b = second - (second @ first) * first
    b /= np.linalg.norm(b)
    return np.stack([first, b, np.cross(first, b)], axis=1)
