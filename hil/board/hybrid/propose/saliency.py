"""Saliency of the target in front of a textured background: a small network on local texture measures.

No single measure separates a spacecraft from a cloudy Earth. Brightness, edge strength, straightness and long segments
at several scales do so together, weighted by two layers trained on rendered images.
"""

from __future__ import annotations

import io
import pkgutil
from dataclasses import dataclass
from functools import lru_cache
from typing import BinaryIO, List, Optional, Tuple, Union

import cv2
import numpy as np

from flyaround.hil.board.hybrid.image.edge_field import gradient, gradient_noise
from flyaround.hil.board.hybrid.image.line_segments import lsd_stream
from flyaround.hil.board.svd.region_of_interest import Box, overlap

Array = np.ndarray

# Side of a cell [px of the reduced image], and scales of the measures [cells].
CELL_PX = 2
SCALES_CELLS = (3, 7, 15, 31)

# Shortest straight segment that counts [px].
SEGMENT_PX = 5.0

# Cells processed at once.
BLOCK_CELLS = 4096

# Lengths that part short, medium and long segments, largest length that weighs, and neighbourhood in which segments
# cross [cells]; the weights were trained with them.
SHORT_CELLS, MAX_WEIGHT_CELLS, CROSSING_CELLS = (6, 14), 20.0, (11, 11)

WEIGHTS = "saliency.npz"


@dataclass(frozen=True, eq=False)
class SaliencyWeights:
    """Network weights of two layers: mean and scale of the measures (F,), then (F, H), (H,), (H,), bias."""

    mean: Array
    scale: Array
    first: Array
    first_bias: Array
    second: Array
    second_bias: float

    @staticmethod
    def read(file: Union[str, BinaryIO]) -> SaliencyWeights:
        """Read the weights from an ``.npz`` file."""
        with np.load(file) as f:
            return SaliencyWeights(
                f["mean"],
                f["scale"],
                f["first"].astype(np.float32),
                f["first_bias"],
                f["second"],
                float(f["second_bias"]),
            )


@lru_cache(maxsize=1)
def shipped_weights() -> Optional[SaliencyWeights]:
    """Return the shipped weights; None if the installation lacks them."""
    # a bundle is a zip file, so its members are read through the importer
    data = pkgutil.get_data("flyaround.hil.board.hybrid.propose", WEIGHTS)
    return None if data is None else SaliencyWeights.read(io.BytesIO(data))


def measures(
    small: Array,
    noise: float,
    segments: Optional[Array] = None,
    slopes: Optional[Tuple[Array, Array]] = None,
) -> Array:
    """Return the texture measures of each cell of an image.

    Parameters
    ----------
    small : (H, W) array
        Reduced image, float32.
    noise : float
        Standard deviation of its noise.
    segments : (N, 4) array, optional
        Result of ``straight_segments``, if known.
    slopes : tuple of array, optional
        Gradient of the image, if known.

    Returns
    -------
    (h, w, F) array
        Measures of cells of ``CELL_PX`` pixels a side, float32: each texture layer and its means over ``SCALES_CELLS``,
        then the standard deviations of the brightness over the same scales.
    """
    top = max(float(np.percentile(small[::4, ::4], 99.5)), 8.0 * noise)
    level = np.sqrt(np.clip(small / top, 0.0, 1.5))
    gx, gy = slopes or gradient(small, 1.0)
    sigma = noise * gradient_noise(1.0)
    steep = cv2.magnitude(gx, gy)
    # strength in units of the noise, independent of exposure and contrast
    strength = cv2.log(np.maximum(steep * np.float32(1.0 / sigma) - np.float32(2.0), np.float32(1.0)))
    local = cv2.GaussianBlur(small, (0, 0), 3.0) + 3.0 * noise + 0.02 * top
    relative = np.minimum(steep / local, 2.0)
    h, w = small.shape[0] // CELL_PX, small.shape[1] // CELL_PX
    dark = cv2.erode(level, np.ones((3, 3), np.uint8))
    layers = [_cells(v, w, h) for v in (level, strength, relative, dark)]
    layers += [
        _straightness(gx, gy, sigma, w, h),
        *_segments(straight_segments(small) if segments is None else segments, w, h),
    ]
    out = np.empty((len(layers) * (1 + len(SCALES_CELLS)) + len(SCALES_CELLS), h, w), np.float32)
    k = 0
    for layer in layers:
        out[k] = layer
        for j, r in enumerate(SCALES_CELLS):
            cv2.blur(out[k], (r, r), dst=out[k + 1 + j])
        k += 1 + len(SCALES_CELLS)
    for j, r in enumerate(SCALES_CELLS):
        mean = out[1 + j]
        out[k + j] = np.sqrt(np.maximum(cv2.blur(layers[0] ** 2, (r, r)) - mean * mean, 0.0))
    return np.moveaxis(out, 0, -1)


def _cells(layer: Array, w: int, h: int) -> Array:
    return cv2.resize(layer.astype(np.float32), (w, h), interpolation=cv2.INTER_AREA)


