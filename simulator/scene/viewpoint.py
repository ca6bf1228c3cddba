"""A scene from a position above the Earth at a date, without spacecraft, for galleries and validation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.state import Quality, SceneState
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.constants import EARTH_POLAR_RADIUS_M, EARTH_RADIUS_M
from flyaround.simulator.world.ephemeris.body import bodies_at
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.frames.rotation import quat_from_matrix
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import TargetRef

TARGET_POSITION_M = (0.0, 0.0, -1000.0)  # position of the target: behind the camera


def place_itrs_m(
    latitude_deg: float, longitude_deg: float, altitude_km: float
) -> tuple[FloatArray, FloatArray]:
    """Return a geodetic position and its local axes.

    Returns
    -------
    r_m : (3,) array
        Position, Earth-fixed (ITRS) [m].
    axes : (3, 3) array
        Unit vectors to the east, the north and up as rows, Earth-fixed.
    """
    lat, lon = np.radians(latitude_deg), np.radians(longitude_deg)
    e2 = 1 - (EARTH_POLAR_RADIUS_M / EARTH_RADIUS_M) ** 2
    n = EARTH_RADIUS_M / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    h = altitude_km * 1e3
    r = np.array(
        [
            (n + h) * np.cos(lat) * np.cos(lon),
            (n + h) * np.cos(lat) * np.sin(lon),
            (n * (1 - e2) + h) * np.sin(lat),
        ]
    )
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    return r, np.stack([east, np.cross(up, east), up])


def scene_above(
    epoch_utc: str,
    place: tuple[float, float, float],
    *,
    camera: Camera,
    target: TargetRef,
    azimuth_deg: float = 0.0,
    off_nadir_deg: float = 0.0,
    look_at: str = "earth",
    bands: Bands = "rgb",
    quality: Quality = "default",
    environment: Environment | None = None,
) -> SceneState:
    """Return the scene of a camera above the Earth.

    Parameters
    ----------
    epoch_utc : str
        Time, UTC.
    place : tuple of float
        Geodetic latitude and longitude [deg], altitude [km].
    camera : Camera
        Camera of the image.
    target : TargetRef
        Name and hash of the target.
    azimuth_deg : float, optional
        Azimuth of the boresight, from north to east; the top of the image points away from the Earth.
    off_nadir_deg : float, optional
        Angle of the boresight from nadir.
    look_at : str, optional
        ``earth`` for that direction; ``moon`` or ``sun`` for the centre of that body.
    bands : Bands, optional
        Spectral bands of the image.
    quality : Quality, optional
        Quality preset.
    environment : Environment, optional
        Layers of the world.

    Returns
    -------
    SceneState
        Scene at the given time.
    """
    now = Instant.from_utc(epoch_utc)
    earth, moon = bodies = bodies_at(now, EARTH)
    R_ie = earth.R_fixed_from_eci
    sun = np.asarray(sun_eci_m(now.tt1, now.tt2), float).reshape(3)
    r_itrs, enu = place_itrs_m(*place)
    r, up = R_ie.T @ r_itrs, R_ie.T @ enu[2]
    if look_at == "earth":
        a, o = np.radians(azimuth_deg), np.radians(off_nadir_deg)
        z = R_ie.T @ (enu.T @ np.array([np.sin(o) * np.sin(a), np.sin(o) * np.cos(a), -np.cos(o)]))
        # at nadir, the top of the image is along the azimuth
        above = enu.T @ np.array([np.sin(a), np.cos(a), 0.0])
        up = up + 1e-3 * (R_ie.T @ above)
    else:
        z = {"moon": np.asarray(moon.r_eci_m), "sun": sun}[look_at] - r
        z = z / np.linalg.norm(z)
    x = np.cross(z, up)
    x /= np.linalg.norm(x)
    R_ce = np.stack([x, np.cross(z, x), z])
    return SceneState(
        epoch_utc=now.iso(),
        t_s=0.0,
        frame_index=0,
        seed=1,
        camera=camera,
        sensor=sensor_preset("speed"),
        exposure_s=0.001,
        quality=quality,
        bands=bands,
        environment=environment or Environment(),
        target=target,
        q_camera_from_target_wxyz=(1.0, 0.0, 0.0, 0.0),
        t_camera_from_target_m=TARGET_POSITION_M,
        omega_target_rad_s=(0.0, 0.0, 0.0),
        v_target_camera_m_s=(0.0, 0.0, 0.0),
        r_camera_eci_m=vec3(r),
        v_camera_eci_m_s=(0.0, 0.0, 0.0),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(R_ce)),
        omega_camera_rad_s=(0.0, 0.0, 0.0),
        r_target_eci_m=vec3(r + R_ce.T @ np.array(TARGET_POSITION_M)),
        v_target_eci_m_s=(0.0, 0.0, 0.0),
        r_sun_eci_m=vec3(sun),
        bodies=bodies,
        sun_visible_fraction=sun_fraction_past_bodies(bodies, r, sun),
    )
