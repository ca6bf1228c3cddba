"""State of the world at one moment: orbits, attitudes, Sun and Moon, before a camera is chosen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.simulator.runtime.arrays import Quat, Vec3
from flyaround.simulator.world.ephemeris.bodies import BODIES, BodyName


@dataclass(frozen=True, kw_only=True)
class WorldState:
    """The world at ``t_s``: float64, GCRS, SI.

    Parameters
    ----------
    epoch_utc : this moment, ISO 8601 with a trailing Z. t_s : seconds since the flight's start.
    r_target_eci_m, v_target_eci_m_s : the target's centre of mass.
    q_eci_from_target_wxyz, omega_target_rad_s : its attitude and its rate relative to ECI, target axes.
    r_chaser_eci_m, v_chaser_eci_m_s : the camera (it sits in the chaser's centre of mass).
    q_camera_from_eci_wxyz, omega_camera_rad_s : its attitude and its rate relative to ECI, camera axes.
    relative_eci_m, relative_eci_m_s : chaser minus target, without the rounding of two large numbers.
    position_lvlh_m, velocity_lvlh_m_s : the same in the target's rotating LVLH frame.
    r_sun_eci_m, r_moon_eci_m : apparent, geocentric; about the Moon its own place is the geometric one, so that
        ``r_target_eci_m - r_moon_eci_m`` is the orbit about it.
    q_itrs_from_eci_wxyz, q_moon_from_eci_wxyz : orientation of the Earth and the Moon (mean Earth / polar axis).
    sun_visible_fraction : share of the Sun's disc the target sees past the Earth and the Moon, 0..1.
    central_body : what the target circles; LVLH is taken about it.
    """

    epoch_utc: str
    t_s: float
    r_target_eci_m: Vec3
    v_target_eci_m_s: Vec3
    q_eci_from_target_wxyz: Quat
    omega_target_rad_s: Vec3
    r_chaser_eci_m: Vec3
    v_chaser_eci_m_s: Vec3
    q_camera_from_eci_wxyz: Quat
    omega_camera_rad_s: Vec3
    relative_eci_m: Vec3
    relative_eci_m_s: Vec3
    position_lvlh_m: Vec3
    velocity_lvlh_m_s: Vec3
    r_sun_eci_m: Vec3
    r_moon_eci_m: Vec3
    q_itrs_from_eci_wxyz: Quat
    q_moon_from_eci_wxyz: Quat
    sun_visible_fraction: float
    central_body: BodyName = "earth"

    @property
    def range_m(self) -> float:
        """Distance from the camera to the target's centre of mass [m]."""
        return float(np.linalg.norm(self.relative_eci_m))

    @property
    def altitude_m(self) -> float:
        """Height of the target above a sphere of the central body's (equatorial) radius [m]."""
        centre = self.r_moon_eci_m if self.central_body == "moon" else (0.0, 0.0, 0.0)
        distance = np.linalg.norm(np.subtract(self.r_target_eci_m, centre))
        return float(distance) - BODIES[self.central_body].radius_m
