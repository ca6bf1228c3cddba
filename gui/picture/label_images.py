"""Label layers as pictures for people: depth in colours with a scale, parts by class with a legend."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.gui import style
from flyaround.gui.picture.relative_map import nice_step
from flyaround.gui.picture.screen import screen_picture
from flyaround.gui.texts import texts
from flyaround.simulator.labels.part_classes import PART_CLASSES, part_class
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.targets.model import PartClass

if TYPE_CHECKING:
    from flyaround.gui.style import Rgba
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array

LABELS = LabelRequest(layers=("depth", "parts"))
LABELS_EVERY_S = 1.0
"""Least time between pictures with labels, which cost several times as much."""
OFF_RGB = (14, 17, 21)  # colour of pixels off the target
DIMMED = 0.35
"""Brightness of the picture under parts and keypoints."""

CLOSE_UP_MARGIN = 1.5
"""Size of a close-up over that of the target."""
CLOSE_UP_LEAST_PX = 48

PART_COLOURS: dict[str, Rgba] = {n: getattr(style, c) for n, c in texts("part-colours").items()}
STATE_COLOURS: dict[str, Rgba] = {n: getattr(style, c) for n, c in texts("state-colours").items()}


@dataclass(frozen=True)
class DepthPicture:
    """Depth in colours.

    Parameters
    ----------
    image : ByteArray
        (H, W, 3) RGB.
    near_m : float
        Depth at the near end of the colour scale.
    far_m : float
        Depth at the far end of the colour scale.
    ticks_m : tuple of float
        Round depths between.
    """

    image: ByteArray
    near_m: float
    far_m: float
    ticks_m: tuple[float, ...]


@lru_cache(maxsize=1)
def depth_colours() -> ByteArray:
    """Return (256, 3) RGB, near bright and far dark, with monotonic luminance for colour-blind readers."""
    ramp = np.arange(255, -1, -1, dtype=np.uint8)[:, None]
    return np.ascontiguousarray(cv2.applyColorMap(ramp, cv2.COLORMAP_CIVIDIS)[:, 0, ::-1])


def depth_picture(depth_m: Float32Array) -> DepthPicture | None:
    """Return the depth as a picture with its colours spread over its range; None without a target in view.

    Parameters
    ----------
    depth_m : Float32Array
        (H, W) camera z, NaN outside the target.
    """
    on = np.isfinite(depth_m)
    if not on.any():
        return None
    near, far = float(depth_m[on].min()), float(depth_m[on].max())
    # a flat face across the boresight gets one colour instead of amplified noise
    span = max(far - near, 1e-3 * near, 1e-3)
    image = np.empty((*depth_m.shape, 3), np.uint8)
    image[:] = OFF_RGB
    index = np.clip((depth_m[on] - near) / span * 255, 0, 255).astype(np.uint8)
    image[on] = depth_colours()[index]
    return DepthPicture(image, near, near + span, round_ticks(near, near + span))


def round_ticks(low: float, high: float, most: int = 5) -> tuple[float, ...]:
    """Return round numbers inside a span, at most ``most``."""
    step = nice_step((high - low) / 2)
    while (high - low) / step > most - 1:
        step *= 2
    first = np.ceil(low / step - 1e-9)
    last = np.floor(high / step + 1e-9)
    return tuple(float(k * step) for k in np.arange(first, last + 1))


def part_picture(frame: Frame) -> tuple[ByteArray, tuple[PartClass, ...]] | None:
    """Return the parts in the colours of their classes over the dimmed picture, and the visible classes.

    None if the frame has no parts, or none is in view.
    """
    parts = frame.layers.get("parts")
    if parts is None or frame.truth is None:
        return None
    classes = [part_class(name) for name in frame.truth.parts]
    table = np.zeros((int(parts.max(initial=0)) + 1, 4), np.uint8)
    for number, name in enumerate(classes, 1):
        if number < len(table):
            table[number] = [*(round(255 * c) for c in PART_COLOURS[name][:3]), 255]
    coloured = table[parts]
    on = coloured[..., 3] > 0
    if not on.any():
        return None
    image = dimmed(frame)
    # blend with the picture, so that edges inside a part stay visible
    light = 0.6 + 0.4 * grey(frame)[on].astype(np.float32)[:, None] / 255
    image[on] = np.clip(coloured[on][:, :3] * light, 0, 255).astype(np.uint8)
    there = {classes[k - 1] for k in np.unique(parts).tolist() if 0 < k <= len(classes)}
    return image, tuple(name for name in PART_CLASSES if name in there)


def close_up(frame: Frame) -> tuple[slice, slice]:
    """Return rows and columns around the target, with the picture's aspect ratio; all of them without a target."""
    height, width = frame.image.shape[:2]
    box = None if frame.truth is None else frame.truth.box_px
    if box is None:
        return slice(0, height), slice(0, width)
    x0, y0, x1, y1 = box
    share = max((x1 - x0) / width, (y1 - y0) / height) * CLOSE_UP_MARGIN
    share = min(max(share, CLOSE_UP_LEAST_PX / width), 1.0)
    spans = []
    for low, high, whole in ((y0, y1, height), (x0, x1, width)):
        size = min(max(round(share * whole), 1), whole)
        first = min(max(round((low + high) / 2 - size / 2), 0), whole - size)
        spans.append(slice(first, first + size))
    return spans[0], spans[1]


def grey(frame: Frame) -> ByteArray:
    """Return the (H, W) picture in eight bits of one band."""
    eight = screen_picture(frame)
    return eight if eight.ndim == 2 else np.asarray(cv2.cvtColor(eight, cv2.COLOR_RGB2GRAY), np.uint8)


def dimmed(frame: Frame) -> ByteArray:
    """Return the darkened (H, W, 3) picture, as a background."""
    return np.repeat((DIMMED * grey(frame)).astype(np.uint8)[..., None], 3, axis=2)
