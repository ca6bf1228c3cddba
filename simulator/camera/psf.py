"""The point spread function as the kernel of a convolution on the image's pixels.

The renderer gives each pixel the mean over its area, so the kernel is that of the optics alone. It is made in the
frequency domain: up to the image's Nyquist frequency its transfer function is the optics', whatever the width.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.special import j1

from simulator.camera.deviates import for_each_band

if TYPE_CHECKING:
    from simulator.arrays import Float32Array, FloatArray
    from simulator.camera.model import Camera
    from simulator.camera.optics import Optics
    from simulator.camera.sensor import Sensor

_GRID = 128  # frequencies per axis; kernels reach half as far
_KEPT_ENERGY = 0.999
_NARROW_PX2 = 0.8
LARGEST_KERNEL = 63


def diffraction_mtf(frequency: FloatArray, cutoff: float) -> FloatArray:
    """Transfer function of a clear round aperture without aberrations.

    Parameters
    ----------
    frequency, cutoff : in the same unit; the cutoff is 1 / (wavelength x f-number).

    References
    ----------
    Goodman (2005), Introduction to Fourier optics, eq. 6-31.
    """
    v = np.clip(np.abs(frequency) / cutoff, 0, 1)
    return np.asarray(2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v * v)))


def disc_mtf(frequency: FloatArray, diameter: float) -> FloatArray:
    """Transfer function of an even blur disc (defocus in geometrical optics)."""
    x = np.pi * np.abs(frequency) * diameter
    return np.asarray(np.where(x < 1e-6, 1.0, 2 * j1(np.maximum(x, 1e-6)) / np.maximum(x, 1e-6)))


def optics_mtf(
    frequency_x: FloatArray, frequency_y: FloatArray, optics: Optics, sensor: Sensor, disc_px: float = 0.0
) -> FloatArray:
    """Transfer function of the optics without a measured kernel; frequencies in cycles per pixel.

    Parameters
    ----------
    disc_px : diameter of the blur disc of defocus.
    """
    f = np.hypot(frequency_x, frequency_y)
    out = np.exp(-2 * (np.pi * f) ** 2 * gaussian_variance_px2(optics, sensor))
    if optics.psf == "airy":
        per_m = np.hypot(frequency_x / sensor.pixel_pitch_x_m, frequency_y / sensor.pixel_pitch_y_m)
        out = out * diffraction_mtf(per_m, 1 / (optics.wavelength_m * optics.f_number))
    return np.asarray(out * disc_mtf(f, disc_px))


def gaussian_variance_px2(optics: Optics, sensor: Sensor) -> float:
    """Variance of the Gaussian parts of the blur [px2]: the recipe's and the optics'."""
    own = optics.psf_sigma_px if optics.psf in {"gaussian", "airy"} else 0.0
    return sensor.blur_sigma_px**2 + own**2


@lru_cache(maxsize=64)
def psf_kernel(optics: Optics, sensor: Sensor, disc_px: float) -> FloatArray | None:
    """(n, n) kernel whose sum is one, or None where a Gaussian alone (or nothing) will do.

    Parameters
    ----------
    disc_px : diameter of the blur disc of defocus, rounded by the caller so that kernels are used again.
    """
    # a narrow Gaussian taken at whole pixels would be another: the recipes' own 1 px is wide enough
    narrow = optics.psf == "gaussian" and 0 < gaussian_variance_px2(optics, sensor) < _NARROW_PX2
    if optics.psf != "airy" and disc_px <= 0 and not narrow:
        return np.array(optics.kernel) if optics.psf == "kernel" else None
    f = np.fft.fftfreq(_GRID)
    fx, fy = np.meshgrid(f, f)
    kernel = np.fft.fftshift(np.fft.ifft2(optics_mtf(fx, fy, optics, sensor, disc_px)).real)
    # a cut-off at Nyquist rings; light is never negative
    kernel = np.maximum(kernel, 0)
    kernel /= kernel.sum()
    middle = _GRID // 2
    for reach in range(1, LARGEST_KERNEL // 2 + 1):
        part = kernel[middle - reach : middle + reach + 1, middle - reach : middle + reach + 1]
        if part.sum() >= _KEPT_ENERGY:
            break
    else:
        # wings that go on are let fade in a circle: round the Sun's disc a square's edge would show
        at = np.arange(-reach, reach + 1) / (reach + 0.5)
        part = part * (0.5 + 0.5 * np.cos(np.pi * np.clip(np.hypot(at, at[:, None]) * 2 - 1, 0, 1)))
    part = part / part.sum()
    if optics.psf == "kernel":
        part = _joined(part, np.array(optics.kernel))
    return np.asarray(part)


def _joined(a: FloatArray, b: FloatArray) -> FloatArray:
    """Convolution of two kernels at full size."""
    shape = [n + m - 1 for n, m in zip(a.shape, b.shape, strict=True)]
    return np.asarray(np.fft.irfft2(np.fft.rfft2(a, shape) * np.fft.rfft2(b, shape), shape))


def blur(image: Float32Array, optics: Optics, sensor: Sensor, disc_px: float, gain: float) -> Float32Array:
    """The image through the point spread function, times ``gain``; its border is repeated outwards."""
    kernel = psf_kernel(optics, sensor, disc_px)
    if kernel is not None:
        # OpenCV's filter2D correlates: the kernel is turned round
        taps = np.ascontiguousarray(kernel[::-1, ::-1] * gain, np.float32)
        image = np.asarray(cv2.filter2D(image, cv2.CV_32F, taps, borderType=cv2.BORDER_REPLICATE))
        gain = 1.0
        if optics.psf != "kernel" or disc_px > 0:
            return image
    sigma = float(np.sqrt(gaussian_variance_px2(optics, sensor)))
    if sigma > 0:
        return gaussian_blur(image, sigma, gain)
    return image if gain == 1.0 else np.asarray(image * np.float32(gain), np.float32)


def gaussian_blur(image: Float32Array, sigma_px: float, gain: float) -> Float32Array:
    """A Gaussian blur times ``gain``, band of rows by band of rows."""
    # 3 sigma either side, as in the public recipe's 7 taps for sigma = 1 px
    reach = int(np.ceil(3 * sigma_px))
    taps = cv2.getGaussianKernel(2 * reach + 1, sigma_px, cv2.CV_32F)
    scaled = (taps * np.float32(gain)).astype(np.float32)
    out = np.empty(image.shape, np.float32)
    height = image.shape[0]

    def blur_band(_: int, rows: slice) -> None:
        # the rows that the taps reach into belong to the neighbouring bands
        above, below = min(reach, rows.start), min(reach, height - rows.stop)
        wide = cv2.sepFilter2D(
            image[rows.start - above : rows.stop + below],
            cv2.CV_32F,
            taps,
            scaled,
            borderType=cv2.BORDER_REPLICATE,
        )
        out[rows] = wide[above : above + rows.stop - rows.start]

    for_each_band(height, blur_band)
    return out


def defocus_px(camera: Camera, optics: Optics, sensor: Sensor, distance_m: float) -> float:
    """Diameter of the blur disc at a distance, to a twentieth of a pixel; less than half a pixel is none [px]."""
    disc = optics.defocus_diameter_px(camera, sensor, distance_m)
    return 0.0 if disc < 0.5 else round(disc * 20) / 20
