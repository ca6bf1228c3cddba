"""Drawing primitives for debug pictures: the model's wireframe, segments, labels."""

from __future__ import annotations

from typing import Any, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.model.visibility import occluders, sample_edges, visible_samples
from flyaround.hil.board.hybrid.native.library import is_available

Array = np.ndarray

# Colours of Okabe and Ito in OpenCV's order, BGR.
ORANGE, BLUE, GREEN, RED = (0, 159, 230), (233, 180, 86), (115, 158, 0), (0, 94, 213)

# Pieces of an edge that are tested for occlusion, over a length of the model's radius.
SAMPLES_PER_RADIUS = 30.0


def draw_wireframe(
    canvas: Array,
    model: BoardModel,
    camera: CameraIntrinsics,
    q_wxyz: Any,  # noqa: ANN401 - (4,) numbers
    t_m: Any,  # noqa: ANN401 - (3,) numbers
    colour: Tuple[int, int, int],
    corner: Tuple[float, float] = (0.0, 0.0),
    scale: float = 1.0,
    weight: int = 1,
) -> None:
    """Draw the visible parts of the model's edges on a BGR canvas with the given ``corner`` and ``scale``."""
    R, t = quat.matrix(quat.normalise(np.asarray(q_wxyz, float))), np.asarray(t_m, float)
    C = -R.T @ t
    spacing = model.radius_m / SAMPLES_PER_RADIUS
    samples = sample_edges(model, spacing)
    visible = np.ones(len(samples), bool)
    if is_available():  # the published methods work without the native library
        visible, _ = visible_samples(samples, occluders(model), C)
    points, tangents = samples.outline(np.arange(len(samples))[None], C[None])
    # each sample stands for a piece of its edge
    length = np.array([np.linalg.norm(e.b_m - e.a_m) for e in model.wireframe])
    half = (0.5 * length / np.maximum(1, np.rint(length / spacing)))[samples.edge, None] * tangents[0]
    P = np.stack([points[0] - half, points[0] + half], axis=1) @ R.T + t
    uv = np.clip(((camera.pixels(P) - corner) + 0.5) * scale - 0.5, -30000, 30000)
    # projection fails at the camera; closer points are not drawn
    for piece in uv[visible & (P[..., 2] > 0.1).all(axis=1)]:
        a, b = np.rint(piece * 16).astype(int).tolist()
        cv2.line(canvas, a, b, colour, weight, cv2.LINE_AA, 4)


def grey(values: Array, top: float) -> Array:
    """Return values in 0..top as a BGR image (h, w, 3)."""
    flat = np.clip(np.asarray(values, np.float32) * (255.0 / max(top, 1e-9)), 0, 255).astype(np.uint8)
    return np.asarray(cv2.cvtColor(flat, cv2.COLOR_GRAY2BGR), np.uint8)


def draw_segments(canvas: Array, segments: Array, corner: Array, scale: float) -> None:
    """Draw segments (N, 4) [image px], each in its own colour, on a canvas at ``corner`` and ``scale``."""
    hues = (np.arange(len(segments)) * 67) % 180
    for segment, hue in zip(np.asarray(segments, float).reshape(-1, 2, 2), hues):  # noqa: B905 - 3.9 has no strict=
        bgr = cv2.cvtColor(np.array([[[hue, 200, 255]]], np.uint8), cv2.COLOR_HSV2BGR)[0, 0]
        a, b = np.rint(((segment - corner + 0.5) * scale - 0.5) * 16).astype(int).tolist()
        cv2.line(canvas, a, b, [int(v) for v in bgr], 1, cv2.LINE_AA, 4)


def label(canvas: Array, text: str) -> None:
    """Draw a caption in the upper left corner."""
    # the outline is the text itself, shifted: in OpenCV 5, text of another weight has another width
    for dx, dy in ((-2, 0), (2, 0), (0, -2), (0, 2), (-1, -1), (1, -1), (-1, 1), (1, 1), (0, 0)):
        colour = (255, 255, 255) if dx == dy == 0 else (0, 0, 0)
        cv2.putText(canvas, text, (12 + dx, 26 + dy), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 1, cv2.LINE_AA)


def fitted(picture: Array, text: str, width: int, height: int) -> Array:
    """Return a BGR picture scaled to fit a canvas, in its middle, with a label."""
    scale = min(width / picture.shape[1], height / picture.shape[0])
    w, h = (max(1, round(side * scale)) for side in picture.shape[1::-1])
    canvas = np.zeros((height, width, 3), np.uint8)
    x, y = (width - w) // 2, (height - h) // 2
    flags = cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST
    canvas[y : y + h, x : x + w] = cv2.resize(picture, (w, h), interpolation=flags)
    label(canvas, text)
    return canvas
