"""Truth drawn over an image, for people to look at: wireframe, keypoints by state, box, model axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.labels.truth import Truth
from simulator.labels.wireframe import view_edges
from simulator.targets.joined_mesh import mesh_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from simulator.camera.lens.camera_model import Camera
    from simulator.runtime.arrays import ByteArray
    from simulator.targets.model import Target
    from simulator.world.frames.pose import Pose

# RGB. Colours that a colour-blind reader tells apart (Okabe and Ito).
GREEN, ORANGE, BLUE, GREY = (0, 158, 115), (230, 159, 0), (86, 180, 233), (150, 150, 150)
AXES = ((213, 94, 0), (0, 158, 115), (86, 180, 233))
AXIS_LENGTH_M = 0.5
_FARTHEST_PX = 1e5


def draw_truth(
    image: NDArray[np.unsignedinteger], truth: Truth, target: Target, *, wireframe: bool = True
) -> ByteArray:
    """An RGB copy of an image with its labels drawn on it.

    Parameters
    ----------
    image : (H, W) or (H, W, 3), 8 bits.
    truth, target : the record and the model it names.
    wireframe : draw what the camera sees of the edges.
    """
    mono = np.asarray(image, np.uint8)
    canvas: ByteArray = np.repeat(mono[..., None], 3, axis=2) if mono.ndim == 2 else mono.copy()
    pose, camera = truth.scene.camera_from_target, truth.camera
    weight = max(1, round(camera.width_px / 1900))
    if wireframe:
        for view in view_edges(camera, pose, target, mesh_of(target)):
            for stretch in view.stretches:
                _line(canvas, view.at(np.array(stretch)), BLUE, weight)
    if truth.box_px is not None:
        x0, y0, x1, y1 = (round(v) for v in truth.box_px)
        cv2.rectangle(canvas, (x0, y0), (x1, y1), GREY, weight, cv2.LINE_AA)
    for axis, colour in zip(np.eye(3) * AXIS_LENGTH_M, AXES, strict=True):
        _line(canvas, camera.project(pose.apply(np.stack([np.zeros(3), axis]))), colour, 2 * weight)
    for k in truth.keypoints:
        if k.pixel_px is None or k.state == "out_of_frame":
            continue
        centre = (round(k.pixel_px[0]), round(k.pixel_px[1]))
        hidden = k.state == "self_occluded"
        colour = GREY if hidden else GREEN if k.state == "visible" else ORANGE
        cv2.circle(canvas, centre, 6 * weight, colour, weight if hidden else 2 * weight, cv2.LINE_AA)
    return canvas


def draw_axes(canvas: ByteArray, camera: Camera, pose: Pose, length_m: float) -> ByteArray:
    """The model's axes as arrows over an RGB image: x red, y green, z blue; one that reaches behind is left out.

    Parameters
    ----------
    canvas : (H, W, 3), 8 bits. pose : of the target in the camera. length_m : of each arrow.
    """
    drawn = canvas.copy()
    weight = max(1, round(camera.width_px / 640))
    for axis, colour in zip(np.eye(3) * length_m, AXES, strict=True):
        ends_m = pose.apply(np.stack([np.zeros(3), axis]))
        if ends_m[:, 2].min() <= 0:
            continue
        ends = camera.project(ends_m)
        if not np.all(np.isfinite(ends)) or np.abs(ends).max() > _FARTHEST_PX:
            continue
        a, b = ((round(float(x)), round(float(y))) for x, y in ends)
        cv2.arrowedLine(drawn, a, b, colour, weight, cv2.LINE_AA, tipLength=0.15)
    return drawn


def draw_pose(
    canvas: ByteArray, truth: Truth, target: Target, q_wxyz: tuple[float, ...], t_m: tuple[float, ...]
) -> ByteArray:
    """The wireframe at an estimated pose, in orange, over an RGB image."""
    pose = type(truth.scene.camera_from_target).of("camera", "target", q_wxyz, t_m)
    drawn = canvas.copy()
    weight = max(1, round(truth.camera.width_px / 1900))
    for view in view_edges(truth.camera, pose, target, mesh_of(target)):
        for stretch in view.stretches:
            _line(drawn, view.at(np.array(stretch)), ORANGE, weight)
    return drawn


def _line(canvas: ByteArray, ends: NDArray[np.float64], colour: tuple[int, int, int], weight: int) -> None:
    if not np.all(np.isfinite(ends)) or np.abs(ends).max() > 1e5:
        return
    a, b = (tuple(int(v) for v in np.rint(p)) for p in ends)
    cv2.line(canvas, (a[0], a[1]), (b[0], b[1]), colour, weight, cv2.LINE_AA)
