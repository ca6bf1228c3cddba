"""The point spread function as the kernel of a convolution on the image's pixels.

The renderer averages over each pixel's area, so the kernel represents the optics only. It is designed in the frequency
domain, so that its transfer function equals that of the optics up to the Nyquist frequency.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.optimize import nnls
from scipy.special import j1

from flyaround.simulator.camera.detector.limits import MAX_KERNEL_SIZE
from flyaround.simulator.camera.detector.psf_pyramid import Pyramid, fit_kernel, fit_pyramid
from flyaround.simulator.runtime.threads import run_in_threads, split_rows

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.optics import Optics
    from flyaround.simulator.camera.detector.sensor import Sensor
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

_GRID = 128  # number of frequencies per axis; kernels reach half as far
_MIN_KERNEL_ENERGY = 0.999  # smallest fraction of the energy in a cropped kernel
_MIN_SAMPLED_VARIANCE_PX2 = 0.8  # the taps of a narrower Gaussian are fitted instead of sampled
_PYRAMID_ERROR = 0.02  # largest error of a pyramid's transfer function
_KERNEL_ERROR = 0.01  # largest error of a pyramid's transfer function for a measured kernel
_MAX_DIRECT_KERNEL = 9  # size up to which a kernel is faster than a pyramid
_MAX_PYRAMID_DISC_PX = 2.0  # largest diameter of a blur disc that a pyramid represents
_MAX_FREQUENCY = (
    0.45  # cycles per pixel; nearer to Nyquist every kernel without negative taps has larger errors
)
_FREQUENCIES = np.linspace(0, 0.5, 26)  # cycles per pixel at which errors are evaluated
_BLOCK_VALUES = 1 << 19  # OpenCV uses a single thread for smaller images
_THREAD_BLOCK_VALUES = 1 << 18  # size of a block that fits a processor's cache
_MIN_THREADED_VALUES = 3 << 19  # size of an image from which on two threads are faster


def diffraction_mtf(frequency: FloatArray, cutoff: float) -> FloatArray:
    """Return the transfer function of an unobstructed circular aperture without aberrations.

    Parameters
    ----------
    frequency : array
        Spatial frequencies.
    cutoff : float
        Cut-off frequency in the same unit: 1 / (wavelength x f-number).

    References
    ----------
    Goodman (2005), Introduction to Fourier optics, eq. 6-31.
    """
    v = np.clip(np.abs(frequency) / cutoff, 0, 1)
    return np.asarray(2 / np.pi * (np.arccos(v) - v * np.sqrt(1 - v * v)))


def disc_mtf(frequency: FloatArray, diameter: float) -> FloatArray:
    """Return the transfer function of a uniform blur disc (defocus in geometrical optics)."""
    x = np.pi * np.abs(frequency) * diameter
    return np.asarray(np.where(x < 1e-6, 1.0, 2 * j1(np.maximum(x, 1e-6)) / np.maximum(x, 1e-6)))


def optics_mtf(
    frequency_x: FloatArray, frequency_y: FloatArray, optics: Optics, sensor: Sensor, disc_px: float = 0.0
) -> FloatArray:
    """Return the transfer function of the optics without a measured kernel; frequencies in cycles per pixel.

    Parameters
    ----------
    frequency_x : array
        Spatial frequency along rows [cycles per pixel].
    frequency_y : array
        Spatial frequency along columns [cycles per pixel], same shape.
    optics : Optics
        The optics.
    sensor : Sensor
        The sensor, for its pixel pitches.
    disc_px : float, optional
        Diameter of the defocus disc [px along x]; it is round on the detector.

    Returns
    -------
    array
        Contrast, 1 at frequency 0.
    """
    f = np.hypot(frequency_x, frequency_y)
    transfer = np.exp(-2 * (np.pi * f) ** 2 * gaussian_variance_px2(optics, sensor))
    detector_frequency = np.hypot(
        frequency_x, frequency_y * (sensor.pixel_pitch_x_m / sensor.pixel_pitch_y_m)
    )
    if optics.psf == "airy":
        per_m = np.hypot(frequency_x / sensor.pixel_pitch_x_m, frequency_y / sensor.pixel_pitch_y_m)
        transfer = transfer * diffraction_mtf(per_m, 1 / (optics.wavelength_m * optics.f_number))
    return np.asarray(transfer * disc_mtf(detector_frequency, disc_px))


def gaussian_variance_px2(optics: Optics, sensor: Sensor) -> float:
    """Return the variance of the Gaussian parts of the blur [px2]: the recipe's and the optics'."""
    optics_variance = optics.psf_sigma_px if optics.psf in {"gaussian", "airy"} else 0.0
    return sensor.blur_sigma_px**2 + optics_variance**2


@lru_cache(maxsize=64)
def psf_kernel(optics: Optics, sensor: Sensor, disc_px: float) -> FloatArray | None:
    """Return an (n, n) kernel of sum one, or None if a Gaussian (or nothing) suffices.

    Parameters
    ----------
    optics : Optics
        The optics.
    sensor : Sensor
        The sensor, for its pixel pitches.
    disc_px : float
        Diameter of the defocus disc, rounded by the caller so that kernels are reused.
    """
    if optics.psf != "airy" and disc_px <= 0:
        return np.array(optics.kernel) if optics.psf == "kernel" else None
    f = np.fft.fftfreq(_GRID)
    fx, fy = np.meshgrid(f, f)
    kernel = np.fft.fftshift(np.fft.ifft2(optics_mtf(fx, fy, optics, sensor, disc_px)).real)
    # the cut-off at Nyquist causes ringing: clip negative values, and cut a disc at its rim
    kernel = np.maximum(kernel, 0)
    if optics.psf != "airy":
        x, y = np.meshgrid(*[np.arange(_GRID) - _GRID // 2] * 2)
        distance_from_rim = np.hypot(x, y * (sensor.pixel_pitch_y_m / sensor.pixel_pitch_x_m)) - disc_px / 2
        kernel[distance_from_rim > 1 + 4 * np.sqrt(gaussian_variance_px2(optics, sensor))] = 0
    kernel /= kernel.sum()
    middle = _GRID // 2
    for reach in range(1, MAX_KERNEL_SIZE // 2 + 1):
        cropped = kernel[middle - reach : middle + reach + 1, middle - reach : middle + reach + 1]
        if cropped.sum() >= _MIN_KERNEL_ENERGY:
            break
    else:
        # fade the wings towards a circle, because the edge of a square would be visible around the Sun
        position = np.arange(-reach, reach + 1) / (reach + 0.5)
        cropped = cropped * (
            0.5 + 0.5 * np.cos(np.pi * np.clip(np.hypot(position, position[:, None]) * 2 - 1, 0, 1))
        )
    cropped = cropped / cropped.sum()
    if optics.psf == "kernel":
        cropped = _convolve(cropped, np.array(optics.kernel))
    return np.asarray(cropped)


@lru_cache(maxsize=64)
def psf_pyramid(optics: Optics, sensor: Sensor, disc_px: float) -> Pyramid | None:
    """Return the PSF as a pyramid, which is faster than a kernel; None if no pyramid is accurate enough.

    Up to `_MAX_FREQUENCY`, its transfer function must match that of the optics within `_PYRAMID_ERROR`, or as well as
    the kernel's does.
    """
    if disc_px > _MAX_PYRAMID_DISC_PX or (optics.psf not in {"airy", "kernel"} and disc_px <= 0):
        return None
    if optics.psf == "kernel":
        return _kernel_pyramid(optics, sensor, disc_px)
    per_px = optics.wavelength_m * optics.f_number / sensor.pixel_pitch_x_m
    pyramid = fit_pyramid(
        lambda fx, fy: optics_mtf(fx, fy, optics, sensor, disc_px),
        swap_symmetric=sensor.pixel_pitch_x_m == sensor.pixel_pitch_y_m,
        # mean intensity of the rings: the light beyond r is 2 per_px / (pi^2 r)
        wing_px=per_px / np.pi**3 if optics.psf == "airy" and disc_px <= 0 else 0.0,
    )
    fx, fy = np.meshgrid(_FREQUENCIES, _FREQUENCIES)
    ideal = optics_mtf(fx, fy, optics, sensor, disc_px)
    in_band = np.hypot(fx, fy) <= _MAX_FREQUENCY
    error = float(np.abs(pyramid.transfer(fx, fy) - ideal)[in_band].max())
    if error > _PYRAMID_ERROR:
        kernel = psf_kernel(optics, sensor, disc_px)
        if kernel is not None and error > np.abs(kernel_transfer(kernel, fx, fy) - ideal)[in_band].max():
            return None
    return pyramid


def _kernel_pyramid(optics: Optics, sensor: Sensor, disc_px: float) -> Pyramid | None:
    """Return a measured kernel as a pyramid, if that is cheaper and within `_KERNEL_ERROR` at every frequency."""
    kernel = psf_kernel(optics, sensor, disc_px)
    if kernel is None or max(kernel.shape) <= _MAX_DIRECT_KERNEL:
        return None
    pyramid = fit_kernel(kernel)
    fx, fy = np.meshgrid(_FREQUENCIES, np.concatenate([-_FREQUENCIES[:0:-1], _FREQUENCIES]))
    error = np.abs(pyramid.transfer(fx, fy) - kernel_transfer(kernel, fx, fy)).max()
    return pyramid if error <= _KERNEL_ERROR else None


def kernel_transfer(
    kernel: FloatArray, frequency_x: FloatArray, frequency_y: FloatArray
) -> NDArray[np.complex128]:
    """Return the transfer function of a kernel."""
    rows, columns = (np.arange(n) - n // 2 for n in kernel.shape)
    wave_x = np.exp(-2j * np.pi * frequency_x[..., None] * columns)
    wave_y = np.exp(-2j * np.pi * frequency_y[..., None] * rows)
    return np.asarray(np.einsum("...i,ij,...j->...", wave_y, kernel, wave_x))


def applied_mtf(
    frequency_x: FloatArray, frequency_y: FloatArray, optics: Optics, sensor: Sensor, disc_px: float = 0.0
) -> FloatArray:
    """Return the modulation transfer function of the applied blur; `optics_mtf` is that of the optics.

    Returns
    -------
    array
        Modulus 0 to 1, of the shape of ``frequency_x``, at frequencies in cycles per pixel; 1 everywhere without blur.
    """
    pyramid, kernel = psf_pyramid(optics, sensor, disc_px), psf_kernel(optics, sensor, disc_px)
    transfer = np.ones(np.shape(frequency_x), complex)
    if pyramid is not None:
        transfer = pyramid.transfer(frequency_x, frequency_y)
    elif kernel is not None:
        transfer = kernel_transfer(kernel, frequency_x, frequency_y)
    sigma = _residual_gaussian_px(optics, sensor, disc_px)
    if sigma > 0:
        taps = gaussian_taps(sigma)[None].astype(float)
        zero = np.zeros(np.shape(frequency_x))
        transfer = (
            transfer * kernel_transfer(taps, frequency_x, zero) * kernel_transfer(taps, frequency_y, zero)
        )
    return np.asarray(np.abs(transfer))


def _residual_gaussian_px(optics: Optics, sensor: Sensor, disc_px: float) -> float:
    """Return the standard deviation of the Gaussian that is not in the kernel [px]."""
    is_in_kernel = optics.psf == "airy" or disc_px > 0
    return 0.0 if is_in_kernel else float(np.sqrt(gaussian_variance_px2(optics, sensor)))


@lru_cache(maxsize=64)
def gaussian_taps(sigma_px: float) -> Float32Array:
    """Return the taps (2 n + 1,) of a Gaussian along one axis; n is three sigma, as in SPEED's 7 taps for one pixel.

    A narrow Gaussian that is sampled at whole pixels has a wrong transfer function, so its taps are fitted to the right
    one by non-negative least squares.
    """
    reach = max(int(np.ceil(3 * sigma_px)), 1)
    if sigma_px**2 >= _MIN_SAMPLED_VARIANCE_PX2:
        return np.asarray(cv2.getGaussianKernel(2 * reach + 1, sigma_px, cv2.CV_32F)[:, 0], np.float32)
    waves = np.cos(2 * np.pi * np.outer(_FREQUENCIES, np.arange(reach + 1)))
    transfer = np.exp(-2 * (np.pi * _FREQUENCIES * sigma_px) ** 2)
    half, _ = nnls(waves, transfer)
    taps = np.concatenate([half[:0:-1] / 2, half[:1], half[1:] / 2])
    return np.asarray(taps / taps.sum(), np.float32)


def _convolve(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the convolution of two kernels at full size."""
    shape = [n + m - 1 for n, m in zip(a.shape, b.shape, strict=True)]
    return np.asarray(np.fft.irfft2(np.fft.rfft2(a, shape) * np.fft.rfft2(b, shape), shape))


