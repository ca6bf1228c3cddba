"""Images of one craft by the renderer, in front of black: oblique views with the Sun behind the camera, and the six
sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.sensor import Sensor
from flyaround.simulator.camera.encoding import GAMMA
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scene.environments import NOTHING
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.scene.state import SceneState, TargetRef
from flyaround.simulator.world.constants import AU_M
from flyaround.simulator.world.ephemeris.body import earth_and_moon
from flyaround.simulator.world.frames.rotation import quat_from_matrix

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray
    from flyaround.simulator.targets.model import Target

# directions from the craft to the camera, target frame
OBLIQUE = ((1.0, -0.75, 0.55), (-0.85, 0.9, 0.45), (0.6, 0.85, -0.8))
SIDES = {
    "+x": (1, 0, 0),
    "-x": (-1, 0, 0),
    "+y": (0, 1, 0),
    "-y": (0, -1, 0),
    "+z": (0, 0, 1),
    "-z": (0, 0, -1),
}

KEY_LIGHT, FILL_LIGHT, FILL_SHARE = (-0.5, -0.45, -1.0), (0.6, 0.25, -1.0), 0.2
"""Key light up and to the left behind the camera (camera frame), and fill light of a fifth from the other side."""

FOCAL_WIDTHS = 3.0
"""Focal length in image widths, long so that sides look orthographic."""

FILLED_SHARE = 0.9  # share of the image that the craft spans

# Geocentric distance of the target [m].
ORBIT_M = 7e6
# RGB colours distinguishable by colour-blind readers (Okabe and Ito).
EDGE_RGB, POINT_RGB = (86, 180, 233), (230, 159, 0)

# Percentile of the craft's pixels that is shown as the second number, share of full scale: highlights above it are cut
# off last.
WHITE_PERCENTILE, WHITE_LEVEL = 98.0, 0.85

# Any exposure, because `develop` scales the radiance, and mean distance of the Moon [m], which is not drawn.
EXPOSURE_S, MOON_M = 0.01, 3.8e8

PIECES = 60  # pieces of an edge, each visible or hidden

SURFACE_TOLERANCE = 0.006
"""Depth below the surface, as a share of the craft's diagonal, at which a label still counts as visible."""


