"""The kernels of the native library in NumPy, an implementation of its own that the library is compared with.

It also takes views with more than 255 groups of faces.
"""

from __future__ import annotations

from functools import reduce

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.response import (
    STEPS_PER_SIGMA,
    TABLE_SIGMAS,
    Response,
    means,
    tables,
)
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.image_formation import MIN_BLUR_SIGMA_PX, blur_reach, blurred
from flyaround.hil.board.hybrid.refine.photometric import bounded

Array = np.ndarray

# Least change of a pixel by a shift of one patch pixel [noise]: pixels below hold less than a thousandth of the
# information and are left out of a step.
MIN_CHANGE = 0.02

# Weight of pixels beside a border in the brightness of their face.
BESIDE = 0.05

# Least share of a pixel that counts when brightness is fitted together with the pose.
LITTLE = 2e-4


def unclipped_share(response: Response, x: Array) -> Array:
    """Return the derivative of the mean pixel value by brightness, the share of pixels whose noise is not clipped."""
    _, share = tables()
    step = STEPS_PER_SIGMA / response.sigma
    low = np.rint(x * np.float32(step) + np.float32(TABLE_SIGMAS * STEPS_PER_SIGMA)).astype(np.intp)
    high = low - round(response.full_scale * step)
    return share.take(low, mode="clip") - share.take(high, mode="clip")


def brightness(response: Response, mean: Array) -> Array:
    """Return the brightness that has this mean, between ``-TABLE_SIGMAS * sigma`` and ``full_scale``."""
    if response.sigma <= 0:
        return mean
    x, below = (response.sigma * table for table in means())
    out = np.where(mean < below[-1], np.interp(mean, below, x), mean)
    top = response.full_scale - below[-1]
    return np.where(mean > top, response.full_scale - np.interp(response.full_scale - mean, below, x), out)


def group_brightness(shading: Shading, group: Array, cell: Array) -> Array:
    """Return the brightness (N,) of groups (N,) at the flat patch indices ``cell`` (N,)."""
    level = shading.level.take(group, mode="clip")
    if shading.background_offset is not None:
        background = np.flatnonzero(group == 0)
        level[background] += shading.background_offset.ravel().take(cell.take(background))
    return level