def blur(
    image: Float32Array, optics: Optics, sensor: Sensor, disc_px: float, gain: float | Float32Array
) -> Float32Array:
    """Convolve an image with the point spread function and multiply it by a gain.

    Parameters
    ----------
    image : (H, W) or (H, W, n) array
        Image; its border is replicated.
    optics : Optics
        Optics of the lens.
    sensor : Sensor
        Sensor with its recipe's blur.
    disc_px : float
        Diameter of the defocus disc.
    gain : float or array
        Scalar, or (n,) per band.

    Returns
    -------
    array
        Blurred image of the same shape, float32.
    """
    pyramid = psf_pyramid(optics, sensor, disc_px)
    kernel = psf_kernel(optics, sensor, disc_px)
    sigma = _residual_gaussian_px(optics, sensor, disc_px)
    if isinstance(gain, np.ndarray):
        if pyramid is None and kernel is None and sigma > 0:
            return gaussian_blur(image, sigma, gain)
        image, gain = scale_bands(image, gain), 1.0
    if pyramid is not None:
        image, gain = pyramid.blur(image, gain), 1.0
    elif kernel is not None:
        # OpenCV's filter2D correlates, so the kernel is flipped
        taps = np.ascontiguousarray(kernel[::-1, ::-1] * gain, np.float32)
        image = np.asarray(cv2.filter2D(image, cv2.CV_32F, taps, borderType=cv2.BORDER_REPLICATE))
        gain = 1.0
    if sigma > 0:
        return gaussian_blur(image, sigma, gain)
    return image if gain == 1.0 else np.asarray(image * np.float32(gain), np.float32)


