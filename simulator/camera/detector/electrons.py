"""The detector in electrons: response to radiance, noise, and digital numbers, grey or in colour."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.readout import read_out
from flyaround.simulator.camera.detector.sunlight import electrons_per_joule

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from flyaround.simulator.camera.detector.optics import Optics
    from flyaround.simulator.camera.detector.sensor import Detector, Sensor
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray

_MOSAIC = {"r": 0, "g": 1, "b": 2}
_DEMOSAIC = {
    # OpenCV names a pattern by its second row's second and third pixel; RGB order out
    "rggb": cv2.COLOR_BayerBG2RGB,
    "bggr": cv2.COLOR_BayerRG2RGB,
    "grbg": cv2.COLOR_BayerGB2RGB,
    "gbrg": cv2.COLOR_BayerGR2RGB,
}


def electrons_per_radiance(
    sensor: Sensor, optics: Optics, exposure_s: float, bands: int
) -> NDArray[np.float64]:
    """Electrons that one W m-2 sr-1 in each band makes in an image pixel on the axis [e / (W m-2 sr-1)].

    Irradiance behind an aplanatic lens: pi / (4 N^2) of the radiance; Born & Wolf (1999), section 4.8.
    """
    d = sensor.detector
    if d is None:
        raise ValueError("a noise recipe on a 0..1 image has no electrons")
    energy = np.pi / (4 * optics.f_number**2) * sensor.pixel_pitch_x_m * sensor.pixel_pitch_y_m * exposure_s
    return energy * electrons_per_joule(d, optics, bands)


def white_balance(sensor: Sensor, optics: Optics, sunlight: ArrayLike) -> FloatArray:
    """Factors on the digital numbers of a detector's bands that make a white plate in sunlight grey (n,), least 1.

    Parameters
    ----------
    sunlight : (n,) one over the Sun's irradiance in each band, up to a constant.
    """
    if sensor.detector is None:
        raise ValueError("a noise recipe on a 0..1 image has no electrons")
    wanted = np.asarray(sunlight, float)
    electrons = electrons_per_joule(sensor.detector, optics, wanted.size)
    seen = electrons > 0  # what sees nothing cannot be balanced
    gain = np.divide(wanted, electrons, out=np.full(wanted.size, np.inf), where=seen)
    return np.where(seen, gain / gain.min(), 1.0)


def detector_sigma(sensor: Sensor, signal: float, exposure_s: float) -> float:
    """Standard deviation of the noise that differs from frame to frame or pixel to pixel, over saturation [1]."""
    d = sensor.detector
    if d is None:
        raise ValueError("a noise recipe on a 0..1 image has no electrons")
    electrons = signal * sensor.saturation_e
    dark = d.dark_e_s * exposure_s * d.pixels_per_bin
    variance = (
        float(d.shot_noise) * (electrons + dark)
        + d.read_noise_per_pixel_e**2
        + d.row_noise_e**2
        + d.column_noise_e**2
        + d.dsnu_e**2 * d.pixels_per_bin
        + (d.prnu * electrons) ** 2 / d.pixels_per_bin
        + (d.dark_nonuniformity * dark) ** 2 / d.pixels_per_bin
        + d.gain_e_per_dn**2 / 12
    )
    return float(np.sqrt(variance)) / sensor.saturation_e


def detect(
    signal: Float32Array,
    sensor: Sensor,
    seed: int,
    frame_index: int,
    exposure_s: float,
    band_gain: ArrayLike = 1.0,
) -> NDArray[np.unsignedinteger]:
    """Digital numbers of an exposed signal.

    Parameters
    ----------
    signal : (H, W) or (H, W, 3) expected photo-electrons over the saturation charge.
    seed, frame_index : key of this frame's random numbers.
    exposure_s : for dark current and particles.
    band_gain : white balance per band, applied to the digital numbers of a colour image above their black level:
        see `white_balance`.

    Returns
    -------
    (H, W) or (H, W, 3), uint8 for up to 8 bits, uint16 above. A mosaic that is not interpolated is (H, W).
    """
    d = sensor.detector
    if d is None:
        raise ValueError("a noise recipe on a 0..1 image has no electrons")
    if signal.ndim == 2:
        return read_out(signal, sensor, d, seed, frame_index, exposure_s)
    balance = np.asarray(band_gain, float)
    if d.colour_filter == "none":
        channels = [
            read_out(np.asarray(band, np.float32), sensor, d, seed, frame_index * 4 + k, exposure_s)
            for k, band in enumerate(cv2.split(signal))
        ]
        return _balanced(np.asarray(cv2.merge(channels)), sensor, balance)
    raw = read_out(mosaic(signal, d), sensor, d, seed, frame_index, exposure_s)
    if not d.demosaic:
        return raw
    return _balanced(cv2.cvtColor(raw, _DEMOSAIC[image_filter(d)]).astype(raw.dtype), sensor, balance)


def mosaic(signal: Float32Array, detector: Detector) -> Float32Array:
    """Colour filter mosaic (H, W) of three planes (H, W, 3): each pixel keeps the band of its filter."""
    out = np.empty(signal.shape[:2], np.float32)
    for k, name in enumerate(image_filter(detector)):
        y, x = divmod(k, 2)
        out[y::2, x::2] = signal[y::2, x::2, _MOSAIC[name]]
    return out


def image_filter(detector: Detector) -> str:
    """The mosaic's first two by two pixels in the image: the pattern belongs to the detector, not to the region read.

    Pixels that are joined have one colour, so that the mosaic of the joined ones is the detector's own.
    """
    down, right = detector.roi_y0_px // detector.binning % 2, detector.roi_x0_px // detector.binning % 2
    own = detector.colour_filter
    return "".join(own[2 * ((y + down) % 2) + (x + right) % 2] for y in (0, 1) for x in (0, 1))


def _balanced(
    image: NDArray[np.unsignedinteger], sensor: Sensor, balance: NDArray[np.float64]
) -> NDArray[np.unsignedinteger]:
    d = sensor.detector
    if balance.size == 1 or d is None:
        return image
    full = 2**sensor.bits - 1
    values = (image.astype(np.float32) - np.float32(d.black_level_dn)) * balance.astype(np.float32)
    return np.clip(np.rint(values + np.float32(d.black_level_dn)), 0, full).astype(image.dtype)
