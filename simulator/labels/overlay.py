"""Truth drawn over an image: wireframe, keypoints by state, box, model axes."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.imaging.display import display_picture
from flyaround.simulator.labels.wireframe import view_edges
from flyaround.simulator.targets.joined_mesh import joined_mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.encoding import Encoding
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.labels.truth import Box, KeypointLabel, Truth
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

# RGB colours distinguishable by colour-blind readers (Okabe and Ito).
GREEN, ORANGE, BLUE, GREY = (0, 158, 115), (230, 159, 0), (86, 180, 233), (150, 150, 150)

# Colours of the x, y and z axis, and their length [m], visible beside a craft of one to ten metres.
AXES = ((213, 94, 0), (0, 158, 115), (86, 180, 233))
AXIS_LENGTH_M = 0.5

# Coordinate beyond which a line is not drawn [px]: OpenCV's line drawing overflows.
_MAX_COORDINATE_PX = 1e5
# Width of an image [px] per pixel of an arrow's and of a line's width, so that they look alike at every size; tip of an
# arrow over its length.
_ARROW_WIDTHS, _LINE_WIDTHS, _TIP_SHARE = 640, 1900, 0.15


def screen_rgb(image: NDArray[np.unsignedinteger], sensor: Sensor, encoding: Encoding) -> ByteArray:
    """Convert an image (H, W) or (H, W, 3) to RGB as displayed: see `display_picture`.

    Returns
    -------
    (H, W, 3) array
        RGB copy, 8 bits.
    """
    picture = display_picture(image, sensor, encoding)
    return np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture


def draw_truth(
    image: NDArray[np.unsignedinteger], truth: Truth, target: Target, *, wireframe: bool = True
) -> ByteArray:
    """Return an RGB copy of an image, as displayed, with its labels drawn on it.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        Image with the encoding of the record's camera.
    truth : Truth
        Label record.
    target : Target
        Model of the target.
    wireframe : bool, optional
        True to draw the visible parts of the edges.

    Returns
    -------
    (H, W, 3) array
        RGB, 8 bits.
    """
    pose, camera = truth.scene.camera_from_target, truth.camera
    canvas = screen_rgb(image, truth.scene.sensor, camera.pixel_encoding)
    width = _line_width(camera)
    if wireframe:
        canvas = draw_wireframe(canvas, camera, pose, target)
    canvas = draw_box(canvas, camera, truth.box_px)
    for axis, colour in zip(np.eye(3) * AXIS_LENGTH_M, AXES, strict=True):
        _line(canvas, camera.project(pose.apply(np.stack([np.zeros(3), axis]))), colour, 2 * width)
    return draw_keypoints(canvas, camera, truth.keypoints)


def draw_wireframe(
    canvas: ByteArray, camera: Camera, pose: Pose, target: Target, colour: tuple[int, int, int] = BLUE
) -> ByteArray:
    """Draw the visible edges of a target at a pose over an RGB image.

    Returns
    -------
    (H, W, 3) array
        RGB copy, 8 bits.
    """
    picture = canvas.copy()
    for view in view_edges(camera, pose, target, joined_mesh(target)):
        for interval in view.intervals:
            points = view.at(np.linspace(*interval, edge_points(camera)))
            for ends in itertools.pairwise(points):
                _line(picture, np.array(ends), colour, _line_width(camera))
    return picture


def edge_points(camera: Camera) -> int:
    """Return the number of points through which a projected edge is drawn.

    Returns
    -------
    int
        2 without distortion; under a lens, which bows straight edges, 17: 1/256 of the bow remains.
    """
    return 2 if camera.distortion.is_none else 17


def draw_box(canvas: ByteArray, camera: Camera, box_px: Box | None) -> ByteArray:
    """Draw a box, if there is one, over an RGB image.

    Returns
    -------
    (H, W, 3) array
        RGB copy, 8 bits; without a box an unchanged one.
    """
    picture = canvas.copy()
    if box_px is not None:
        x0, y0, x1, y1 = (round(v) for v in box_px)
        cv2.rectangle(picture, (x0, y0), (x1, y1), GREY, _line_width(camera), cv2.LINE_AA)
    return picture


def draw_keypoints(canvas: ByteArray, camera: Camera, keypoints: tuple[KeypointLabel, ...]) -> ByteArray:
    """Draw keypoints over an RGB image: green if visible, grey if hidden, orange if unlit, saturated or in the noise.

    Returns
    -------
    (H, W, 3) array
        RGB copy, 8 bits, without the keypoints behind the camera or outside the image.
    """
    picture, width = canvas.copy(), _line_width(camera)
    for k in keypoints:
        if k.pixel_px is None or k.state == "out_of_frame":
            continue
        centre = (round(k.pixel_px[0]), round(k.pixel_px[1]))
        is_hidden = k.state == "self_occluded"
        colour = GREY if is_hidden else GREEN if k.state == "visible" else ORANGE
        cv2.circle(picture, centre, 6 * width, colour, width if is_hidden else 2 * width, cv2.LINE_AA)
    return picture


def draw_outline(canvas: ByteArray, camera: Camera, mask: ByteArray) -> ByteArray:
    """Draw the outline of a mask over an RGB image.

    Returns
    -------
    (H, W, 3) array
        RGB copy, 8 bits, with inner and outer outlines.
    """
    picture = canvas.copy()
    outlines, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outlines, -1, ORANGE, _line_width(camera))
    return picture


def draw_axes(canvas: ByteArray, camera: Camera, pose: Pose, length_m: float) -> ByteArray:
    """Draw the model's axes as arrows over an RGB image: x red, y green, z blue; axes behind the camera are omitted.

    Parameters
    ----------
    canvas : (H, W, 3) array
        8 bits.
    camera : Camera
        Camera of the image.
    pose : Pose
        Camera-from-target pose.
    length_m : float
        Length of each arrow.

    Returns
    -------
    (H, W, 3) array
        RGB copy, 8 bits.
    """
    picture = canvas.copy()
    width = max(1, round(camera.width_px / _ARROW_WIDTHS))
    for axis, colour in zip(np.eye(3) * length_m, AXES, strict=True):
        ends_m = pose.apply(np.stack([np.zeros(3), axis]))
        if ends_m[:, 2].min() <= 0:
            continue
        ends = camera.project(ends_m)
        if not np.all(np.isfinite(ends)) or np.abs(ends).max() > _MAX_COORDINATE_PX:
            continue
        a, b = ((round(float(x)), round(float(y))) for x, y in ends)
        cv2.arrowedLine(picture, a, b, colour, width, cv2.LINE_AA, tipLength=_TIP_SHARE)
    return picture


def draw_pose(
    canvas: ByteArray, truth: Truth, target: Target, q_wxyz: tuple[float, ...], t_m: tuple[float, ...]
) -> ByteArray:
    """Draw the wireframe at an estimated pose, in orange, over an RGB image.

    Returns
    -------
    (H, W, 3) array
        RGB copy, 8 bits.
    """
    pose = type(truth.scene.camera_from_target).from_arrays("camera", "target", q_wxyz, t_m)
    return draw_wireframe(canvas, truth.camera, pose, target, ORANGE)


def _line_width(camera: Camera) -> int:
    """Return the width of lines [px]."""
    return max(1, round(camera.width_px / _LINE_WIDTHS))


def _line(canvas: ByteArray, ends: NDArray[np.float64], colour: tuple[int, int, int], width: int) -> None:
    if not np.all(np.isfinite(ends)) or np.abs(ends).max() > _MAX_COORDINATE_PX:
        return
    a, b = (tuple(int(v) for v in np.rint(p)) for p in ends)
    cv2.line(canvas, (a[0], a[1]), (b[0], b[1]), colour, width, cv2.LINE_AA)