def scale_bands(image: Float32Array, gain: Float32Array) -> Float32Array:
    """Multiply rows (K, W, n) of an image by the gain (n,) of each band."""
    row_gain = np.tile(gain, image.shape[1])
    return np.asarray(image.reshape(len(image), -1) * row_gain, np.float32).reshape(image.shape)


def gaussian_blur(image: Float32Array, sigma_px: float, gain: float | Float32Array) -> Float32Array:
    """Apply a Gaussian blur times ``gain``, in blocks of rows that are too small for OpenCV to use threads.

    OpenCV's threads spin for some time afterwards, while the driver draws the next frame. Images above a
    megapixel are divided between two Python threads, because a third one draws the noise.

    Parameters
    ----------
    image : (H, W) or (H, W, n) array
        Image to convolve.
    sigma_px : float
        Standard deviation of the Gaussian [px].
    gain : float or array
        Scalar, or (n,) per band.
    """
    taps = gaussian_taps(sigma_px)
    if isinstance(gain, np.ndarray):
        return _blur_in_blocks(image, taps, taps, np.tile(gain, image.shape[1]))
    taps_y = (taps * np.float32(gain)).astype(np.float32)
    if image.size >= _MIN_THREADED_VALUES:
        return _blur_in_blocks(image, taps, taps_y, None)
    reach = len(taps) // 2
    rows = max(_BLOCK_VALUES // max(image[0].size, 1), len(taps))
    blurred = np.empty(image.shape, np.float32)
    for first in range(0, len(image), rows):
        # rows near a block's border are wrong: restore those above; the next block computes those below again
        first_read, end = max(first - reach, 0), min(first + rows + reach, len(image))
        rows_above = blurred[first_read:first].copy()
        cv2.sepFilter2D(
            image[first_read:end],
            cv2.CV_32F,
            taps,
            taps_y,
            dst=blurred[first_read:end],
            borderType=cv2.BORDER_REPLICATE,
        )
        blurred[first_read:first] = rows_above
    return blurred


def _blur_in_blocks(
    image: Float32Array, taps_x: Float32Array, taps_y: Float32Array, row_gain: Float32Array | None
) -> Float32Array:
    """Convolve an image with taps along rows and columns, in parallel blocks of rows.

    Parameters
    ----------
    image : (H, W) or (H, W, n) array
        Image to convolve.
    taps_x : array
        Taps along a row.
    taps_y : array
        Taps along a column.
    row_gain : (W n,) array or None
        Factors of the values of a row, applied first.
    """
    reach, height = len(taps_x) // 2, len(image)
    blocks = split_rows(height, image.size // _THREAD_BLOCK_VALUES)
    shape = (max(end - first for first, end in blocks) + 2 * reach, *image.shape[1:])
    scratch: list[Float32Array] = []  # reused: allocating takes longer than the filtering
    blurred = np.empty(image.shape, np.float32)

    def blur_rows(first: int, end: int) -> None:
        first_read, below = max(first - reach, 0), min(end + reach, height)
        try:
            buffers = scratch.pop()
        except IndexError:
            buffers = np.empty((2, *shape), np.float32)
        rows_out, block = buffers[0, : below - first_read], image[first_read:below]
        if row_gain is not None:
            amplified = buffers[1, : below - first_read]
            np.multiply(block.reshape(len(block), -1), row_gain, out=amplified.reshape(len(amplified), -1))
            block = amplified
        cv2.sepFilter2D(block, cv2.CV_32F, taps_x, taps_y, dst=rows_out, borderType=cv2.BORDER_REPLICATE)
        blurred[first:end] = rows_out[first - first_read : end - first_read]
        scratch.append(buffers)

    run_in_threads(blocks, blur_rows)
    return blurred


def defocus_px(camera: Camera, optics: Optics, sensor: Sensor, distance_m: float) -> float:
    """Return the diameter of the defocus disc at a distance, rounded for the caches of the PSF.

    Returns
    -------
    float
        Diameter in steps of 0.05 px [px]; 0 if it is below half a pixel.
    """
    disc = optics.defocus_diameter_px(camera, sensor, distance_m)
    return 0.0 if disc < 0.5 else round(disc * 20) / 20
