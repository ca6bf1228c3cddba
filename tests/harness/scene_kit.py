"""Small scenes and targets made by hand, for tests that draw; the fixture `draw_kit` hands them out."""

from dataclasses import replace

import msgspec
import numpy as np

from flyaround.simulator.camera.detector.sensor import Sensor
from flyaround.simulator.camera.lens.camera_model import Camera, Distortion
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene import environments
from flyaround.simulator.scene.state import SceneState, TargetRef
from flyaround.simulator.targets.model import Material, Part
from flyaround.simulator.world.ephemeris.body import earth_and_moon
from flyaround.simulator.world.frames.rotation import quat_from_matrix, quat_from_rotvec, quat_normalize
from tools.validation.bare_scene import bare_target

AU_M = 149_597_870_700.0
CAMERA = Camera(width_px=320, height_px=240, fx_px=600.0, fy_px=590.0, cx_px=161.3, cy_px=118.6)
LENS_CAMERA = replace(
    CAMERA,
    fy_px=520.0,
    cx_px=171.3,
    cy_px=101.6,
    distortion=Distortion("brown_conrady", (-0.25, 0.1, 2e-3, -3e-3, 0.02)),
)
"""A camera on which no two intrinsics may be taken for each other: for tests of labels, formats and messages."""
NOTHING = msgspec.structs.replace(environments.NOTHING, seasons=False, relief=False)
build_target = bare_target


def quad(name, material, corners_m):
    """A flat part of four corners, counter-clockwise seen from outside."""
    p = np.asarray(corners_m, np.float32)
    n = np.cross(p[1] - p[0], p[2] - p[0])
    n = n / np.linalg.norm(n)
    return Part(
        name=name,
        material=material,
        positions_m=p,
        normals=np.tile(n, (4, 1)).astype(np.float32),
        triangles=np.array([[0, 1, 2], [0, 2, 3]]),
    )


def plate(name, material, center_m, half_m):
    """A square facing -z (towards a camera in front of it)."""
    x, y, z = center_m
    h = half_m
    return quad(name, material, [(x - h, y - h, z), (x - h, y + h, z), (x + h, y + h, z), (x + h, y - h, z)])


def white(**changes):
    """A rough white paint."""
    return replace(Material(name="white", base_color=(0.5, 0.5, 0.5), roughness=1.0), **changes)


def build_scene(
    target,
    *,
    t_m=(0.0, 0.0, 5.0),
    rotvec_rad=(0.0, 0.0, 0.0),
    sun_camera=(0.0, 0.0, -1.0),
    camera=CAMERA,
    latitude_deg=0.0,
    longitude_deg=-30.0,
    altitude_m=500e3,
    azimuth_deg=0.0,
    off_nadir_deg=0.0,
    **changes,
):
    """A scene whose camera hangs over a place on Earth; the Sun is given in the camera's frame."""
    la, lo = np.radians([latitude_deg, longitude_deg])
    up = np.array([np.cos(la) * np.cos(lo), np.cos(la) * np.sin(lo), np.sin(la)])
    east = np.cross([0, 0, 1.0], up) / np.linalg.norm(np.cross([0, 0, 1.0], up))
    azimuth, off = np.radians([azimuth_deg, off_nadir_deg])
    ahead = np.cos(azimuth) * np.cross(up, east) + np.sin(azimuth) * east
    z = -np.cos(off) * up + np.sin(off) * ahead
    y = -(np.sin(off) * up + np.cos(off) * ahead)
    R = np.stack([np.cross(y, z), y, z])
    r_camera = up * (6_378_137.0 + altitude_m)
    r_target = r_camera + R.T @ np.asarray(t_m, float)
    sun = np.asarray(sun_camera, float)
    r_sun = r_target + R.T @ (sun / np.linalg.norm(sun)) * AU_M
    scene = SceneState(
        epoch_utc="2026-03-01T12:00:00.000Z",
        t_s=0.0,
        frame_index=0,
        seed=1,
        camera=camera,
        sensor=Sensor(),
        exposure_s=1e-3,
        environment=NOTHING,
        target=TargetRef(name=target.name, sha256=target.sha256),
        q_camera_from_target_wxyz=quat(quat_normalize(quat_from_rotvec(np.asarray(rotvec_rad, float)))),
        t_camera_from_target_m=vec3(np.asarray(t_m, float)),
        omega_target_rad_s=(0.0, 0.0, 0.0),
        v_target_camera_m_s=(0.0, 0.0, 0.0),
        r_camera_eci_m=vec3(r_camera),
        v_camera_eci_m_s=(0.0, 0.0, 0.0),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(R)),
        omega_camera_rad_s=(0.0, 0.0, 0.0),
        r_target_eci_m=vec3(r_target),
        v_target_eci_m_s=(0.0, 0.0, 0.0),
        r_sun_eci_m=vec3(r_sun),
        bodies=earth_and_moon((3.8e8, 0.0, 0.0)),
        sun_visible_fraction=1.0,
    )
    return replace(scene, **changes)
