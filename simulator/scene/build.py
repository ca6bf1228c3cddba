"""build_scene: from a world state to the frozen SceneState of one image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from msgspec import UNSET

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.shutter import Shutter
from flyaround.simulator.runtime.arrays import Vec3, quat, vec3
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.state import Quality, SceneState, TargetRef
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_multiply

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.scene.illumination.area_light import AreaLight
    from flyaround.simulator.scene.illumination.lamp import Lamp
    from flyaround.simulator.world.flight.world_state import WorldState


def build_scene(
    world: WorldState,
    *,
    camera: Camera,
    sensor: Sensor,
    exposure_s: float,
    target: TargetRef,
    com_target_m: Vec3,
    frame_index: int,
    seed: int,
    quality: Quality = "default",
    bands: Bands = "mono",
    environment: Environment | None = None,
    optics: Optics | None = None,
    shutter: Shutter | None = None,
    lamp: Lamp | None = None,
    lights: Sequence[AreaLight] = (),
) -> SceneState:
    """Freeze the world at mid-exposure as seen by one camera.

    Orbits refer to centres of mass. The label is the pose of the model frame, whose origin is displaced by
    ``-com_target_m`` from the centre of mass.

    Parameters
    ----------
    world : WorldState
        State at mid-exposure.
    camera : Camera
        Intrinsics and lens.
    sensor : Sensor
        Detector and noise.
    exposure_s : float
        Exposure time [s].
    target : TargetRef
        Model to draw.
    com_target_m : array
        Centre of mass of the target in the model frame [m].
    frame_index : int
        Number of the frame; with ``seed`` the key of its random numbers.
    seed : int
        Seed of the random numbers.
    quality : Quality, optional
        Rendering quality.
    bands : Bands, optional
        Spectral bands of the image.
    environment : Environment, optional
        Layers that are drawn.
    optics : Optics, optional
        Effects of the lens other than distortion; by default none.
    shutter : Shutter, optional
        Readout of the rows, by default global.
    lamp : Lamp, optional
        Lamp on the chaser, if any.
    lights : sequence of AreaLight, optional
        Area lights.

    Returns
    -------
    SceneState
        Frozen scene in SI units.
    """
    q_ce = np.array(world.q_camera_from_eci_wxyz)
    R_camera_from_eci = matrix_from_quat(q_ce)
    R_eci_from_target = matrix_from_quat(world.q_eci_from_target_wxyz)
    omega_camera = np.array(world.omega_camera_rad_s)
    com = np.array(com_target_m, float)
    # origin minus centre of mass, and its velocity due to the rotation about the centre of mass
    origin_eci = R_eci_from_target @ -com
    origin_rate_eci = R_eci_from_target @ np.cross(world.omega_target_rad_s, -com)
    t_camera = R_camera_from_eci @ (origin_eci - np.array(world.relative_eci_m))
    v_camera = R_camera_from_eci @ (origin_rate_eci - np.array(world.relative_eci_m_s))
    q = quat_multiply(q_ce, world.q_eci_from_target_wxyz)
    return SceneState(
        epoch_utc=world.epoch_utc,
        t_s=world.t_s,
        frame_index=frame_index,
        seed=seed,
        camera=camera,
        sensor=sensor,
        exposure_s=exposure_s,
        shutter=shutter or Shutter(),
        quality=quality,
        bands=bands,
        environment=environment or Environment(),
        optics=optics or Optics(),
        target=target,
        # one sign per attitude, so that labels compare as text
        q_camera_from_target_wxyz=quat(q if q[0] >= 0 else -q),
        t_camera_from_target_m=vec3(t_camera),
        omega_target_rad_s=world.omega_target_rad_s,
        v_target_camera_m_s=vec3(v_camera - np.cross(omega_camera, t_camera)),
        r_camera_eci_m=world.r_chaser_eci_m,
        v_camera_eci_m_s=world.v_chaser_eci_m_s,
        q_camera_from_eci_wxyz=world.q_camera_from_eci_wxyz,
        omega_camera_rad_s=world.omega_camera_rad_s,
        r_target_eci_m=world.r_target_eci_m,
        v_target_eci_m_s=world.v_target_eci_m_s,
        r_sun_eci_m=world.r_sun_eci_m,
        bodies=world.bodies,
        sun_visible_fraction=world.sun_visible_fraction,
        central_body=world.central_body,
        lamp=lamp,
        lights=tuple(lights) or UNSET,
    )