def _straightness(gx: Array, gy: Array, sigma: float, w: int, h: int) -> Array:
    """Return the coherence of the gradient around a cell: 1 along a straight edge, 0 in texture."""
    xx, yy = gx * gx, gy * gy
    energy = xx + yy
    weight = np.minimum(energy, (20 * sigma) ** 2)
    scale = weight / np.maximum(energy, 1e-12)
    c, s, total = (
        cv2.blur(_cells(v, w, h), (5, 5)) for v in ((xx - yy) * scale, 2 * gx * gy * scale, weight)
    )
    return np.asarray(np.hypot(c, s) / (total + (3 * sigma) ** 2))


def straight_segments(small: Array) -> Array:
    """Return the straight segments (N, 4) of the reduced image, at least ``SEGMENT_PX`` long."""
    return lsd_stream(cv2.GaussianBlur(small, (0, 0), 0.8), SEGMENT_PX)


def _segments(segments: Array, w: int, h: int) -> List[Array]:
    """Return the length of short, medium and long segments per cell, and a measure of their crossing."""
    out = [np.zeros((h, w), np.float32) for _ in range(5)]
    if not len(segments):
        return out[:4]
    ends = segments.reshape(-1, 2, 2) / CELL_PX
    d = ends[:, 1] - ends[:, 0]
    length = np.hypot(d[:, 0], d[:, 1])
    d = d / length[:, None]
    count = np.maximum(1, np.rint(length)).astype(int)
    segment = np.repeat(np.arange(len(length)), count)
    step = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    p = ends[segment, 0] + d[segment] * (step + 0.5)[:, None]
    x = np.clip(np.rint(p[:, 0]).astype(int), 0, w - 1)
    y = np.clip(np.rint(p[:, 1]).astype(int), 0, h - 1)
    size = length[segment]
    cell, cells = y * w + x, h * w
    short, long = SHORT_CELLS
    for k, part in enumerate((size < short, (size >= short) & (size < long), size >= long)):
        out[k] += np.bincount(cell[part], minlength=cells).reshape(h, w)
    weight = np.minimum(size, MAX_WEIGHT_CELLS)
    u, v = d[segment, 0], d[segment, 1]
    moments = (weight, weight * (u * u - v * v), weight * 2 * u * v)
    total, out[3], out[4] = (np.bincount(cell, t, cells).reshape(h, w).astype(np.float32) for t in moments)
    mean, c, s = (cv2.blur(v, CROSSING_CELLS) for v in (total, out[3], out[4]))
    return [*out[:3], mean - np.hypot(c, s)]


def saliency_map(
    small: Array,
    noise: float,
    weights: SaliencyWeights,
    segments: Optional[Array] = None,
    slopes: Optional[Tuple[Array, Array]] = None,
) -> Array:
    """Return the probability (h, w) that a cell shows the target; parameters as in ``measures``."""
    m = measures(small, noise, segments, slopes)
    h, w, n = m.shape
    # standardisation of the measures, folded into the weights
    first = (weights.first / weights.scale[:, None]).astype(np.float32)
    bias = (weights.first_bias - (weights.mean / weights.scale) @ weights.first).astype(np.float32)
    flat, second = np.moveaxis(m, -1, 0).reshape(n, -1), weights.second.astype(np.float32)
    z = np.empty(h * w, np.float32)
    for k in range(0, h * w, BLOCK_CELLS):
        # in blocks that fit the processor's cache
        hidden = first.T @ flat[:, k : k + BLOCK_CELLS]
        hidden += bias[:, None]
        z[k : k + BLOCK_CELLS] = second @ np.maximum(hidden, 0.0, out=hidden)
    z += weights.second_bias
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(z, -30, 30)))).reshape(h, w)


def boxes(probability: Array, most: int = 4) -> List[Box]:
    """Return boxes around the most salient regions, best first [cells].

    Several thresholds are used, because a half-shadowed target breaks up at a high one and merges with clouds at a low
    one.
    """
    smooth = cv2.GaussianBlur(probability.astype(np.float32), (0, 0), 1.0)
    candidates: List[Tuple[float, Box]] = []
    for level in (0.5, 0.25, 0.75, 0.12):
        mask = cv2.morphologyEx((smooth > level).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
        count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
        for k in range(1, count):
            x, y, bw, bh, area = (int(v) for v in stats[k])
            if area < 6 or min(bw, bh) < 2:
                continue
            inside = smooth[y : y + bh, x : x + bw][labels[y : y + bh, x : x + bw] == k]
            # probability within the box, with a penalty for area
            score = float((inside - 0.3).sum()) / float(np.sqrt(bw * bh))
            candidates.append((score, (float(x), float(y), float(x + bw), float(y + bh))))
    candidates.sort(key=lambda f: -f[0])
    distinct: List[Box] = []
    for _, box in candidates:
        # boxes that overlap more show the same object; chosen by eye
        if all(overlap(box, other) < 0.6 for other in distinct):
            distinct.append(box)
        if len(distinct) >= most:
            break
    return distinct
