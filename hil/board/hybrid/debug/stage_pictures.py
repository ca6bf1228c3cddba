"""Debug pictures of every stage of an estimate, from the image gradient to the camera pose around the target."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Dict, List, Tuple, Union

import cv2
import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.record import Trace
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.debug.overlay import (
    BLUE,
    GREEN,
    ORANGE,
    RED,
    draw_segments,
    draw_wireframe,
    fitted,
    grey,
    label,
)
from flyaround.hil.board.hybrid.debug.synthetic_views import learned_proposal_picture, synthetic_view_picture
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.svd.weak_gradients import WeakGradientElimination

Array = np.ndarray

# Size of the pictures [px].
WIDTH, HEIGHT = 800, 500

GROUP_COLOURS = {
    "closed_tetrad": GREEN,
    "open_tetrad": BLUE,
    "open_triad": ORANGE,
    "antenna": RED,
    "parallel_pair": (167, 121, 204),
    "proximity_pair": (66, 228, 240),
}


DETECTORS = {
    "WGE": "weak gradient elimination",
    "S&H": "Sobel and Hough",
    "LSD": "line segment detector",
}
"""Detectors of line segments by their abbreviations (Sharma, Ventura & D'Amico 2018; von Gioi et al. 2010)."""


def write_stage_pictures(
    folder: Union[str, Path],
    image: Array,
    trace: Trace,
    result: PoseResult,
    model: BoardModel,
    camera: CameraIntrinsics,
) -> List[str]:
    """Write a picture of every stage that ran.

    Parameters
    ----------
    folder : path
        Folder of the pictures.
    image : (H, W) array
        Image in which the pose was estimated.
    trace : Trace
        Intermediate results that ``estimate`` recorded.
    result : PoseResult
        Result of the estimate.
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of the camera.

    Returns
    -------
    list of str
        File names in the order of the stages.

    Raises
    ------
    OSError
        If a picture cannot be written.
    """
    pictures = stage_pictures(image, trace, result, model, camera)
    names = []
    for k, (name, picture) in enumerate(pictures.items()):
        names.append(f"{k:02d}_{name}.png")
        # cv2.imwrite returns False without a reason; write_bytes raises OSError
        _, data = cv2.imencode(".png", picture)
        (Path(folder) / names[-1]).write_bytes(data.tobytes())
    return names


def stage_pictures(
    image: Array, trace: Trace, result: PoseResult, model: BoardModel, camera: CameraIntrinsics
) -> Dict[str, Array]:
    """Draw the pictures of the stages; see `write_stage_pictures` for the parameters.

    Returns
    -------
    dict of str to (HEIGHT, WIDTH, 3) array
        Pictures, BGR, by the name of the stage, in the order of the stages; those that did not run are absent.
    """
    out: Dict[str, Array] = {}
    top = max(float(np.percentile(image, 99.9)), 1.0)
    wge = trace.get("image_gradient") or trace.get("wge")
    if isinstance(wge, WeakGradientElimination):
        out.update(_gradients(image, top, wge))
    regions = trace.get("regions", [])
    if regions:
        out["region"] = _regions(image, top, regions, trace.get("published_region"))
    corner, scale = _window(image, regions)
    background = _view(image, top, corner, scale)
    for name, segments in _streams(trace).items():
        canvas = background.copy() // 2
        draw_segments(canvas, segments, corner, scale)
        label(canvas, f"{caption(name)}: {len(segments)}")
        out[name.lower().replace(" ", "_").replace("&", "")] = canvas
    out.update(_points(trace, background, corner, scale))
    groups = _groups(trace)
    if groups:
        out["groups"] = _group_picture(groups, background, corner, scale)
    proposal = trace.get("learned_proposal")
    if proposal is not None:
        noise = max(noise_sigma(image, 255.0 if image.dtype == np.uint8 else float(image.max())), 0.1)
        out["learned_proposal"] = learned_proposal_picture(
            image, proposal, noise, model, camera, (WIDTH, HEIGHT)
        )
    renderings = trace.get("drawn")
    if renderings is not None:
        out["drawn"] = synthetic_view_picture(renderings, (WIDTH, HEIGHT))
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    if q is not None and t is not None:
        canvas = background.copy()
        colour = GREEN if result.accepted else ORANGE
        draw_wireframe(canvas, model, camera, q, t, colour, (float(corner[0]), float(corner[1])), scale)
        label(
            canvas,
            f"estimated pose: {'accepted' if result.accepted else result.reason}, confidence {result.confidence:.2f}",
        )
        out["overlay"] = canvas
        out["camera_in_map"] = camera_in_map(model, camera, q, t)
    return out


def _gradients(image: Array, top: float, wge: WeakGradientElimination) -> Dict[str, Array]:
    """Return pictures of weak gradient elimination: gradient, histogram, strong gradients, filtered image."""
    out: Dict[str, Array] = {}
    strong = wge.strong.astype(np.uint8)
    out["gradient"] = fitted(grey(np.sqrt(wge.magnitude), 1.0), "image gradient (square root)", WIDTH, HEIGHT)
    out["histogram"] = histogram(wge)
    out["thresholded"] = fitted(grey(strong, 1.0), "thresholded gradient", WIDTH, HEIGHT)
    keep = cv2.dilate(strong, np.ones((5, 5), np.uint8))
    keep = cv2.resize(keep, image.shape[::-1], interpolation=cv2.INTER_NEAREST)
    out["filtered"] = fitted(grey(np.where(keep > 0, image, 0), top), "filtered image", WIDTH, HEIGHT)
    return out


def _regions(image: Array, top: float, regions: Any, grown: Any) -> Array:  # noqa: ANN401 - Regions, or None
    """Return a picture of the regions: the most likely one green, the published method's ``grown`` blue."""
    canvas = grey(image, top)
    for k, r in enumerate(regions):
        a, b = (int(r.x0), int(r.y0)), (int(r.x1), int(r.y1))
        cv2.rectangle(canvas, a, b, GREEN if k == 0 else ORANGE, 4 if k == 0 else 2)
    if grown is not None:
        cv2.rectangle(canvas, (int(grown.x0), int(grown.y0)), (int(grown.x1), int(grown.y1)), BLUE, 2)
    return fitted(canvas, "regions of interest", WIDTH, HEIGHT)


def _group_picture(groups: Dict[str, Array], background: Array, corner: Array, scale: float) -> Array:
    """Return a picture of the perceptual groups, one colour per kind."""
    canvas = background.copy() // 2
    for kind, points in groups.items():
        for figure in points:
            uv = np.rint(((figure - corner + 0.5) * scale - 0.5) * 16).astype(np.int32)
            # a parallel pair has two separate lines, every other group is a chain
            chains = [uv[:2], uv[2:]] if kind == "parallel_pair" else [uv]
            cv2.polylines(canvas, chains, kind == "closed_tetrad", GROUP_COLOURS[kind], 1, cv2.LINE_AA, 4)
    label(
        canvas,
        "perceptual groups: "
        + ", ".join(f"{len(p)} {k.replace('_', ' ')}" for k, p in groups.items() if len(p)),
    )
    return canvas


def histogram(wge: WeakGradientElimination) -> Array:
    """Return a picture of the logarithmic gradient histogram with the fitted exponential and the threshold."""
    canvas = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    x0, y0, x1, y1 = 60, 40, WIDTH - 30, HEIGHT - 50
    counts = np.maximum(wge.counts, 0.5)
    high = np.log10(counts.max() * 2)

    def row(value: Array) -> Array:
        return y1 - (y1 - y0) * np.clip((np.log10(np.maximum(value, 0.5)) + 0.31) / (high + 0.31), 0, 1)

    bins = len(counts)
    for k in range(bins):
        left, right = (int(x0 + (x1 - x0) * (k + e) / bins) for e in (0, 1))
        cv2.rectangle(canvas, (left, int(row(counts[k]))), (right - 1, y1), (200, 160, 90), -1)
    mean = wge.threshold / -np.log(0.01)
    s = (np.arange(bins) + 0.5) / bins
    curve = counts.sum() / bins / max(mean, 1e-9) * np.exp(-s / max(mean, 1e-9))
    points = np.stack([x0 + (x1 - x0) * s, row(curve)], axis=-1).astype(np.int32)
    cv2.polylines(canvas, [points], False, RED, 2, cv2.LINE_AA)
    threshold_px = int(x0 + (x1 - x0) * wge.threshold)
    cv2.line(canvas, (threshold_px, y0), (threshold_px, y1), (60, 60, 60), 2)
    cv2.line(canvas, (x0, y1), (x1, y1), (0, 0, 0), 1)
    texts = (
        (f"threshold {wge.threshold:.3f}", (threshold_px + 8, y0 + 14)),
        ("red: exponential fitted by its mean", (int(points[min(20, bins - 1), 0]) + 12, y0 + 60)),
        ("normalised gradient", (WIDTH // 2 - 80, HEIGHT - 18)),
        ("pixels, logarithmic", (8, 24)),
    )
    for text, position in texts:
        cv2.putText(canvas, text, position, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (40, 40, 40), 1, cv2.LINE_AA)
    return canvas


def camera_in_map(model: BoardModel, camera: CameraIntrinsics, q: Any, t: Any) -> Array:  # noqa: ANN401 - pose arrays
    """Return a side view of the model's wireframe with the camera at its pose."""
    canvas = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    R, t = quat.matrix(np.asarray(q, float)), np.asarray(t, float)
    camera_position = -R.T @ t
    depth = 0.28 * float(np.linalg.norm(t))
    corners = np.array(
        [[0, 0], [camera.width_px, 0], [camera.width_px, camera.height_px], [0, camera.height_px]]
    )
    rays = (corners - (camera.cx_px, camera.cy_px)) / (camera.fx_px, camera.fy_px)
    frustum = np.concatenate([rays, np.ones((4, 1))], axis=1) * depth @ R + camera_position
    sight = np.stack([camera_position, np.zeros(3)])
    edges = np.array([[e.a_m, e.b_m] for e in model.wireframe])
    # viewpoint to the side of the line of sight and slightly above it
    forward = np.cross(
        camera_position,
        [0.0, 0.0, 1.0]
        # any axis that is not nearly parallel
        if abs(camera_position[2]) < 0.9 * np.linalg.norm(camera_position)
        else [1.0, 0.0, 0.0],
    )
    forward = forward / np.linalg.norm(forward) - 0.35 * np.cross(
        camera_position / np.linalg.norm(camera_position), forward / np.linalg.norm(forward)
    )
    forward = forward / np.linalg.norm(forward)
    right = camera_position / np.linalg.norm(camera_position)
    right = right - (right @ forward) * forward
    right = right / np.linalg.norm(right)
    V = np.stack([right, np.cross(forward, right)])
    everything = np.concatenate([edges.reshape(-1, 3), frustum, camera_position[None]]) @ V.T
    low, high = everything.min(axis=0), everything.max(axis=0)
    scale = min((WIDTH - 100) / (high[0] - low[0]), (HEIGHT - 110) / (high[1] - low[1]))
    middle = 0.5 * (low + high)

    def place(points: Array) -> Array:
        uv = (points @ V.T - middle) * scale + (WIDTH / 2, HEIGHT / 2 + 10)
        return np.rint(uv * 16).astype(np.int32)

    for e in edges:
        a, b = place(e).tolist()
        cv2.line(canvas, a, b, (120, 90, 40), 1, cv2.LINE_AA, 4)
    a, b = place(sight).tolist()
    cv2.line(canvas, a, b, (190, 190, 190), 1, cv2.LINE_AA, 4)
    for c in frustum:
        a, b = place(np.stack([camera_position, c])).tolist()
        cv2.line(canvas, a, b, ORANGE, 2, cv2.LINE_AA, 4)
    cv2.polylines(canvas, [place(frustum)], True, ORANGE, 2, cv2.LINE_AA, 4)
    for axis, colour in zip(np.eye(3) * 0.6 * model.radius_m, (RED, GREEN, BLUE)):  # noqa: B905 - 3.9 has no strict=
        a, b = place(np.stack([np.zeros(3), axis])).tolist()
        cv2.line(canvas, a, b, colour, 2, cv2.LINE_AA, 4)
    text = f"camera in target axes: {camera_position[0]:+.2f} {camera_position[1]:+.2f} {camera_position[2]:+.2f} m"
    cv2.putText(canvas, text, (12, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (40, 40, 40), 1, cv2.LINE_AA)
    return canvas


def _window(image: Array, regions: Any) -> Tuple[Array, float]:  # noqa: ANN401 - list of Region
    """Return the corner and scale of a view that contains the first region."""
    h, w = image.shape
    x0, y0, x1, y1 = (-0.5, -0.5, w - 0.5, h - 0.5)
    if regions:
        r = regions[0]
        m = 0.12 * r.diagonal_px + 10
        x0, y0, x1, y1 = r.x0 - m, r.y0 - m, r.x1 + m, r.y1 + m
    scale = min(WIDTH / (x1 - x0), HEIGHT / (y1 - y0))
    centre = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    # keep the view within the image unless it is larger than the image
    size = np.array([WIDTH, HEIGHT]) / scale
    low, high = np.full(2, -0.5), np.array([w, h]) - 0.5 - size
    corner = centre - 0.5 * size
    return np.where(high >= low, np.clip(corner, low, np.maximum(high, low)), corner), scale


def _view(image: Array, top: float, corner: Array, scale: float) -> Array:
    shift = 0.5 * scale - 0.5 - scale * corner
    M = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    flags = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return grey(cv2.warpAffine(np.asarray(image, np.float32), M, (WIDTH, HEIGHT), flags=flags), top)


def _streams(trace: Trace) -> Dict[str, Array]:
    """Return the segments of each stream, and the merged ones [image px]."""
    published = trace.get("published_streams")
    if published is not None:
        names = {"wge": "WGE stream", "sh": "S&H stream", "lsd": "LSD stream"}
        streams = {names[k]: v for k, v in published.by_name.items()}
        merged_streams = {names[k].replace("stream", "merged"): v for k, v in published.merged.items()}
        return {**streams, **merged_streams, "all merged": published.lines}
    field, lines = trace.get("stream_field"), trace.get("merged")
    if field is None or lines is None:
        return {}
    stream_segments = {**trace.get("streams", {}), "merged": lines.ends.reshape(-1, 4)}

    def full(segments: Array) -> Array:
        points = (segments.reshape(-1, 2) + 0.5) * field.factor - 0.5 + (field.x0, field.y0)
        return np.asarray(points.reshape(-1, 4))

    return {name: full(np.asarray(s, float)) for name, s in stream_segments.items()}


def caption(stream: str) -> str:
    """Return the name of a stream of line segments in words.

    Parameters
    ----------
    stream : str
        Name in the trace, such as ``WGE stream`` or ``all merged``.

    Returns
    -------
    str
        Words for the picture; the given name for a stream of another method.
    """
    detector, _, kind = stream.rpartition(" ")
    if kind == "merged":
        return f"merged lines, {DETECTORS[detector]}" if detector in DETECTORS else "merged lines"
    return f"lines, {DETECTORS[detector]}" if detector in DETECTORS else stream


def _points(trace: Trace, background: Array, corner: Array, scale: float) -> Dict[str, Array]:
    """Return pictures of corners and ellipses, if the method detects them."""
    published = trace.get("published_streams")
    out: Dict[str, Array] = {}
    if published is not None and len(published.corners):
        canvas = background.copy() // 2
        for u, v in ((published.corners - corner + 0.5) * scale - 0.5) * 16:
            cv2.circle(canvas, (int(u), int(v)), 16 * 5, ORANGE, 1, cv2.LINE_AA, 4)
        label(canvas, f"Harris corners: {len(published.corners)}")
        out["harris"] = canvas
    if published is not None and published.ellipses:
        canvas = background.copy() // 2
        for e in published.ellipses:
            uv = np.rint(((e.points() - corner + 0.5) * scale - 0.5) * 16).astype(np.int32)
            cv2.polylines(canvas, [uv], True, GREEN, 1, cv2.LINE_AA, 4)
        label(canvas, f"ellipses: {len(published.ellipses)}")
        out["ellipses"] = canvas
    return out


def _groups(trace: Trace) -> Dict[str, Array]:
    groups = trace.get("point_groups")
    if groups is not None:
        return {kind: groups.of_kind(kind) for kind in GROUP_COLOURS if kind != "proximity_pair"}
    field, chains = trace.get("stream_field"), trace.get("chains")
    if field is None or chains is None or not len(chains.points):
        return {}
    points = (chains.points + 0.5) * field.factor - 0.5 + (field.x0, field.y0)
    return {"closed_tetrad": points[chains.closed], "open_triad": points[~chains.closed][:20]}
