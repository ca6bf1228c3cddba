"""State of the world at one time: orbits, attitudes, Sun and Moon. It does not depend on the camera's lens."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.simulator.runtime.arrays import Quat, Vec3
from flyaround.simulator.world.ephemeris.body import BodyState, BodyStates


@dataclass(frozen=True, kw_only=True)
class WorldState(BodyStates):
    """The world at one time, in SI units and along GCRS axes unless stated otherwise.

    Parameters
    ----------
    epoch_utc : str
        This time, ISO 8601 with a trailing Z.
    t_s : float
        Seconds since the flight's start.
    r_target_eci_m : array
        Position of the target's centre of mass, GCRS axes [m].
    v_target_eci_m_s : array
        Velocity of the target's centre of mass [m s-1].
    q_eci_from_target_wxyz : array
        Attitude of the target.
    omega_target_rad_s : array
        Angular velocity of the target relative to ECI, target axes.
    r_chaser_eci_m : array
        Position of the camera, which is at the chaser's centre of mass [m].
    v_chaser_eci_m_s : array
        Velocity of the camera [m s-1].
    q_camera_from_eci_wxyz : array
        Attitude of the camera.
    omega_camera_rad_s : array
        Angular velocity of the camera relative to ECI, camera axes.
    relative_eci_m : array
        Chaser minus target, GCRS axes, without the rounding of large numbers [m].
    relative_eci_m_s : array
        Derivative of the same [m s-1].
    position_lvlh_m : array
        Position of the chaser in the target's rotating LVLH frame [m].
    velocity_lvlh_m_s : array
        Velocity of the chaser in the same frame [m s-1].
    r_sun_eci_m : array
        Apparent geocentric position of the Sun [m].
    bodies : tuple of BodyState
        Earth, Moon and, if different, the central body, whose position is geometric, so that ``r_target_eci_m`` minus
        it is the orbit.
    sun_visible_fraction : float
        Fraction of the Sun's disc that is visible from the target past the bodies, 0..1.
    central_body : str, optional
        Body that the target orbits, and the centre of LVLH.
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
    bodies: tuple[BodyState, ...]
    sun_visible_fraction: float
    central_body: str = "earth"

    @property
    def range_m(self) -> float:
        """Distance from the camera to the target's centre of mass [m]."""
        return float(np.linalg.norm(self.relative_eci_m))

    @property
    def altitude_m(self) -> float:
        """Height of the target above a sphere of the central body's (equatorial) radius [m]."""
        central = self.central
        return (
            float(np.linalg.norm(np.subtract(self.r_target_eci_m, central.r_eci_m))) - central.body.radius_m
        )
