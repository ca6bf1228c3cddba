"""Brightness of the craft's faces, taken from the picture itself, and the picture drawn with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import cv2
import numpy as np

from hil.board.svd.shade import Canvas, Faces

Array = np.ndarray

# Blur of the optics [picture px], reach of the background's local brightness [canvas px].
OPTICS_PX, LOCAL_PX = 1.0, 8.0

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
    seen : (H, W) face + 1 per drawn pixel. group : (H, W) brightness group + 1; where shadows are cast, groups in
        shadow follow those in light.
    level : (G + 1,) brightness of each group, the background first.
    picture : (h, w) what it looks like on the canvas, not blurred.
    centre : (h, w) group at a pixel's middle. area : (G + 1,) pixels well inside each group.
    behind : (h, w) what the background differs from its level by; None where it is empty space.
    """

    seen: Array
    group: Array
    level: Array
    picture: Array
    centre: Array
    area: Array
    behind: Optional[Array]

    def brightness(self, group: Array, cell: Array) -> Array:
        """(N,) of groups (N,) at canvas pixels ``cell`` (N,), flat indices."""
        level = self.level[group]
        if self.behind is None:
            return np.asarray(level)
        return np.asarray(level + np.where(group == 0, self.behind.ravel()[cell], 0.0))


def shade(faces: Faces, seen: Array, canvas: Canvas, dark: Optional[Array] = None) -> Shading:
    """Brightness of each face group from the picture, and the picture drawn with it.

    Parameters
    ----------
    seen : drawn by ``draw_faces``. dark : (H, W) drawn pixels on which another face casts its shadow.
    """
    f, (h, w) = canvas.fine, canvas.gray.shape
    # numbers of the kind that numpy indexes with: it would convert others at each look-up
    of = np.concatenate([[0], faces.group + 1]).astype(np.intp)
    group = np.take(of, seen, mode="clip")
    n = faces.groups + 1
    if dark is not None:
        group[dark] += faces.groups
        n += faces.groups
    g = group.reshape(h, f, w, f)
    centre = np.ascontiguousarray(g[:, f // 2, :, f // 2])
    solid = (g[:, 0, :, 0] == centre) & (g[:, -1, :, -1] == centre)
    solid &= (g[:, 0, :, -1] == centre) & (g[:, -1, :, 0] == centre)
    gray = canvas.gray
    # pixels beside a border show how far the pose is off, not how bright the face is
    core = cv2.erode((solid & ~_borders(centre)).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    where = np.flatnonzero(solid | (centre > 0))
    flat, value = centre.ravel().take(where), gray.ravel().take(where).astype(float)
    inner = core.ravel().take(where)
    trust = inner + BESIDE * solid.ravel().take(where) + 1e-3
    weight, level = trust, np.zeros(n)
    for last in (False, False, True):
        total = np.maximum(np.bincount(flat, weight, n), 1e-9)
        level = np.bincount(flat, weight * value, n) / total
        if not last:
            away = np.abs(value - level.take(flat))
            spread = np.bincount(flat, weight * away, n) / total
            weight = trust * (away < (2.5 * spread + canvas.sigma).take(flat))
    area = np.bincount(flat[inner], minlength=n)
    fine = np.take(level.astype(np.float32), group, mode="clip")
    picture = cv2.resize(fine, (w, h), interpolation=cv2.INTER_AREA)
    _thin_levels(level, picture, group, area < 3, canvas)
    for k in 1 + np.argsort(-area[1:])[:SATURATED]:
        if area[k] >= 60 and level[k] > 0.97 * canvas.full:
            part = cv2.resize((group == k).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
            over = _overexposed(picture, part, canvas)
            level[k] += over
            picture = picture + np.float32(over) * part
    behind = None
    if np.ndim(canvas.plain):
        own = (core & (centre == 0)).astype(np.float32)
        behind = _wide_mean(own * (gray - np.float32(level[0])), own)
        # the background's share of each pixel, of which the border pixels have a part
        part = cv2.resize((group == 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
        picture = picture + part * behind
    return Shading(seen, group, level, picture, centre, area, behind)


def coverage(shading: Shading, canvas: Canvas, most: int, blur_px: float, rows: Array, out: Array) -> int:
    """Share of each pixel that the background and each of the ``most`` largest groups cover, blurred.

    Parameters
    ----------
    blur_px : standard deviation. rows : (N,) flat indices of the pixels that are asked for, ascending.
    out : (most + 1 or more, N) float32, zero; receives the shares.

    Returns
    -------
    Number of groups filled in.

    Notes
    -----
    Most groups are small: each is looked at within its own box.
    """
    h, w = shading.centre.shape
    f = canvas.fine
    # thin ones too: their brightness is known least of all
    count = np.bincount(shading.centre.ravel(), minlength=len(shading.level))
    order = 1 + np.argsort(-count[1:])[:most]
    chosen = np.concatenate([[0], order[count[order] > 3]])
    slot = np.full(len(shading.level), 255, np.uint8)
    slot[chosen] = np.arange(len(chosen))
    slots = np.take(slot, shading.group, mode="clip")
    # one more than the blur reaches: what it mirrors at the box's edge is empty then
    reach = _radius(blur_px) + 1
    plane = np.zeros((h, w), np.float32)
    for k in range(len(chosen)):
        mask = (slots == k).view(np.uint8)
        x, y, wide, high = cv2.boundingRect(mask)
        if not wide:
            continue
        x0, x1 = max(x // f - reach, 0), min((x + wide - 1) // f + 1 + reach, w)
        y0, y1 = max(y // f - reach, 0), min((y + high - 1) // f + 1 + reach, h)
        # a mean of 0 and f^2 over f x f pixels is a whole number
        count = mask[y0 * f : y1 * f, x0 * f : x1 * f] * np.uint8(f * f)
        share = cv2.resize(count, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA).astype(np.float32)
        plane[y0:y1, x0:x1] = blurred(share, blur_px)
        a, b = np.searchsorted(rows, (y0 * w, y1 * w))
        np.take(plane.ravel(), rows[a:b], out=out[k, a:b], mode="clip")
        plane[y0:y1, x0:x1] = 0.0
    out[: len(chosen)] *= np.float32(1.0 / (f * f))
    return len(chosen)


def _radius(sigma: float) -> int:
    """How far OpenCV's Gaussian of this width reaches in a float picture."""
    return (int(np.rint(8 * sigma + 1)) | 1) // 2 if sigma > 0.2 else 0


def _wide_mean(value: Array, weight: Array) -> Array:
    """Mean of ``value`` over ``weight`` within about ``LOCAL_PX``, towards zero where there is little of it."""
    h, w = value.shape
    size = (max(2, w // 4), max(2, h // 4))
    num, den = (
        cv2.GaussianBlur(cv2.resize(v, size, interpolation=cv2.INTER_AREA), (0, 0), LOCAL_PX / 4)
        for v in (value, weight)
    )
    return cv2.resize(num / (den + 0.02), (w, h), interpolation=cv2.INTER_LINEAR)


def _thin_levels(level: Array, picture: Array, group: Array, thin: Array, canvas: Canvas) -> None:
    """Brightness of groups that fill no pixel: what is left of the picture there, over what they cover.

    Parameters
    ----------
    level : (G + 1,) and picture : (h, w) drawn with it, both changed in place.
    """
    f, (h, w) = canvas.fine, canvas.gray.shape
    where = np.flatnonzero(np.take(thin, group, mode="clip"))
    if not len(where):
        return
    own = group.ravel()[where]
    cell = (where // (w * f * f)) * w + (where % (w * f)) // f
    cover = np.bincount(cell, minlength=h * w)[cell] / float(f * f)
    n = len(level)
    covered = np.maximum(np.bincount(own, cover, n) + 2.0, 1e-9)
    gray = canvas.gray.ravel()[cell]
    drawn = picture.ravel()
    for _ in range(2):
        step = np.bincount(own, gray - drawn[cell], n) / covered
        after = np.clip(level + np.where(thin, step, 0.0), 0.0, 1.5 * canvas.full)
        change = np.bincount(cell, (after - level)[own], h * w) / (f * f)
        drawn += change.astype(np.float32)
        level[:] = after


def _overexposed(picture: Array, part: Array, canvas: Canvas) -> float:
    """How far a saturated face's true brightness lies above the scale: blur carries it over its border."""
    optics = OPTICS_PX / canvas.factor
    base, own = blurred(picture, optics), blurred(part, optics)
    ring = (own > 0.02) & (own < 0.98)
    if int(ring.sum()) < 10:
        return 0.0
    base, own, gray = base[ring], own[ring], canvas.gray[ring]
    costs = [
        float(np.abs(np.minimum(base + over * own, canvas.full) - gray).sum()) for over in OVER * canvas.full
    ]
    return float(OVER[int(np.argmin(costs))] * canvas.full)


def _borders(centre: Array) -> Array:
    """Pixels whose right or lower neighbour belongs to another group."""
    out = np.zeros(centre.shape, bool)
    out[:, :-1] |= centre[:, 1:] != centre[:, :-1]
    out[:-1] |= centre[1:] != centre[:-1]
    return out


def blurred(image: Array, sigma: float) -> Array:
    """The image (h, w) or (h, w, channels) through a Gaussian, as it is where that is narrower than a pixel."""
    return cv2.GaussianBlur(image, (0, 0), sigma) if sigma > 0.2 else image
