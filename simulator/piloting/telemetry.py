"""The figures for an operator: range, closing speed, rates, LVLH state, phase angle, light."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.world.flight.world_state import WorldState


@dataclass(frozen=True, kw_only=True)
class Telemetry:
    """Telemetry at the time of an image.

    Parameters
    ----------
    epoch_utc : str
        Mid-exposure, ISO 8601.
    t_s : float
        Mid-exposure, from the start of the scenario.
    range_m : float
        Distance from the camera to the target's centre of mass.
    closing_m_s : float
        Rate of decrease of the range.
    lateral_m_s : float
        Speed across the line of sight, in LVLH.
    off_boresight_deg : float
        Angle between the boresight and the target's centre of mass.
    relative_rate_deg_s : array
        Angular velocity of the target relative to the camera, camera axes.
    camera_rate_deg_s : array
        Angular velocity of the camera relative to the stars, camera axes.
    position_lvlh_m : array
        Position of the chaser relative to the target: radial, along-track, cross-track [m].
    velocity_lvlh_m_s : array
        Its velocity in the rotating frame [m s-1].
    phase_deg : float
        Angle Sun - target - camera; 0 if the Sun is behind the camera.
    sun_visible_fraction : float
        Share of the Sun's disc visible from the target past the Earth.
    altitude_km : float
        Altitude of the target above a sphere of the central body's (equatorial) radius.
    """

    epoch_utc: str
    t_s: float
    range_m: float
    closing_m_s: float
    lateral_m_s: float
    off_boresight_deg: float
    relative_rate_deg_s: Vec3
    camera_rate_deg_s: Vec3
    position_lvlh_m: Vec3
    velocity_lvlh_m_s: Vec3
    phase_deg: float
    sun_visible_fraction: float
    altitude_km: float

    def document(self) -> dict[str, Any]:
        """Return the figures for JSON.

        Returns
        -------
        dict
            Value by name of the field; vectors are tuples of three numbers.
        """
        return asdict(self)


def telemetry_of(world: WorldState, scene: SceneState) -> Telemetry:
    """Return the figures of one moment.

    Parameters
    ----------
    world : WorldState
        State of the world.
    scene : SceneState
        Scene of the image.

    Returns
    -------
    Telemetry
        Figures in SI units; angles in degrees where their names say so.
    """
    p, v = np.array(world.position_lvlh_m), np.array(world.velocity_lvlh_m_s)
    distance = float(np.linalg.norm(p))
    closing = -float(p @ v) / distance
    lateral = float(np.sqrt(max(float(v @ v) - closing**2, 0.0)))
    R_camera_from_eci = matrix_from_quat(world.q_camera_from_eci_wxyz)
    los = -R_camera_from_eci @ np.array(world.relative_eci_m)
    R_camera_from_target = matrix_from_quat(scene.q_camera_from_target_wxyz)
    relative = R_camera_from_target @ np.array(world.omega_target_rad_s) - np.array(world.omega_camera_rad_s)
    to_sun = np.array(scene.sun_direction_camera)
    return Telemetry(
        epoch_utc=world.epoch_utc,
        t_s=world.t_s,
        range_m=distance,
        closing_m_s=closing,
        lateral_m_s=lateral,
        off_boresight_deg=float(np.degrees(np.arctan2(np.hypot(los[0], los[1]), los[2]))),
        relative_rate_deg_s=vec3(np.degrees(relative)),
        camera_rate_deg_s=vec3(np.degrees(np.array(world.omega_camera_rad_s))),
        position_lvlh_m=world.position_lvlh_m,
        velocity_lvlh_m_s=world.velocity_lvlh_m_s,
        phase_deg=float(np.degrees(np.arccos(np.clip(-los @ to_sun / distance, -1.0, 1.0)))),
        sun_visible_fraction=world.sun_visible_fraction,
        altitude_km=world.altitude_m / 1e3,
    )