def bounds_m(target: Target) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest corner of the craft [m]."""
    points = np.concatenate([p.positions_m for p in target.parts]).astype(float)
    return points.min(axis=0), points.max(axis=0)


def view_scene(
    target: Target, eye: ArrayLike, width_px: int, height_px: int, to_sun: ArrayLike = KEY_LIGHT
) -> SceneState:
    """Return a scene that looks along ``-eye`` (target frame) with the craft filling the image.

    Parameters
    ----------
    target : Target
        Target model.
    eye : (3,) array
        Direction from the target to the camera, target frame.
    width_px : int
        Width of the image.
    height_px : int
        Height of the image.
    to_sun : array_like, optional
        Direction of the Sun, camera frame.
    """
    camera = Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=FOCAL_WIDTHS * width_px,
        fy_px=FOCAL_WIDTHS * width_px,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
    )
    z = -np.asarray(eye, float)
    z /= np.linalg.norm(z)
    # upright if the model's z is not along the view; otherwise y is up
    up = np.array([0.0, 0.0, 1.0]) if abs(z[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(z, up)
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(z, x), z])
    outline = np.concatenate([p.positions_m for p in target.parts]).astype(float) @ R.T
    middle = (outline.min(axis=0) + outline.max(axis=0)) / 2
    from_middle = outline - middle
    # smallest range at which all vertices lie inside the central part of the image
    need = [
        np.abs(from_middle[:, k]) * camera.fx_px / (FILLED_SHARE * size / 2) - from_middle[:, 2]
        for k, size in ((0, width_px), (1, height_px))
    ]
    t = -middle + np.array([0.0, 0.0, max(float(np.max(need)), float(from_middle[:, 2].max()) * 1.5)])
    sun = np.asarray(to_sun) / np.linalg.norm(to_sun) * AU_M
    target_position = np.array([ORBIT_M, 0.0, 0.0])
    return SceneState(
        epoch_utc="2026-01-01T00:00:00Z",
        t_s=0.0,
        frame_index=0,
        seed=0,
        camera=camera,
        sensor=Sensor(),
        exposure_s=EXPOSURE_S,
        environment=NOTHING,
        quality="high",
        bands="rgb",
        target=TargetRef(name=target.name, sha256=target.sha256),
        q_camera_from_target_wxyz=quat(quat_from_matrix(R)),
        t_camera_from_target_m=vec3(t),
        omega_target_rad_s=(0.0, 0.0, 0.0),
        v_target_camera_m_s=(0.0, 0.0, 0.0),
        r_camera_eci_m=vec3(target_position),
        v_camera_eci_m_s=(0.0, 0.0, 0.0),
        q_camera_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
        omega_camera_rad_s=(0.0, 0.0, 0.0),
        r_target_eci_m=vec3(target_position + t),
        v_target_eci_m_s=(0.0, 0.0, 0.0),
        r_sun_eci_m=vec3(target_position + t + sun),
        bodies=earth_and_moon((0.0, MOON_M, 0.0)),
        sun_visible_fraction=1.0,
    )


@dataclass(frozen=True, eq=False)
class TargetView:
    """An image of a craft: RGB (H, W, 3), the scene, and the surface depth (H, W) [m], NaN outside."""

    image: ByteArray
    scene: SceneState
    depth_m: Float32Array


def draw_view(
    renderer: Renderer, target: Target, eye: ArrayLike, width_px: int, height_px: int
) -> TargetView:
    """Draw the craft from the direction ``eye`` (target frame), exposed for it.

    Returns
    -------
    TargetView
        Developed image with some light from a second direction; scene and depth are those of the first drawing.

    Raises
    ------
    RuntimeError
        If the renderer returns no depth.
    """
    scene = view_scene(target, eye, width_px, height_px)
    rendered = renderer.render(scene, target, labels=True)
    if rendered.depth_m is None:
        raise RuntimeError("the renderer returned no depth although labels were requested")
    fill = renderer.render(view_scene(target, eye, width_px, height_px, FILL_LIGHT), target).radiance
    radiance = np.asarray(rendered.radiance, float) + FILL_SHARE * np.asarray(fill, float)
    return TargetView(develop(radiance), scene, rendered.depth_m)


def develop(radiance: FloatArray) -> ByteArray:
    """Convert linear radiance for display: sunlight white, the brightest two per cent just below it, gamma 2.2."""
    balanced = radiance / np.asarray(sun_irradiance_w_m2("rgb", AU_M))
    grey = balanced.max(axis=2)
    bright = grey[grey > 0]
    white = float(np.percentile(bright, WHITE_PERCENTILE)) if bright.size else 1.0
    return np.rint(255 * np.clip(WHITE_LEVEL * balanced / white, 0, 1) ** (1 / GAMMA)).astype(np.uint8)


def draw_labels(drawn: TargetView, target: Target) -> ByteArray:
    """Draw the visible wireframe and the keypoints over a view: filled if visible, rings if hidden.

    Returns
    -------
    (H, W, 3) array
        RGB copy of the view's image, 8 bits.
    """
    canvas = drawn.image.copy()
    pose, camera = drawn.scene.camera_from_target, drawn.scene.camera
    low, high = bounds_m(target)
    tolerance_m = SURFACE_TOLERANCE * float(np.linalg.norm(high - low))
    eye = np.asarray(pose.inverse().t_m)
    s = (np.arange(PIECES + 1) / PIECES)[:, None]
    for edge in target.wireframe:
        ends = np.array([edge.a_m, edge.b_m])
        sight = eye - ends.mean(axis=0)
        if edge.normals and max(float(sight @ np.asarray(n)) for n in edge.normals) <= 0:
            continue
        line = pose.apply(ends[0] + s * (ends[1] - ends[0]))
        visible = _visible(drawn, (line[:-1] + line[1:]) / 2, tolerance_m + edge.radius_m)
        pixels = np.rint(camera.project(line) * 8).astype(int).tolist()
        for k in np.flatnonzero(visible):
            cv2.line(canvas, tuple(pixels[k]), tuple(pixels[k + 1]), EDGE_RGB, 1, cv2.LINE_AA, 3)
    if target.keypoints:
        points = pose.apply(np.array([k.position_m for k in target.keypoints]))
        visible = _visible(drawn, points, tolerance_m)
        for pixel, is_seen in zip(
            np.rint(camera.project(points) * 8).astype(int).tolist(), visible, strict=True
        ):
            weight = cv2.FILLED if is_seen else 1
            cv2.circle(canvas, tuple(pixel), 4 * 8, POINT_RGB, weight, cv2.LINE_AA, 3)
    return canvas


def _visible(drawn: TargetView, points: FloatArray, tolerance_m: float) -> NDArray[np.bool_]:
    """Return (K,) True for points (K, 3), camera frame, that the drawn surface does not hide, within a tolerance."""
    depth = np.where(np.isnan(drawn.depth_m), np.float32(1e9), drawn.depth_m)
    farthest = np.asarray(cv2.dilate(depth, np.ones((3, 3), np.uint8)))
    height, width = farthest.shape
    u, v = np.rint(drawn.scene.camera.project(points)).astype(int).T
    return np.asarray(
        farthest[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)] >= points[:, 2] - tolerance_m
    )
