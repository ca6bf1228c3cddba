"""Brightness of a target with more than 255 visible face groups, in NumPy.

The native library labels groups with bytes, which curved craft with many materials exceed. For fewer groups the result
equals the library's to rounding; the library is tested against this implementation.
"""

from __future__ import annotations

from functools import reduce
from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.image_formation import MIN_BLUR_SIGMA_PX, blur_reach

Array = np.ndarray

# Largest number of groups that fits a byte.
MAX_BYTE_LABEL = 255

# Weight of pixels beside a border in the brightness of their face.
BORDER_WEIGHT = 0.05

# Least share of a pixel that counts when brightness is fitted together with the pose.
MIN_COVERAGE = 2e-4


def shaded(faces: Faces, seen: Array, patch: ImagePatch, dark: Optional[Array]) -> Tuple[Array, ...]:
    """Estimate the brightness of each group of faces from the image, and render the view with it.

    Returns
    -------
    tuple of array
        Groups (H, W), their brightness levels (n,), the synthetic view (h, w), groups at pixel centres (h, w), areas
        (n,), mask of pixels well inside a group (h, w), share of background in each pixel (h, w) or an empty array if
        the background is uniform, and the mean of the background (1,).
    """
    f, (h, w) = patch.fine, patch.gray.shape
    n = faces.groups + 1
    group = np.take(faces.labels, seen, mode="clip")
    if dark is not None:
        group, n = _renumber_groups(group, dark, n)
    g = group.reshape(h, f, w, f)
    centre = np.ascontiguousarray(g[:, f // 2, :, f // 2])
    solid = (g[:, 0, :, 0] == centre) & (g[:, -1, :, -1] == centre)
    solid &= (g[:, 0, :, -1] == centre) & (g[:, -1, :, 0] == centre)
    # pixels beside a border show the error of the pose, not the brightness of the face
    core = cv2.erode((solid & ~_borders(centre)).view(np.uint8), np.ones((3, 3), np.uint8)).view(bool)
    mean, area = _levels(centre, solid, core, patch, n)
    level = patch.response.brightness(mean)
    picture = cv2.resize(look_up(level, group), (w, h), interpolation=cv2.INTER_AREA)
    ground = mean[:1].copy()
    _thin_levels(level, picture, group, area < 3, patch)
    empty = np.zeros((0, 0), np.float32)
    if patch.textured:
        empty = cv2.resize((group == 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
    return group, level, picture, centre, area, core, empty, ground


def with_background(patch: ImagePatch, view_data: Tuple[Array, ...], blur_px: float) -> Tuple[Array, Array]:
    """Return the background minus its level (h, w), and the synthetic view with it added.

    Parameters
    ----------
    patch : ImagePatch
        Reduced region of the image around the target.
    view_data : tuple of array
        Groups, levels, view, groups at pixel centres, pixels well inside a group, the background's share of each pixel,
        and the background's mean.
    blur_px : float
        Standard deviation of the blur, in units of 4 x 4 pixels.
    """
    _, level, picture, centre, core, empty, ground = view_data
    background_level = float(ground[0])
    own = (core & (centre == 0)).astype(np.float32)
    behind = _wide_mean(own * (patch.gray - np.float32(background_level)), own, blur_px)
    if patch.clipped > 0:
        behind = patch.response.brightness(behind + background_level).astype(np.float32) - np.float32(
            level[0]
        )
    # the background's share of each pixel is fractional at borders
    return behind, picture + empty * behind


def look_up(table: Array, labels: Array) -> Array:
    """Return the value of ``table`` (N,) at each label, float32."""
    if labels.dtype != np.uint8:
        return np.asarray(np.take(table.astype(np.float32), labels, mode="clip"))
    whole = np.zeros(256, np.float32)
    whole[: len(table)] = table[:256]
    return np.asarray(cv2.LUT(labels, whole))


def _renumber_groups(group: Array, dark: Array, n: int) -> Tuple[Array, int]:
    """Return the visible groups renumbered, lit ones before shadowed ones, and their number.

    Invisible groups are not numbered, so that a byte usually suffices, which compares fastest.
    """
    if group.dtype == np.uint8:
        shadow = dark.view(np.uint8)
        lit = np.flatnonzero(cv2.calcHist([group], [0], 1 - shadow, [256], [0, 256]))
        shaded = np.flatnonzero(cv2.calcHist([group], [0], shadow, [256], [0, 256]))
        lit = lit[lit > 0]
        if 1 + len(lit) + len(shaded) <= MAX_BYTE_LABEL:
            to = np.zeros((2, 256), np.uint8)
            to[0, lit] = 1 + np.arange(len(lit))
            to[1, shaded] = 1 + len(lit) + np.arange(len(shaded))
            out = cv2.LUT(group, to[0])
            cv2.copyTo(cv2.LUT(group, to[1]), shadow, out)
            return np.asarray(out), 1 + len(lit) + len(shaded)
    group = group.astype(np.uint16)
    group[dark] += np.uint16(n - 1)
    return group, 2 * n - 1


def _levels(centre: Array, solid: Array, core: Array, patch: ImagePatch, n: int) -> Tuple[Array, Array]:
    """Return the brightness (n,) of each group, an outlier-free mean, and its number of pixels (n,) in ``core``."""
    where = np.flatnonzero(solid | (centre > 0))
    label = centre.ravel().take(where)
    # sort by group: sums over contiguous ranges are faster than sums by label
    where = where[np.argsort(label, kind="stable")]
    number = np.bincount(label, minlength=n)
    some = np.flatnonzero(number)
    level, area = np.zeros(n), np.zeros(n, np.intp)
    if not len(some):
        return level, area
    number = number[some]
    first = np.cumsum(number) - number
    value = patch.gray.ravel().take(where).astype(float)
    inner = core.ravel().take(where)
    trust = inner + BORDER_WEIGHT * solid.ravel().take(where) + 1e-3
    weight, mean = trust, np.zeros(len(some))
    for last in (False, False, True):
        total = np.maximum(np.add.reduceat(weight, first), 1e-9)
        mean = np.add.reduceat(weight * value, first) / total
        if not last:
            deviation = np.abs(value - np.repeat(mean, number))
            spread = np.add.reduceat(weight * deviation, first) / total
            weight = trust * (deviation < np.repeat(2.5 * spread + patch.sigma, number))
    level[some], area[some] = mean, np.add.reduceat(inner, first, dtype=np.intp)
    return level, area


def coverage(shading: Shading, patch: ImagePatch, most: int, blur_px: float, rows: Array, out: Array) -> int:
    """Compute the blurred share of each pixel that the background and each of the largest groups cover.

    Parameters
    ----------
    shading : Shading
        Synthetic view.
    patch : ImagePatch
        Region of the image that the view covers.
    most : int
        Largest number of groups.
    blur_px : float
        Standard deviation of the blur.
    rows : (N,) array
        Flat indices of the pixels, ascending.
    out : (R, N) array
        Float32 zeros, R > ``most``; receives the shares above ``MIN_COVERAGE``.

    Returns
    -------
    int
        Number of groups filled in.

    Notes
    -----
    Most groups are small, so each is processed within its bounding box.
    """
    h, w = shading.centre.shape
    f = patch.fine
    # count thin groups as well, because their brightness is the least certain
    count = np.bincount(shading.centre.ravel(), minlength=len(shading.level))
    order = 1 + np.argsort(-count[1:], kind="stable")[: min(most, 62)]
    kept_groups = np.concatenate([[0], order[count[order] > 3]])
    slot = np.full(max(len(shading.level), 256), 255, np.uint8)
    slot[kept_groups] = np.arange(len(kept_groups))
    byte = shading.group.dtype == np.uint8
    slots = cv2.LUT(shading.group, slot[:256]) if byte else np.take(slot, shading.group, mode="clip")
    # one pixel beyond the blur's radius, so that border reflection at the box's edge sees empty pixels
    far = blur_reach(blur_px) + 1
    x0, y0, x1, y1 = _boxes(slots, len(kept_groups), f)
    x0, y0 = np.maximum(x0 - far, 0), np.maximum(y0 - far, 0)
    x1, y1 = np.minimum(x1 + 1 + far, w), np.minimum(y1 + 1 + far, h)
    first, last = np.searchsorted(rows, y0 * w).tolist(), np.searchsorted(rows, y1 * w).tolist()
    plane = np.zeros((h, w), np.float32)
    flat = plane.ravel()
    for k, (left, top, right, bottom) in enumerate(zip(x0.tolist(), y0.tolist(), x1.tolist(), y1.tolist())):  # noqa: B905 - 3.9
        a, b = first[k], last[k]
        if left >= right or a >= b:
            continue
        mask = (slots[top * f : bottom * f, left * f : right * f] == k).view(np.uint8)
        # exact in integers: the mean of 0 and f^2 over f x f pixels is a whole number
        share = cv2.resize(mask * np.uint8(f * f), (right - left, bottom - top), interpolation=cv2.INTER_AREA)
        own = plane[top:bottom, left:right]
        if blur_px > MIN_BLUR_SIGMA_PX:
            cv2.GaussianBlur(share.astype(np.float32), (0, 0), blur_px, dst=own)
        else:
            own[:] = share
        flat.take(rows[a:b], None, out[k, a:b], "clip")
        own[:] = 0.0
    share = out[: len(kept_groups)]
    share *= np.float32(1.0 / (f * f))
    share[share <= MIN_COVERAGE] = 0.0
    return len(kept_groups)


def _boxes(slots: Array, n: int, f: int) -> Array:
    """Return the bounding boxes (4, n) of labels 0..n - 1: x0, y0, x1, y1 [patch px of ``f`` x ``f`` rendered px].

    An absent label has x0 > x1. All boxes are computed at once: a label is a bit, and a row or column is the union of
    its bits.
    """
    kind = np.uint32 if n <= 32 else np.uint64
    place = np.arange(n, dtype=kind)
    bit = np.zeros(256, kind)
    bit[:n] = np.left_shift(kind(1), place)
    # OpenCV's table lookup is several times faster than NumPy's but has no integers of this size: reinterpret as floats
    bits = cv2.LUT(slots, bit.view(np.float32 if n <= 32 else np.float64)).view(kind)
    for _ in range(2):
        # the rows of each patch pixel, then the columns after a transposition
        bits = reduce(np.bitwise_or, [bits[k::f] for k in range(f)]).T
    out = []
    for axis in (0, 1):
        there = np.bitwise_or.reduce(bits, axis=axis)
        on = np.right_shift(there, place[:, None]) & kind(1) > 0
        some, size = on.any(axis=1), on.shape[1]
        out.append(
            (
                np.where(some, on.argmax(axis=1), 10 * size),
                np.where(some, size - 1 - on[:, ::-1].argmax(axis=1), -10 * size),
            )
        )
    return np.stack([out[0][0], out[1][0], out[0][1], out[1][1]])


def _wide_mean(value: Array, weight: Array, blur_px: float) -> Array:
    """Return the weighted mean of ``value`` within four sigma of the blur, near zero where the weight is small."""
    h, w = value.shape
    size = (max(2, w // 4), max(2, h // 4))
    num, den = (
        cv2.GaussianBlur(cv2.resize(v, size, interpolation=cv2.INTER_AREA), (0, 0), blur_px)
        for v in (value, weight)
    )
    return cv2.resize(num / (den + 0.02), (w, h), interpolation=cv2.INTER_LINEAR)


def _thin_levels(level: Array, picture: Array, group: Array, thin: Array, patch: ImagePatch) -> None:
    """Fit the brightness of groups that fill no pixel to the residual over the area that they cover.

    Parameters
    ----------
    level : (G + 1,) array
        Brightness of each group, changed in place.
    picture : (h, w) array
        Synthetic view with this brightness, changed in place.
    group : (H, W) array
        Group of each rendered pixel.
    thin : (G + 1,) array
        True for groups that fill no pixel.
    patch : ImagePatch
        Reduced region of the image around the target.
    """
    f, (h, w) = patch.fine, patch.gray.shape
    if group.dtype == np.uint8:
        marked = np.zeros(256, np.uint8)
        marked[: len(thin)] = thin
        where = np.flatnonzero(cv2.LUT(group, marked).view(bool))
    else:
        where = np.flatnonzero(np.take(thin, group, mode="clip"))
    if not len(where):
        return
    own = group.ravel()[where]
    # faster than the remainder operator
    row = where // (w * f)
    cell = (row // f) * w + (where - row * (w * f)) // f
    number = np.bincount(cell, minlength=h * w)
    # only the few pixels that hold thin groups are processed below
    cells = np.flatnonzero(number > 0)
    place = np.empty(h * w, np.intp)
    place[cells] = np.arange(len(cells))
    at = place[cell]
    n = len(level)
    coverage_sum = np.maximum(np.bincount(own, number[cell] / float(f * f), n) + 2.0, 1e-9)
    gray = patch.gray.ravel()[cells]
    drawn = picture.ravel()[cells]
    for _ in range(2):
        step = np.bincount(own, (gray - patch.response.of(drawn)[0])[at], n) / coverage_sum
        after = np.clip(level + np.where(thin, step, 0.0), 0.0, 1.5 * patch.full)
        change = np.bincount(at, (after - level)[own], len(cells)) / (f * f)
        drawn += change.astype(np.float32)
        level[:] = after
    picture.ravel()[cells] = drawn


def _borders(centre: Array) -> Array:
    """Return True for pixels whose right or lower neighbour belongs to another group."""
    out = np.zeros(centre.shape, bool)
    out[:, :-1] |= centre[:, 1:] != centre[:, :-1]
    out[:-1] |= centre[1:] != centre[:-1]
    return out


def blurred(image: Array, sigma: float) -> Array:
    """Return an image (h, w) or (h, w, channels) after a Gaussian blur, unchanged below ``MIN_BLUR_SIGMA_PX``."""
    return cv2.GaussianBlur(image, (0, 0), sigma) if sigma > MIN_BLUR_SIGMA_PX else image
