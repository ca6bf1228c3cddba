"""Pictures of one craft by the real renderer, against black: oblique views with the Sun behind, and the six sides."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.arrays import quat, vec3
from simulator.camera.model import Camera
from simulator.camera.sensor import Sensor
from simulator.scene.state import Environment, SceneState, TargetRef
from simulator.world.constants import AU_M
from simulator.world.rotation import quat_from_matrix

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from simulator.arrays import ByteArray, FloatArray
    from simulator.render.renderer import Renderer
    from simulator.targets.model import Target

OBLIQUE = ((1.0, -0.75, 0.55), (-0.85, 0.9, 0.45), (0.6, 0.85, -0.8))
SIDES = {
    "+x": (1, 0, 0),
    "-x": (-1, 0, 0),
    "+y": (0, 1, 0),
    "-y": (0, -1, 0),
    "+z": (0, 0, 1),
    "-z": (0, 0, -1),
}
FOCAL_WIDTHS = 3.0
"""Focal length in image widths: a long lens, so that sides look square."""
FILL = 0.9
ORBIT_M = 7e6
DARK = Environment(
    earth=False,
    clouds=False,
    ocean_glint=False,
    night_lights=False,
    atmosphere=False,
    stars=False,
    sun=False,
    earthshine=False,
)
# RGB. Colours that a colour-blind reader tells apart (Okabe and Ito).
EDGE_RGB, POINT_RGB = (86, 180, 233), (230, 159, 0)
GAMMA = 2.2


def bounds_m(target: Target) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner of the craft [m]."""
    points = np.concatenate([p.positions_m for p in target.parts]).astype(float)
    return points.min(axis=0), points.max(axis=0)


def view_scene(target: Target, eye: ArrayLike, width_px: int, height_px: int) -> SceneState:
    """A scene that looks along ``-eye`` (target frame) at the craft and is filled by it.

    The Sun stands behind the camera, up and to the left.
    """
    camera = Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=FOCAL_WIDTHS * width_px,
        fy_px=FOCAL_WIDTHS * width_px,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
    )
    low, high = bounds_m(target)
    z = -np.asarray(eye, float)
    z /= np.linalg.norm(z)
    # upright where the model's z is not along the view; else y is up
    up = np.array([0.0, 0.0, 1.0]) if abs(z[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(z, up)
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    corners = np.array(list(itertools.product(*zip(low, high, strict=True)))) @ R.T
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    from_middle = corners - middle
    # the range at which each corner just stays inside the filled part of the image
    need = [
        np.abs(from_middle[:, k]) * camera.fx_px / (FILL * size / 2) - from_middle[:, 2]
        for k, size in ((0, width_px), (1, height_px))
    ]
    t = -middle + np.array([0.0, 0.0, max(float(np.max(need)), float(from_middle[:, 2].max()) * 1.5)])
    to_sun = np.array([-0.55, -0.5, -1.0])
    sun = to_sun / np.linalg.norm(to_sun) * AU_M
    place = np.array([ORBIT_M, 0.0, 0.0])
    return SceneState(
        epoch_utc="2026-01-01T00:00:00Z",
        t_s=0.0,
        frame_index=0,
        seed=0,
        camera=camera,
        sensor=Sensor(),
        exposure_s=0.01,
        environment=DARK,
        quality="high",
        bands="rgb",
        target=TargetRef(name=target.name, sha256=target.sha256),
        q_camera_from_target_wxyz=quat(quat_from_matrix(R)),
        t_camera_from_target_m=vec3(t),
        omega_target_rad_s=(0.0, 0.0, 0.0),
        v_target_camera_m_s=(0.0, 0.0, 0.0),
        r_camera_eci_m=vec3(place),
        v_camera_eci_m_s=(0.0, 0.0, 0.0),
        q_camera_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
        omega_camera_rad_s=(0.0, 0.0, 0.0),
        r_target_eci_m=vec3(place + t),
        v_target_eci_m_s=(0.0, 0.0, 0.0),
        r_sun_eci_m=vec3(place + t + sun),
        r_moon_eci_m=(0.0, 3.8e8, 0.0),
        q_itrs_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
        sun_visible_fraction=1.0,
    )


def draw_view(renderer: Renderer, target: Target, eye: ArrayLike, width_px: int, height_px: int) -> ByteArray:
    """(H, W, 3) RGB picture, exposed for the craft."""
    radiance = renderer.render(view_scene(target, eye, width_px, height_px), target).radiance
    return developed(np.asarray(radiance, float))


def developed(radiance: FloatArray) -> ByteArray:
    """Linear radiance for the eye: near the brightest two per cent of the craft white, gamma 2.2."""
    grey = radiance.max(axis=2)
    lit = grey[grey > 0]
    white = float(np.percentile(lit, 98)) if lit.size else 1.0
    return np.rint(255 * np.clip(0.85 * radiance / white, 0, 1) ** (1 / GAMMA)).astype(np.uint8)


def draw_labels(image: ByteArray, scene: SceneState, target: Target) -> ByteArray:
    """A copy with the edges that face the camera and the keypoints that do not lie behind the craft's middle."""
    canvas = image.copy()
    pose = scene.camera_from_target
    eye = np.asarray(pose.inverse().t_m)
    for edge in target.wireframe:
        ends = np.array([edge.a_m, edge.b_m])
        sight = eye - ends.mean(axis=0)
        if edge.normals and max(float(sight @ np.asarray(n)) for n in edge.normals) <= 0:
            continue
        a, b = (tuple(int(v) for v in np.rint(p * 8)) for p in scene.camera.project(pose.apply(ends)))
        cv2.line(canvas, (a[0], a[1]), (b[0], b[1]), EDGE_RGB, 1, cv2.LINE_AA, 3)
    if target.keypoints:
        points = np.array([k.position_m for k in target.keypoints])
        for p in scene.camera.project(pose.apply(points)):
            centre = tuple(int(v) for v in np.rint(p * 8))
            cv2.circle(canvas, (centre[0], centre[1]), 4 * 8, POINT_RGB, 1, cv2.LINE_AA, 3)
    return canvas