def shaded(faces: Faces, seen: Array, patch: ImagePatch, dark: Array | None) -> tuple[Array, ...]:
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
        group[dark] += np.uint16(n - 1)
        n = 2 * n - 1
    g = group.reshape(h, f, w, f)
    centre = np.ascontiguousarray(g[:, f // 2, :, f // 2])
    solid = (g[:, 0, :, 0] == centre) & (g[:, -1, :, -1] == centre)
    solid &= (g[:, 0, :, -1] == centre) & (g[:, -1, :, 0] == centre)
    # pixels beside a border show the error of the pose, not the brightness of the face
    core = cv2.erode((solid & ~_borders(centre)).view(np.uint8), np.ones((3, 3), np.uint8)).view(bool)
    mean, area = _levels(centre, solid, core, patch, n)
    level = brightness(patch.response, mean)
    picture = cv2.resize(look_up(level, group), (w, h), interpolation=cv2.INTER_AREA)
    ground = mean[:1].copy()
    _thin_levels(level, picture, group, area < 3, patch)
    empty = np.zeros((0, 0), np.float32)
    if patch.textured:
        empty = cv2.resize((group == 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
    return group, level, picture, centre, area, core, empty, ground


def with_background(patch: ImagePatch, made: tuple[Array, ...], blur_px: float) -> tuple[Array, Array]:
    """Return the background minus its level (h, w), and the synthetic view with it added.

    Parameters
    ----------
    patch : ImagePatch
        Reduced region of the image around the target.
    made : tuple of array
        Groups, levels, view, groups at pixel centres, pixels well inside a group, the background's share of each pixel,
        and the background's mean.
    blur_px : float
        Standard deviation of the blur, in units of 4 x 4 pixels.
    """
    _, level, picture, centre, core, empty, ground = made
    shown = float(ground[0])
    own = (core & (centre == 0)).astype(np.float32)
    behind = _wide_mean(own * (patch.gray - np.float32(shown)), own, blur_px)
    if patch.clipped > 0:
        behind = brightness(patch.response, behind + shown).astype(np.float32) - np.float32(level[0])
    # the background's share of each pixel is fractional at borders
    return behind, picture + empty * behind


def look_up(table: Array, labels: Array) -> Array:
    """Return the value of ``table`` (N,) at each label, float32."""
    return np.asarray(np.take(table.astype(np.float32), labels, mode="clip"))


def _levels(centre: Array, solid: Array, core: Array, patch: ImagePatch, n: int) -> tuple[Array, Array]:
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
    trust = inner + BESIDE * solid.ravel().take(where) + 1e-3
    weight, mean = trust, np.zeros(len(some))
    for last in (False, False, True):
        total = np.maximum(np.add.reduceat(weight, first), 1e-9)
        mean = np.add.reduceat(weight * value, first) / total
        if not last:
            away = np.abs(value - np.repeat(mean, number))
            spread = np.add.reduceat(weight * away, first) / total
            weight = trust * (away < np.repeat(2.5 * spread + patch.sigma, number))
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
        Float32 zeros, R > ``most``; receives the shares above ``LITTLE``.

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
    chosen = np.concatenate([[0], order[count[order] > 3]])
    slot = np.full(max(len(shading.level), 256), 255, np.uint8)
    slot[chosen] = np.arange(len(chosen))
    slots = np.take(slot, shading.group, mode="clip")
    # one pixel beyond the blur's radius, so that border reflection at the box's edge sees empty pixels
    far = blur_reach(blur_px) + 1
    x0, y0, x1, y1 = _boxes(slots, len(chosen), f)
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
    share = out[: len(chosen)]
    share *= np.float32(1.0 / (f * f))
    share[share <= LITTLE] = 0.0
    return len(chosen)


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
    covered = np.maximum(np.bincount(own, number[cell] / float(f * f), n) + 2.0, 1e-9)
    gray = patch.gray.ravel()[cells]
    drawn = picture.ravel()[cells]
    for _ in range(2):
        step = np.bincount(own, (gray - patch.response.mean(drawn))[at], n) / covered
        after = np.clip(level + np.where(thin, step, 0.0), 0.0, 1.5 * patch.full_scale)
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


def motion_images(
    shading: Shading, faces: Faces, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> Array:
    """Return the derivative (6, h, w) of the synthetic view by rotation about the target's origin and translation.

    See ``motion_images.motion_images``.
    """
    h, w = patch.gray.shape
    f = patch.fine
    wide = w * f
    g, ids = shading.group, shading.visible_face
    borders = np.zeros(g.shape, bool)
    np.not_equal(g[:, 1:], g[:, :-1], out=borders[:, :-1])
    right = np.flatnonzero(borders)
    down = np.flatnonzero(g[1:] != g[:-1])
    if not len(right) + len(down):
        return np.zeros((6, h, w), np.float32)
    here = np.concatenate([right, down])
    there = np.concatenate([right + 1, down + wide])
    across = np.arange(len(here)) < len(right)
    u, v = patch.rays(camera)
    # the remainder operator is ten times slower
    y = here // wide
    x = here - y * wide
    step_u, step_v = u[1] - u[0], v[1] - v[0]
    rx = (u[x] + 0.5 * step_u * across).astype(np.float32)
    ry = (v[y] + 0.5 * step_v * ~across).astype(np.float32)
    # inverse depth of a plane n.X = d along a ray is n.ray / d; the background has none
    n_c = faces.normals @ R.T
    near = np.zeros((3, len(n_c) + 1), np.float32)
    d_c = faces.offset + n_c @ t
    near[:, 1:] = n_c.T / np.where(np.abs(d_c) > 1e-6, d_c, np.inf)
    flat_ids = ids.ravel()
    na, nb = (np.take(near, np.take(flat_ids, at), axis=1, mode="clip") for at in (here, there))
    inverse = np.maximum(na[0] * rx + na[1] * ry + na[2], nb[0] * rx + nb[1] * ry + nb[2])
    # faces seen from the edge have no depth that can be trusted
    ok = (inverse > 0.2 / t[2]) & (inverse < 5.0 / t[2])
    inverse = np.where(ok, inverse, np.float32(1.0 / t[2]))
    tx, ty, tz = (np.float32(c) for c in t)
    X, Y, Z = rx / inverse - tx, ry / inverse - ty, 1 / inverse - tz
    flat_g = g.ravel()
    # few rows and columns: each is divided once
    cell = (np.arange(h * f) // f * w).take(y) + (np.arange(wide) // f).take(x)
    change = group_brightness(shading, flat_g[here], cell) - group_brightness(shading, flat_g[there], cell)
    k = (change * ok * inverse * np.where(across, 1.0 / (step_u * f * f), 1.0 / (step_v * f * f))).astype(
        np.float32
    )
    # slope of the picture's coordinate by the point: (1, 0, -rx) across, (0, 1, -ry) down, over the depth
    n, own = len(right), np.where(across, rx, ry)
    turn_x, turn_y = -own * Y, own * X
    turn_x[n:] -= Z[n:]
    turn_y[:n] += Z[:n]
    # a border along the side of a patch pixel lies half in the next one: counted in one alone it would bias the pose
    # by a quarter of a pixel
    last = np.arange(max(wide, h * f)) % f == f - 1
    shared = np.flatnonzero(last.take(np.where(across, x, y)))
    k[shared] *= np.float32(0.5)
    cell = np.concatenate([cell, cell[shared] + np.where(across[shared], 1, w)])
    each = np.concatenate([np.arange(len(k)), shared])
    out = np.empty((6, h * w), np.float32)
    # a shift along a border does not move it
    for j, slope in enumerate((turn_x, turn_y, np.where(across, -Y, X), across, ~across, -own)):
        out[j] = np.bincount(cell, (slope * k)[each], h * w)
    return out.reshape(6, h, w)


def gram(
    shading: Shading,
    faces: Faces,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    blurs_px: tuple[float, float, float],
    noise: float,
    slack: float,
    tukey: float,
    joint: int,
) -> tuple[Array, float, int]:
    """Return the products (K + 7, K + 7) of a step's weighted rows, the sum of weights, and the number of pixels.

    See ``photometric._gram``.
    """
    lens, blur, optics = blurs_px
    sharp = blurred(shading.picture, lens)
    drawn = blurred(patch.response.mean(sharp), blur)
    e = patch.blurred(blur) - drawn
    D = [blurred(plane, optics) for plane in motion_images(shading, faces, patch, camera, R, t)]
    across, down = patch.scale
    least = MIN_CHANGE * noise / (max(abs(float(t[2])), 1e-9) * patch.fine)
    use = (np.abs(D[3]) > least * across * camera.fx_px) | (np.abs(D[4]) > least * down * camera.fy_px)
    rows, w = _weights(e, drawn, use, shading.centre > 0, noise, slack, tukey)
    A = np.zeros((joint + 8, len(rows)), np.float32)
    k = coverage(shading, patch, joint, optics, rows, A)
    for j, x in enumerate((*D, e)):
        x.ravel().take(rows, out=A[k + j], mode="clip")
    A = A[: k + 7]
    if patch.response.sigma > 0:
        A[:-1] *= blurred(unclipped_share(patch.response, sharp), blur).ravel().take(rows)
    A *= np.sqrt(w)
    return (A @ A.T).astype(float), float(w.sum()), len(rows)


def _weights(
    e: Array, drawn: Array, use: Array, craft: Array, noise: float, slack: float, tukey: float
) -> tuple[Array, Array]:
    """Return the flat indices (N,) of the residuals with a weight, and the weights (N,), float32.

    Weights follow from the noise, the squared distance by which borders may still be off, and Tukey's bound.
    """
    gx = cv2.Sobel(drawn, cv2.CV_32F, 1, 0, scale=0.125)
    gy = cv2.Sobel(drawn, cv2.CV_32F, 0, 1, scale=0.125)
    rows = np.flatnonzero(use)
    craft = craft.ravel().take(rows)
    gx, gy, e = (a.ravel().take(rows) for a in (gx, gy, e))
    slope = np.float32(slack) * (gx * gx + gy * gy)
    flat = slope < noise**2
    spread = []
    for part in (~craft, craft):
        sample = np.abs(e[part & flat])[::2]
        middle = float(np.partition(sample, len(sample) // 2)[len(sample) // 2]) if len(sample) else 0.0
        spread.append(max(1.4826 * middle, noise) ** 2)
    variance = np.array(spread, np.float32).take(craft.view(np.uint8)) + slope
    weight = np.clip(1 - e * e / (np.float32(tukey) * variance), 0, None) ** 2 / variance
    counts = np.flatnonzero(weight)
    return rows.take(counts), weight.take(counts)


def unexplained(
    shading: Shading,
    patch: ImagePatch,
    noise: float,
    none: Array,
    blurs_px: tuple[float, float, float],
    bound: float,
    covered: float,
) -> float:
    """Return the sum of bounded squared residuals of a synthetic view; see ``photometric._unexplained``."""
    lens, blur, cover_blur = blurs_px
    drawn = patch.response.mean(blurred(shading.picture, lens))
    e = (patch.blurred(blur) - blurred(drawn, blur)) / noise
    if patch.textured:
        # clutter beside the craft counts the same for every pose
        h, w = e.shape
        cover = cv2.resize((shading.group > 0).astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)
        e = np.where(blurred(cover, cover_blur) > covered, e, none)
    return bounded(e, bound)
