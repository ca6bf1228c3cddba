"""A wide convolution kernel, approximated by small kernels on the levels of an image pyramid.

Each level of the pyramid (Burt & Adelson 1983) has a few taps, fitted to a transfer function by non-negative least
squares: negative taps would darken the surroundings of the Sun's disc. Downsampling and upsampling with a binomial
filter preserves the total light and the centroid of a point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import nnls

from flyaround.simulator.camera.detector.deviates import NOISE_BANDS, sensor_threads

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

TAPS_PER_SIDE = (3, 2, 2, 2, 2, 2, 2, 3)
"""Number of taps on each side of the centre, at full size, half size, quarter size, ... More at full size, where the
core of the PSF is, and at the last, which has the wings beyond."""
# kernel of cv2.pyrDown followed by pyrUp: 1 4 6 4 1, convolved with itself
_BINOMIAL = np.array([1, 8, 28, 56, 70, 56, 28, 8, 1]) / 256
# frequencies of the fit [cycles per pixel], closer near zero, where wide levels differ
_FREQUENCIES = np.concatenate([[0.0, 0.0025, 0.005, 0.01, 0.015], np.arange(0.02, 0.501, 0.02)])
_CORNER_WEIGHT = 0.2  # weight of frequencies above 0.5 cycles per pixel, which occur only along diagonals
# weight of the zero frequency, squared that of all others together, so that the total light is preserved
_SUM_WEIGHT = 30.0
# radii at which the wings are matched, from beyond the core's taps to the reach of the last level
_WING_RADII_PX = np.geomspace(10.0, 450.0, 12)
# weight of the relative error of the wings, low because the transfer function decides what edges look like
_WING_WEIGHT = 0.05
_FIT_MARGIN_PX = 4  # margin of the fit around a kernel, in which taps that spread past it cost
_REGULARISATION = 3e-4  # regularisation of the weights, over the largest value: about one step of 12 bits


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
        transfer = np.zeros(np.broadcast(frequency_x, frequency_y).shape, complex)
        for level, taps in enumerate(self.taps):
            positions = (np.arange(taps.shape[0]) - taps.shape[0] // 2) * 2**level
            wave_x, wave_y = (
                np.exp(-2j * np.pi * np.asarray(f)[..., None] * positions) for f in (frequency_x, frequency_y)
            )
            base = _base_transfer(level, frequency_x) * _base_transfer(level, frequency_y)
            transfer += base * np.einsum("...i,ij,...j->...", wave_y, taps.astype(float), wave_x)
        return transfer

    def blur(self, image: Float32Array, gain: float) -> Float32Array:
        """Blur the image, (H, W) or (H, W, n), times ``gain``; the result does not depend on the number of threads."""
        height, reach = image.shape[0], self.taps[0].shape[0] // 2
        core = _flip(self.taps[0], gain)
        blurred = np.empty(image.shape, np.float32)
        edges = np.linspace(0, height, NOISE_BANDS + 1).astype(int)

        def blur_band(k: int) -> None:
            first, last = int(edges[k]), int(edges[k + 1])
            # rows beyond the band's edge belong to the neighbouring bands
            above, below = min(reach, first), min(reach, height - last)
            convolved = cv2.filter2D(
                image[first - above : last + below], cv2.CV_32F, core, borderType=cv2.BORDER_REPLICATE
            )
            blurred[first:last] = convolved[above : above + last - first]

        pool = sensor_threads()
        coarse = pool.submit(self._coarse_levels, image, gain)
        list(pool.map(blur_band, range(NOISE_BANDS)))
        convolved = coarse.result()
        return blurred if convolved is None else np.asarray(cv2.add(blurred, convolved, dst=blurred))

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
    transfer: Callable[[FloatArray, FloatArray], FloatArray], *, swap_symmetric: bool, wing_px: float = 0.0
) -> Pyramid:
    """Fit the taps to a transfer function.

    Parameters
    ----------
    transfer : callable
        Real function of the frequencies along x and y, cycles per pixel.
    swap_symmetric : bool
        True if it is unchanged when x and y are swapped.
    wing_px : float, optional
        Factor c of wings c / r^3 of the point spread function, r in pixels; 0 for none.
    """
    fx, fy = np.meshgrid(_FREQUENCIES, _FREQUENCIES)
    weight = np.where(np.hypot(fx, fy) <= 0.5, 1.0, _CORNER_WEIGHT)
    weight[0, 0] = _SUM_WEIGHT
    # sampled from the axis to the diagonal, so that saturated spots are round
    azimuths = np.linspace(0, np.pi / 2, 5)
    wing_x, wing_y = (np.outer(part(azimuths), _WING_RADII_PX).ravel() for part in (np.cos, np.sin))
    wing = wing_px / np.hypot(wing_x, wing_y) ** 3
    wing_weight = _WING_WEIGHT / wing if wing_px > 0 else np.zeros(wing.size)
    columns: list[FloatArray] = []
    tap_positions: list[tuple[int, set[tuple[int, int]]]] = []
    for level, pairs, in_frequency, in_space in _symmetric_columns(
        wing_x, wing_y, swap_symmetric=swap_symmetric
    ):
        columns.append(np.concatenate([(in_frequency * weight).ravel(), in_space * wing_weight]))
        tap_positions.append((level, pairs))
    samples = np.concatenate([(transfer(fx, fy) * weight).ravel(), wing * wing_weight])
    weights, _ = nnls(np.stack(columns, axis=1), samples)
    taps = [np.zeros((2 * n + 1, 2 * n + 1)) for n in TAPS_PER_SIDE]
    for weight_share, (level, pairs) in zip(weights / weights.sum(), tap_positions, strict=True):
        n = TAPS_PER_SIDE[level]
        mirrored = {(n + s * a, n + t * b) for a, b in pairs for s in (1, -1) for t in (1, -1)}
        for column, row in mirrored:
            taps[level][row, column] += weight_share / len(mirrored)
    return Pyramid(tuple(t.astype(np.float32) for t in taps))


def _symmetric_columns(
    wing_x: FloatArray, wing_y: FloatArray, *, swap_symmetric: bool
) -> Iterator[tuple[int, set[tuple[int, int]], FloatArray, FloatArray]]:
    """Yield level and offsets of taps of equal weight, their mean transfer function, and mean kernel in the wings."""
    for level, reach in enumerate(TAPS_PER_SIDE):
        frequency_bases = [
            _base_transfer(level, _FREQUENCIES) * np.cos(2 * np.pi * _FREQUENCIES * a * 2**level)
            for a in range(reach + 1)
        ]
        x_bases, y_bases = (
            [
                0.5 * (_base_kernel(level, w - a * 2**level) + _base_kernel(level, w + a * 2**level))
                for a in range(reach + 1)
            ]
            for w in (wing_x, wing_y)
        )
        for a in range(reach + 1):
            for b in range(a + 1 if swap_symmetric else reach + 1):
                pairs = {(a, b), (b, a)} if swap_symmetric else {(a, b)}
                in_frequency = sum(np.outer(frequency_bases[j], frequency_bases[i]) for i, j in pairs)
                in_space = sum(x_bases[i] * y_bases[j] for i, j in pairs)
                yield level, pairs, np.asarray(in_frequency) / len(pairs), np.asarray(in_space) / len(pairs)


def fit_kernel(kernel: FloatArray) -> Pyramid:
    """Fit the taps to a non-negative kernel of odd size; their sum is one.

    Raises
    ------
    ValueError
        If the size is even, which would shift the image by half a pixel, or the kernel is zero.
    """
    if any(n % 2 == 0 for n in kernel.shape) or not kernel.max() > 0:
        raise ValueError(f"a kernel of {kernel.shape} is even or zero")
    # a small kernel too is compared over the taps at full size
    reach_y, reach_x = (max(n // 2, TAPS_PER_SIDE[0]) + _FIT_MARGIN_PX for n in kernel.shape)
    y_positions, x_positions = np.arange(-reach_y, reach_y + 1.0), np.arange(-reach_x, reach_x + 1.0)
    padded = np.zeros((y_positions.size, x_positions.size))
    row_margin, column_margin = ((m - n) // 2 for m, n in zip(padded.shape, kernel.shape, strict=True))
    padded[row_margin : row_margin + kernel.shape[0], column_margin : column_margin + kernel.shape[1]] = (
        kernel
    )
    columns: list[FloatArray] = []
    tap_positions: list[tuple[int, int, int]] = []
    for level, n in enumerate(TAPS_PER_SIDE):
        base_reach = 4 * (2**level - 1)
        for y, x in np.ndindex(2 * n + 1, 2 * n + 1):
            y_px, x_px = (y - n) * 2**level, (x - n) * 2**level
            # otherwise taps outside the compared area would be unconstrained
            if abs(y_px) + base_reach <= reach_y and abs(x_px) + base_reach <= reach_x:
                columns.append(
                    np.outer(
                        _base_kernel(level, y_positions - y_px), _base_kernel(level, x_positions - x_px)
                    ).ravel()
                )
                tap_positions.append((level, y, x))
    # the wings are faint, but around a bright point only they are visible
    weight = (padded.ravel() / padded.max() + _REGULARISATION) ** -0.5
    weights, _ = nnls(np.stack(columns, axis=1) * weight[:, None], padded.ravel() * weight)
    taps = [np.zeros((2 * n + 1, 2 * n + 1)) for n in TAPS_PER_SIDE]
    for tap, (level, y, x) in zip(weights / weights.sum(), tap_positions, strict=True):
        taps[level][y, x] = tap
    return Pyramid(tuple(t.astype(np.float32) for t in taps))


def _flip(taps: Float32Array, gain: float) -> Float32Array:
    """Return the taps times ``gain``, flipped for OpenCV's filter2D, which correlates."""
    return np.ascontiguousarray(taps[::-1, ::-1] * np.float32(gain), np.float32)


def _base_transfer(level: int, frequency: FloatArray) -> FloatArray:
    """Return the transfer function, along one axis, of downsampling to a level and upsampling."""
    transfer = np.ones(np.shape(frequency))
    for k in range(level):
        transfer = transfer * np.cos(np.pi * 2**k * np.asarray(frequency)) ** 8
    return transfer


def _base_kernel(level: int, x_px: FloatArray) -> FloatArray:
    """Return the kernel of the same operation at distances from its centre."""
    kernel = np.ones(1)
    for k in range(level):
        upsampled = np.zeros(8 * 2**k + 1)
        upsampled[:: 2**k] = _BINOMIAL
        kernel = np.convolve(kernel, upsampled)
    half = kernel.size // 2
    return np.asarray(np.interp(x_px, np.arange(-half, half + 1), kernel, left=0.0, right=0.0))
