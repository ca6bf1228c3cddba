"""A wide convolution kernel as small kernels on the levels of an image pyramid; fast and never negative.

Each level of the pyramid (Burt & Adelson 1983) has a few taps, fitted to a transfer function by non-negative least
squares, so nothing next to the Sun's disc can turn dark. Downsampling and upsampling with the binomial filter preserves
a point's total light and centroid.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import nnls

from flyaround.simulator.camera.detector.deviates import NOISE_BANDS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

TAPS_PER_SIDE = (3, 2, 2, 2, 2, 2, 2, 3)
"""Taps on each side of the centre, at full size, half, quarter, ..."""
# down and up by cv2.pyrDown and pyrUp: 1 4 6 4 1 twice
_BINOMIAL = np.array([1, 8, 28, 56, 70, 56, 28, 8, 1]) / 256
_FREQUENCIES = np.concatenate([[0.0, 0.0025, 0.005, 0.01, 0.015], np.arange(0.02, 0.501, 0.02)])
_CORNER_WEIGHT = 0.2  # weight of frequencies beyond Nyquist's circle, which occur along diagonals only
_SUM_WEIGHT = 30.0  # weight of the zero frequency, which conserves the sum
_WING_RADII_PX = np.geomspace(10.0, 450.0, 12)  # radii at which the wings are matched
_WING_WEIGHT = 0.05  # weight of their relative error
_FIT_MARGIN_PX = 4  # margin of the fit around a kernel
_REGULARISATION = 3e-4  # regularisation of the weights, over the largest value


@dataclass(frozen=True, eq=False)
class Pyramid:
    """Taps of each level; their sum is one.

    Parameters
    ----------
    taps : tuple of (2 n + 1, 2 n + 1) arrays
        Taps at full size, half, quarter, ... of the image.
    """

    taps: tuple[Float32Array, ...]

    def transfer(self, frequency_x: FloatArray, frequency_y: FloatArray) -> NDArray[np.complex128]:
        """Return the transfer function at frequencies in cycles per pixel, averaged over sub-pixel positions."""
        out = np.zeros(np.broadcast(frequency_x, frequency_y).shape, complex)
        for level, taps in enumerate(self.taps):
            at = (np.arange(taps.shape[0]) - taps.shape[0] // 2) * 2**level
            wave_x, wave_y = (
                np.exp(-2j * np.pi * np.asarray(f)[..., None] * at) for f in (frequency_x, frequency_y)
            )
            base = _base_transfer(level, frequency_x) * _base_transfer(level, frequency_y)
            out += base * np.einsum("...i,ij,...j->...", wave_y, taps.astype(float), wave_x)
        return out

    def blur(self, image: Float32Array, gain: float) -> Float32Array:
        """Blur the image, (H, W) or (H, W, n), times ``gain``; the result does not depend on the number of threads."""
        height, reach = image.shape[0], self.taps[0].shape[0] // 2
        core = _flip(self.taps[0], gain)
        out = np.empty(image.shape, np.float32)
        edges = np.linspace(0, height, NOISE_BANDS + 1).astype(int)

        def blur_band(k: int) -> None:
            first, last = int(edges[k]), int(edges[k + 1])
            # rows beyond the band's edge belong to the neighbouring bands
            above, below = min(reach, first), min(reach, height - last)
            wide = cv2.filter2D(
                image[first - above : last + below], cv2.CV_32F, core, borderType=cv2.BORDER_REPLICATE
            )
            out[first:last] = wide[above : above + last - first]

        with ThreadPoolExecutor(2) as pool:
            coarse = pool.submit(self._coarse_levels, image, gain)
            list(pool.map(blur_band, range(NOISE_BANDS)))
            wide = coarse.result()
        return out if wide is None else np.asarray(cv2.add(out, wide, dst=out))

    def _coarse_levels(self, image: Float32Array, gain: float) -> Float32Array | None:
        """Return the sum of all levels but the first, at full size."""
        last = max((k for k, taps in enumerate(self.taps) if taps.any()), default=0)
        levels = [image]
        for _ in range(last):
            levels.append(np.asarray(cv2.pyrDown(levels[-1], borderType=cv2.BORDER_REPLICATE)))
        total: Float32Array | None = None
        for k in range(last, 0, -1):
            if self.taps[k].any():
                taps = _flip(self.taps[k], gain)
                convolved = cv2.filter2D(levels[k], cv2.CV_32F, taps, borderType=cv2.BORDER_REPLICATE)
                total = np.asarray(convolved if total is None else cv2.add(convolved, total, dst=convolved))
            if total is not None:
                total = np.asarray(cv2.pyrUp(total, dstsize=levels[k - 1].shape[1::-1]))
        return total


def fit_pyramid(
    transfer: Callable[[FloatArray, FloatArray], FloatArray], *, round_: bool, wing_px: float = 0.0
) -> Pyramid:
    """Fit the taps to a transfer function.

    Parameters
    ----------
    transfer : callable
        Real function of the frequencies along x and y, cycles per pixel.
    round_ : bool
        True if it is the same along x and y.
    wing_px : float, optional
        C of the wings c / r^3 of the point spread function, r in pixels; 0 for none.
    """
    fx, fy = np.meshgrid(_FREQUENCIES, _FREQUENCIES)
    weight = np.where(np.hypot(fx, fy) <= 0.5, 1.0, _CORNER_WEIGHT)
    weight[0, 0] = _SUM_WEIGHT
    # sampled from the axis to the diagonal, so that saturated spots are round
    turns = np.linspace(0, np.pi / 2, 5)
    wing_x, wing_y = (np.outer(part(turns), _WING_RADII_PX).ravel() for part in (np.cos, np.sin))
    wing = wing_px / np.hypot(wing_x, wing_y) ** 3
    wing_weight = _WING_WEIGHT / wing if wing_px > 0 else np.zeros(wing.size)
    columns: list[FloatArray] = []
    places: list[tuple[int, set[tuple[int, int]]]] = []
    for level, reach in enumerate(TAPS_PER_SIDE):
        at_f = [
            _base_transfer(level, _FREQUENCIES) * np.cos(2 * np.pi * _FREQUENCIES * a * 2**level)
            for a in range(reach + 1)
        ]
        at_x, at_y = (
            [
                0.5 * (_base_kernel(level, w - a * 2**level) + _base_kernel(level, w + a * 2**level))
                for a in range(reach + 1)
            ]
            for w in (wing_x, wing_y)
        )
        for a in range(reach + 1):
            for b in range(a + 1 if round_ else reach + 1):
                pairs = {(a, b), (b, a)} if round_ else {(a, b)}
                in_f = sum(np.outer(at_f[j], at_f[i]) for i, j in pairs) / len(pairs)
                in_x = sum(at_x[i] * at_y[j] for i, j in pairs) / len(pairs)
                columns.append(np.concatenate([(in_f * weight).ravel(), in_x * wing_weight]))
                places.append((level, pairs))
    samples = np.concatenate([(transfer(fx, fy) * weight).ravel(), wing * wing_weight])
    shares, _ = nnls(np.stack(columns, axis=1), samples)
    taps = [np.zeros((2 * n + 1, 2 * n + 1)) for n in TAPS_PER_SIDE]
    for share, (level, pairs) in zip(shares / shares.sum(), places, strict=True):
        n = TAPS_PER_SIDE[level]
        signed = {(n + s * a, n + t * b) for a, b in pairs for s in (1, -1) for t in (1, -1)}
        for column, row in signed:
            taps[level][row, column] += share / len(signed)
    return Pyramid(tuple(t.astype(np.float32) for t in taps))


def fit_kernel(kernel: FloatArray) -> Pyramid:
    """Fit the taps to a non-negative kernel of odd size; their sum is one."""
    reach_y, reach_x = (max(n // 2, 3) + _FIT_MARGIN_PX for n in kernel.shape)
    at_y, at_x = np.arange(-reach_y, reach_y + 1.0), np.arange(-reach_x, reach_x + 1.0)
    padded = np.zeros((at_y.size, at_x.size))
    down, across = ((m - n) // 2 for m, n in zip(padded.shape, kernel.shape, strict=True))
    padded[down : down + kernel.shape[0], across : across + kernel.shape[1]] = kernel
    columns: list[FloatArray] = []
    places: list[tuple[int, int, int]] = []
    for level, n in enumerate(TAPS_PER_SIDE):
        wide = 4 * (2**level - 1)
        for y, x in np.ndindex(2 * n + 1, 2 * n + 1):
            y_px, x_px = (y - n) * 2**level, (x - n) * 2**level
            # otherwise taps outside the compared area would be unconstrained
            if abs(y_px) + wide <= reach_y and abs(x_px) + wide <= reach_x:
                columns.append(
                    np.outer(_base_kernel(level, at_y - y_px), _base_kernel(level, at_x - x_px)).ravel()
                )
                places.append((level, y, x))
    # the wings are faint, but around a bright point only they are visible
    weight = (padded.ravel() / padded.max() + _REGULARISATION) ** -0.5
    shares, _ = nnls(np.stack(columns, axis=1) * weight[:, None], padded.ravel() * weight)
    taps = [np.zeros((2 * n + 1, 2 * n + 1)) for n in TAPS_PER_SIDE]
    for share, (level, y, x) in zip(shares / shares.sum(), places, strict=True):
        taps[level][y, x] = share
    return Pyramid(tuple(t.astype(np.float32) for t in taps))


def _flip(taps: Float32Array, gain: float) -> Float32Array:
    """Return flipped taps for OpenCV's filter2D, which correlates."""
    return np.ascontiguousarray(taps[::-1, ::-1] * np.float32(gain), np.float32)


def _base_transfer(level: int, frequency: FloatArray) -> FloatArray:
    """Return the transfer function, along one axis, of downsampling to a level and upsampling."""
    out = np.ones(np.shape(frequency))
    for k in range(level):
        out = out * np.cos(np.pi * 2**k * np.asarray(frequency)) ** 8
    return out


def _base_kernel(level: int, x_px: FloatArray) -> FloatArray:
    """Return the kernel of the same operation at distances from its centre."""
    kernel = np.ones(1)
    for k in range(level):
        spread = np.zeros(8 * 2**k + 1)
        spread[:: 2**k] = _BINOMIAL
        kernel = np.convolve(kernel, spread)
    half = kernel.size // 2
    return np.asarray(np.interp(x_px, np.arange(-half, half + 1), kernel, left=0.0, right=0.0))
