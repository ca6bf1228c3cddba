"""Motion blur of an image along its optical flow, for ground that moves during the exposure.

The flow of the ground is smooth. The average over the exposure is therefore approximated tile by tile: within a tile
the displacement is constant, and one convolution blurs the image along it.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import cv2
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray, IntArray

_STEPS_PER_PX = 6  # samples of the displacement per pixel in a kernel
_CUBIC_REACH = 2  # half of the cubic kernel's support [px]
_MAX_VARIATION_PX = 0.15  # largest difference of motion across a tile: the error is then within 0.04 px
_TILE_PX = (32, 256)  # least and largest side of a tile


def _cubic(x: FloatArray) -> FloatArray:
    """Return the weights of cubic interpolation, exact for parabolas.

    References
    ----------
    Keys (1981), Cubic convolution interpolation for digital image processing, eq. 15.
    """
    x = np.abs(x)
    near = (1.5 * x - 2.5) * x * x + 1
    far = ((-0.5 * x + 2.5) * x - 4) * x + 2
    return np.asarray(np.where(x < 1, near, np.where(x < _CUBIC_REACH, far, 0.0)))


def motion_blur_kernels(displacements_px: FloatArray) -> Float32Array:
    """Return normalised, centred kernels that blur an image uniformly along straight displacements.

    Parameters
    ----------
    displacements_px : (K, 2) array
        Displacements during the exposure, along x and y [px].

    Returns
    -------
    (K, rows, columns) array
        Odd sizes that fit the longest displacement.
    """
    count = max(int(np.ceil(_STEPS_PER_PX * np.hypot(*displacements_px.T).max())), 4)
    samples = (np.arange(count) + 0.5) / count - 0.5
    weights = []
    for displacements in displacements_px.T:
        reach = int(np.ceil(np.abs(displacements).max() / 2)) + _CUBIC_REACH - 1
        weights.append(_cubic(np.arange(-reach, reach + 1)[:, None] - displacements[:, None, None] * samples))
    kernels = weights[1] @ weights[0].transpose(0, 2, 1) / count
    return np.asarray(kernels / kernels.sum(axis=(1, 2), keepdims=True), np.float32)


def motion_blur(image: Float32Array, displacements_px: Callable[[FloatArray], FloatArray]) -> Float32Array:
    """Average an image over an exposure in which each point has its own displacement.

    Parameters
    ----------
    image : (H, W[, bands]) array
        Image at mid-exposure; its border is replicated.
    displacements_px : callable
        Function from (K, 2) pixels to their (K, 2) displacements during the exposure [px].

    Returns
    -------
    (H, W[, bands]) array
        Blurred image, float32.
    """
    height, width = image.shape[:2]
    tile = _tile_size(width, height, displacements_px)
    columns, rows = (_edges(size, step) for size, step in zip((width, height), tile, strict=True))
    u, v = np.meshgrid(*((e[:-1] + e[1:] - 1) / 2 for e in (columns, rows)))
    kernels = motion_blur_kernels(displacements_px(np.stack([u.ravel(), v.ravel()], axis=1)))
    kernels = kernels.reshape(*u.shape, *kernels.shape[1:])
    ry, rx = (side // 2 for side in kernels.shape[2:])
    out = np.empty((height, width, *image.shape[2:]), np.float32)

    # in one thread: the tiles are small, and Python's global lock would serialise most of the work
    for j, (y0, y1) in enumerate(itertools.pairwise(rows.tolist())):
        for i, (x0, x1) in enumerate(itertools.pairwise(columns.tolist())):
            top, left = max(y0 - ry, 0), max(x0 - rx, 0)
            window = image[top : y1 + ry, left : x1 + rx]
            # the margin of the kernel's reach is cropped afterwards
            blurred = cv2.filter2D(window, -1, kernels[j, i], borderType=cv2.BORDER_REPLICATE)
            y, x = y0 - top, x0 - left
            # cubic interpolation undershoots below zero next to a bright point
            np.maximum(blurred[y : y + y1 - y0, x : x + x1 - x0], 0, out=out[y0:y1, x0:x1])
    return out


def _tile_size(
    width: int, height: int, displacements_px: Callable[[FloatArray], FloatArray], nodes: int = 9
) -> tuple[int, int]:
    """Return sizes of tiles within which displacements are nearly constant [px]."""
    x, y = np.linspace(0, width - 1, nodes), np.linspace(0, height - 1, nodes)
    u, v = np.meshgrid(x, y)
    displacements = displacements_px(np.stack([u.ravel(), v.ravel()], axis=1)).reshape(nodes, nodes, 2)
    sides = []
    for axis, step in ((1, (width - 1) / (nodes - 1)), (0, (height - 1) / (nodes - 1))):
        steepest = float(np.abs(np.diff(displacements, axis=axis)).max()) / max(step, 1e-9)
        sides.append(int(np.clip(_MAX_VARIATION_PX / max(steepest, 1e-9), *_TILE_PX)))
    return sides[0], sides[1]


def _edges(size: int, step: int) -> IntArray:
    """Return edges of nearly equal tiles, at whole pixels."""
    return np.rint(np.linspace(0, size, -(-size // step) + 1)).astype(np.int64)
