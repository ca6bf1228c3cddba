"""Faults injected into one label of a frame, with consistent record and hashes, to test the label check itself."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.frame import Frame
from flyaround.simulator.labels.boxes import mask_box
from flyaround.simulator.labels.layers import layer_hash, pixel_hash
from flyaround.simulator.labels.truth import Truth

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

ENOUGH_PX = 400
"""A craft of fewer pixels can be so thin that a neighbouring label is correct too."""


def inject_fault(kind: str, frame: Frame) -> Frame | None:
    """Return a copy of a frame with one wrong label; None if the frame lacks the label or is too small to tell."""
    if frame.mask is None or frame.truth is None or np.count_nonzero(frame.mask) < ENOUGH_PX:
        return None
    return FAULTS[kind](frame)


def _record(change: Callable[[dict[str, Any]], bool]) -> Callable[[Frame], Frame | None]:
    def spoiler(frame: Frame) -> Frame | None:
        record = msgspec.json.decode(msgspec.json.encode(frame.truth))
        return replace(frame, truth=msgspec.convert(record, Truth)) if change(record) else None

    return spoiler


def _layer(name: str, change: Callable[[NDArray[Any]], NDArray[Any]]) -> Callable[[Frame], Frame | None]:
    def spoiler(frame: Frame) -> Frame | None:
        if name not in frame.layers or frame.truth is None or frame.mask is None:
            return None
        layer = change(frame.layers[name])
        hashes = {**frame.truth.layer_sha256, name: layer_hash(name, layer, frame.mask)}
        truth = msgspec.structs.replace(frame.truth, layer_sha256=hashes)
        return replace(frame, layers={**frame.layers, name: layer}, truth=truth)

    return spoiler


def _shifted_mask(frame: Frame) -> Frame | None:
    """Return the frame with mask, box and hash moved by four pixels, without the layers that would reveal it."""
    if frame.mask is None or frame.truth is None:
        return None
    mask = np.roll(frame.mask, 4, axis=1)
    truth = msgspec.structs.replace(
        frame.truth,
        box_px=mask_box(mask),
        mask_sha256=pixel_hash(mask),
        layers=(),
        layer_sha256={},
        wireframe=(),
        parts=(),
        amodal_origin_px=None,
        flow=None,
    )
    return replace(frame, mask=mask, layers={}, truth=truth)


def _moved_keypoint(record: dict[str, Any]) -> bool:
    projected = [k for k in record["keypoints"] if k["pixel_px"] is not None]
    for k in projected[:1]:
        k["pixel_px"][0] += 0.001
    return bool(projected)


def _hidden_keypoint_shown(record: dict[str, Any]) -> bool:
    hidden = [k for k in record["keypoints"] if k["state"] == "self_occluded"]
    for k in hidden[:1]:
        k["state"] = "visible"
    return bool(hidden)


def _moved_pose(record: dict[str, Any]) -> bool:
    record["t_camera_from_target_m"][2] *= 1.00001
    record["scene"]["t_camera_from_target_m"] = record["t_camera_from_target_m"]
    return True


def _conjugate(record: dict[str, Any]) -> bool:
    q = record["q_camera_from_target_wxyz"]
    record["q_camera_from_target_wxyz"] = [q[0], -q[1], -q[2], -q[3]]
    record["scene"]["q_camera_from_target_wxyz"] = record["q_camera_from_target_wxyz"]
    return True


def _turned_sun(record: dict[str, Any]) -> bool:
    record["sun_direction_camera"] = [-x for x in record["sun_direction_camera"]]
    return True


def _wider_box(record: dict[str, Any]) -> bool:
    if record["box_px"] is not None:
        record["box_px"][2] += 1.0
    return record["box_px"] is not None


def _moved_box_3d(record: dict[str, Any]) -> bool:
    record["box_3d_target_m"][5][1] += 1e-6
    return True


def _moved_edge(record: dict[str, Any]) -> bool:
    """Move an edge, only in images of an ideal lens: with distortion, projection is undefined outside the image."""
    usable = bool(record["wireframe"]) and record["camera"]["distortion"]["model"] == "none"
    if usable:
        record["wireframe"][0]["ends_px"][1][0] += 0.01
    return usable


def _called_saturated(record: dict[str, Any]) -> bool:
    """Mark keypoints as saturated, only in frames with a noise-free twin, which reveals the fault."""
    visible = [k for k in record["keypoints"] if k["state"] == "visible"]
    usable = bool(visible) and "clean" in record["layers"] and record["scene"]["bands"] == "mono"
    detector = record["scene"]["sensor"]["detector"]
    usable = usable and (detector is None or detector["blooming"] == 0)
    for k in visible[:usable]:
        k["state"] = "saturated"
    return usable


def _tilted(normals: NDArray[Any]) -> NDArray[Any]:
    """Return normals tilted by about 17 degrees; mirroring would not change a flat board that faces the camera."""
    n = normals.astype(float)
    length = np.linalg.norm(n, axis=-1, keepdims=True)
    n = n + np.array([0.3, 0.0, 0.0]) * length
    return (n / np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-9)).astype(normals.dtype)


def _offset(clean: NDArray[Any]) -> NDArray[Any]:
    """Return the layer brighter by a sixth of full scale, or darker where that clips."""
    step = 40 if clean.dtype == np.uint8 else 640
    return np.where(clean > np.median(clean), clean - np.minimum(clean, step), clean + step).astype(
        clean.dtype
    )


FAULTS: dict[str, Callable[[Frame], Frame | None]] = {
    "mask moved": _shifted_mask,
    "keypoint moved by 0.001 px": _record(_moved_keypoint),
    "hidden keypoint shown": _record(_hidden_keypoint_shown),
    "visible keypoint called saturated": _record(_called_saturated),
    "box a pixel wider": _record(_wider_box),
    "corner of the 3D box moved": _record(_moved_box_3d),
    "edge moved by 0.01 px": _record(_moved_edge),
    "range 10 ppm off": _record(_moved_pose),
    "quaternion conjugated": _record(_conjugate),
    "Sun turned": _record(_turned_sun),
    "depth 0.2 % off": _layer("depth", lambda x: x * np.float32(1.002)),
    "depth upside down": _layer("depth", lambda x: x[::-1]),
    "normals tilted": _layer("normals", _tilted),
    "parts renumbered": _layer(
        "parts", lambda x: np.where(x > 0, x % max(int(x.max()), 1) + 1, 0).astype(x.dtype)
    ),
    "flow reversed": _layer("flow", lambda x: -x),
    "amodal mask moved": _layer("amodal", lambda x: np.roll(x, 3, axis=0)),
    "clean twin 16 % off": _layer("clean", _offset),
}
