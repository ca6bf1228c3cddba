"""Brightness of the craft's faces, taken from the picture itself, and the picture drawn with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List

import cv2
import numpy as np

from hil.board.svd.shade import Canvas, Faces

Array = np.ndarray

# Blur of the optics [picture px], reach of a face's local brightness [canvas px], faces that have one.
OPTICS_PX, LOCAL_PX, LOCAL_FACES = 1.0, 8.0, 8

# Largest faces that are looked at for saturation.
SATURATED = 4

# What a pixel beside a border counts for its face's brightness.
BESIDE = 0.05

# Brightness of a saturated face above the scale, in scales, that is tried.
OVER = np.array([0.0, 0.15, 0.35, 0.6, 1.0, 1.6, 2.4, 3.5])


@dataclass(frozen=True, eq=False)
class Shading:
    """The drawn craft with the brightness that the picture gives it.

    Parameters
    ----------
    seen : (H, W) triangle + 1 per drawn pixel. group : (H, W) brightness group + 1.
    level : (G + 1,) mean brightness of each group, the background first.
    picture : (h, w) what it looks like on the canvas, not blurred.
    solid : (h, w) whether a pixel lies within one group. centre : (h, w) group at its middle.
    local_of : (G + 1,) number of a group's own map, -1 none. local : (L, h, w) difference to its mean.
    """

    seen: Array
    group: Array
    level: Array
    picture: Array
    solid: Array
    centre: Array
    local_of: Array
    local: Array


def shade(faces: Faces, seen: Array, canvas: Canvas, local_faces: int = LOCAL_FACES) -> Shading:
    """Brightness of each face group from the picture, and the picture drawn with it.

    Parameters
    ----------
    seen : drawn by ``draw_faces``. local_faces : how many of the largest have a brightness that varies.
    """
    f, (h, w) = canvas.fine, canvas.gray.shape
    of = np.concatenate([[0], faces.group + 1]).astype(np.int32)
    group = of[seen]
    g = group.reshape(h, f, w, f)
    centre = np.ascontiguousarray(g[:, f // 2, :, f // 2])
    solid = (g[:, 0, :, 0] == centre) & (g[:, -1, :, -1] == centre) & (g[:, 0, :, -1] == centre)
    solid &= g[:, -1, :, 0] == centre
    n = faces.groups + 1
    gray = canvas.gray
    # pixels beside a border show how far the pose is off, not how bright the face is
    core = cv2.erode((solid & ~_borders(centre)).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    flat, trust = centre.ravel(), core.ravel() + BESIDE * solid.ravel() + 1e-3
    weight = trust
    level = np.zeros(n)
    for _ in range(3):
        total = np.bincount(flat, weight, n)
        level = np.bincount(flat, weight * gray.ravel(), n) / np.maximum(total, 1e-9)
        away = np.abs(gray.ravel() - level[flat])
        spread = np.bincount(flat, weight * away, n) / np.maximum(total, 1e-9)
        weight = trust * (away < 2.5 * spread[flat] + canvas.sigma)
    area = np.bincount(flat[core.ravel()], minlength=n)
    _thin_levels(level, group, area < 3, canvas)
    picture = cv2.resize(level.astype(np.float32)[group], (w, h), interpolation=cv2.INTER_AREA)
    chosen = [0, *(1 + np.argsort(-area[1:])[: max(local_faces, SATURATED)]).tolist()]
    local_of = np.full(n, -1)
    local: List[Array] = []
    for k in chosen:
        if area[k] < 60:
            continue
        part = cv2.resize((group == k).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
        if level[k] > 0.97 * canvas.full:
            over = _overexposed(picture, part, canvas)
            level[k] += over
            picture = picture + np.float32(over) * part
            continue
        if k and len(local) > local_faces:
            continue
        own = (core & (centre == k)).astype(np.float32)
        field = _wide_mean(own * (gray - np.float32(level[k])), own)
        local_of[k] = len(local)
        local.append(field)
        picture = picture + part * field
    return Shading(seen, group, level, picture, solid, centre, local_of, np.array(local))


def coverage(shading: Shading, canvas: Canvas, most: int) -> Array:
    """(K, h, w) share of each pixel that the background and each of the ``most`` largest groups cover."""
    f, (h, w) = canvas.fine, canvas.gray.shape
    count = np.bincount(shading.centre.ravel(), minlength=len(shading.level))
    count[0] += 10**9
    chosen = np.argsort(-count)[: most + 1]
    chosen = chosen[count[chosen] > 3]
    slot = np.full(len(shading.level), len(chosen))
    slot[chosen] = np.arange(len(chosen))
    cell = np.arange(h * w, dtype=np.intp).reshape(h, w)
    index = slot.astype(np.intp)[shading.group] * (h * w) + np.repeat(np.repeat(cell, f, axis=0), f, axis=1)
    total = np.bincount(index.ravel(), minlength=(len(chosen) + 1) * h * w)
    return (total[: len(chosen) * h * w].reshape(-1, h, w) / (f * f)).astype(np.float32)


def _wide_mean(value: Array, weight: Array) -> Array:
    """Mean of ``value`` over ``weight`` within about ``LOCAL_PX``, towards zero where there is little of it."""
    h, w = value.shape
    size = (max(2, w // 4), max(2, h // 4))
    num, den = (
        cv2.GaussianBlur(cv2.resize(v, size, interpolation=cv2.INTER_AREA), (0, 0), LOCAL_PX / 4)
        for v in (value, weight)
    )
    return cv2.resize(num / (den + 0.02), (w, h), interpolation=cv2.INTER_LINEAR)


def _thin_levels(level: Array, group: Array, thin: Array, canvas: Canvas) -> None:
    """Brightness of groups that fill no pixel: what is left of the picture there, over what they cover."""
    f, (h, w) = canvas.fine, canvas.gray.shape
    where = np.flatnonzero(thin[group.ravel()])
    if not len(where):
        return
    own = group.ravel()[where]
    cell = (where // (w * f * f)) * w + (where % (w * f)) // f
    for _ in range(2):
        drawn = cv2.resize(level.astype(np.float32)[group], (w, h), interpolation=cv2.INTER_AREA)
        left = (canvas.gray - drawn).ravel()[cell]
        cover = np.bincount(cell, minlength=h * w)[cell] / float(f * f)
        n = len(level)
        step = np.bincount(own, left, n) / np.maximum(np.bincount(own, cover, n) + 2.0, 1e-9)
        level[:] = np.clip(level + np.where(thin, step, 0.0), 0.0, 1.5 * canvas.full)


def _overexposed(picture: Array, part: Array, canvas: Canvas) -> float:
    """How far a saturated face's true brightness lies above the scale: blur carries it over its border."""
    optics = OPTICS_PX / canvas.factor
    base, own = blurred(picture, optics), blurred(part, optics)
    ring = (own > 0.02) & (own < 0.98)
    if int(ring.sum()) < 10:
        return 0.0
    costs = [
        float(np.abs(np.minimum(base[ring] + over * own[ring], canvas.full) - canvas.gray[ring]).sum())
        for over in OVER * canvas.full
    ]
    return float(OVER[int(np.argmin(costs))] * canvas.full)


def _borders(centre: Array) -> Array:
    """Pixels whose right or lower neighbour belongs to another group."""
    out = np.zeros(centre.shape, bool)
    out[:, :-1] |= centre[:, 1:] != centre[:, :-1]
    out[:-1] |= centre[1:] != centre[:-1]
    return out


def blurred(image: Array, sigma: float) -> Array:
    """The image through a Gaussian, as it is where that is narrower than a pixel."""
    return cv2.GaussianBlur(image, (0, 0), sigma) if sigma > 0.2 else image
