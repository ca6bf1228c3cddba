"""Read-out: from expected photo-electrons to digital numbers, mono or colour, in bands of rows.

The physical order is: photo-electrons and dark current (Poisson), particles, full well and blooming, then read-out
(fixed offset, noise of pixel, row and column), gain, black level, converter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.detector.charge import (
    FULL_WELL_MARGIN_SIGMAS,
    Exposure,
    bloom,
    cosmic_ray_charge,
    fixed_pattern,
)
from flyaround.simulator.camera.detector.deviates import NOISE_BANDS, bit_source, for_each_band, normal_tables

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from flyaround.simulator.camera.detector.sensor import Detector, Sensor
    from flyaround.simulator.runtime.arrays import Float32Array

_ROW_KEY, _COLUMN_KEY = 0x726F77, 0x636F6C  # keys of the random numbers of rows and columns
_COARSE_NOISE_MAX_DN = (
    25.0  # above this noise, a histogram of 1e5 pixels shows the steps of two-byte deviates
)
_MOSAIC = {"r": 0, "g": 1, "b": 2}
_DEMOSAIC = {
    # OpenCV names a pattern by its second row's second and third pixel; the output order is RGB
    "rggb": cv2.COLOR_BayerBG2RGB,
    "bggr": cv2.COLOR_BayerRG2RGB,
    "grbg": cv2.COLOR_BayerGB2RGB,
    "gbrg": cv2.COLOR_BayerGR2RGB,
}


def detector_sigma(sensor: Sensor, signal: float, exposure_s: float) -> float:
    """Return the standard deviation of noise and pixel-to-pixel variation at a signal.

    Returns
    -------
    float
        Standard deviation relative to saturation, as ``signal`` is.

    Raises
    ------
    ValueError
        If the sensor counts no electrons.
    """
    d = sensor.electron_detector
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
    """Return the digital numbers of an exposed signal.

    Parameters
    ----------
    signal : (H, W) or (H, W, 3) array
        Expected photo-electrons over the saturation charge.
    sensor : Sensor
        The sensor; its detector must be set.
    seed : int
        Seed of the random numbers.
    frame_index : int
        Number of the frame; with ``seed`` the key of its random numbers.
    exposure_s : float
        Exposure time, for dark current and particles [s].
    band_gain : array_like, optional
        White balance per band, applied above the black level of a colour image: see `white_balance`.

    Returns
    -------
    (H, W) or (H, W, 3) array
        uint8 for up to 8 bits, uint16 above. A mosaic without interpolation is (H, W).

    Raises
    ------
    ValueError
        If the sensor counts no electrons.
    """
    d = sensor.electron_detector
    if signal.ndim == 2:
        return read_out(signal, sensor, d, seed, frame_index, exposure_s)
    balance = np.asarray(band_gain, float)
    if d.colour_filter == "none":
        channels = [
            read_out(np.asarray(band, np.float32), sensor, d, seed, frame_index * 4 + k, exposure_s)
            for k, band in enumerate(cv2.split(signal))
        ]
        return _apply_balance(np.asarray(cv2.merge(channels)), sensor, balance)
    raw = read_out(mosaic(signal, d), sensor, d, seed, frame_index, exposure_s)
    if not d.demosaic:
        return raw
    return _apply_balance(cv2.cvtColor(raw, _DEMOSAIC[image_filter(d)]).astype(raw.dtype), sensor, balance)


def mosaic(signal: Float32Array, detector: Detector) -> Float32Array:
    """Return the colour filter mosaic (H, W) of three planes (H, W, 3): each pixel keeps its filter's band."""
    filtered = np.empty(signal.shape[:2], np.float32)
    for k, name in enumerate(image_filter(detector)):
        y, x = divmod(k, 2)
        filtered[y::2, x::2] = signal[y::2, x::2, _MOSAIC[name]]
    return filtered


def image_filter(detector: Detector) -> str:
    """Return the filters of the image's first 2 x 2 pixels, which depend on the offset of the region of interest.

    Pixels of one colour are binned together, so a binned image has the detector's mosaic.
    """
    row_offset, column_offset = (
        detector.roi_y0_px // detector.binning % 2,
        detector.roi_x0_px // detector.binning % 2,
    )
    pattern = detector.colour_filter
    return "".join(
        pattern[2 * ((y + row_offset) % 2) + (x + column_offset) % 2] for y in (0, 1) for x in (0, 1)
    )


def _apply_balance(
    image: NDArray[np.unsignedinteger], sensor: Sensor, balance: NDArray[np.float64]
) -> NDArray[np.unsignedinteger]:
    d = sensor.detector
    if balance.size == 1 or d is None:
        return image
    largest_dn = 2**sensor.bits - 1
    values = (image.astype(np.float32) - np.float32(d.black_level_dn)) * balance.astype(np.float32)
    return np.clip(np.rint(values + np.float32(d.black_level_dn)), 0, largest_dn).astype(image.dtype)


def read_out(
    signal: Float32Array, sensor: Sensor, d: Detector, seed: int, frame_index: int, exposure_s: float
) -> NDArray[np.unsignedinteger]:
    """Read out one plane: return the digital numbers (H, W) of an exposed signal (H, W).

    Parameters
    ----------
    signal : (H, W) array
        Expected photo-electrons over the saturation charge.
    sensor : Sensor
        Sensor.
    d : Detector
        Its detector.
    seed : int
        Seed of the random numbers.
    frame_index : int
        Number of the frame; with ``seed`` the key of its random numbers.
    exposure_s : float
        Exposure time.
    """
    height, width = signal.shape
    sigma_dn = (d.full_well_e * d.pixels_per_bin) ** 0.5 / d.gain_e_per_dn
    exposure = Exposure(
        sensor=sensor,
        detector=d,
        exposure_s=exposure_s,
        pattern=fixed_pattern(d, height, width),
        particles=cosmic_ray_charge(sensor, height, width, exposure_s, seed, frame_index),
        read_tables=normal_tables(d.read_noise_per_pixel_e, np.dtype(np.float32)),
        unit_tables=normal_tables(1.0, np.dtype(np.float32), smooth=sigma_dn > _COARSE_NOISE_MAX_DN),
    )
    by_row = _line_noise(height, d.row_noise_e, seed, frame_index, _ROW_KEY)
    by_column = _line_noise(width, d.column_noise_e, seed, frame_index, _COLUMN_KEY)
    numbers = np.empty((height, width), np.uint8 if sensor.bits <= 8 else np.uint16)
    largest_dn, well = np.float32(2**sensor.bits - 1), np.float32(exposure.well_e)

    def convert(charge_e: Float32Array, rows: slice) -> None:
        if exposure.pattern.offset_e is not None:
            charge_e += exposure.pattern.offset_e[rows]
        if by_row is not None:
            charge_e += by_row[rows, None]
        if by_column is not None:
            charge_e += by_column
        charge_e *= np.float32(1 / d.gain_e_per_dn)
        charge_e += np.float32(d.black_level_dn + 0.5)  # truncation then rounds
        np.clip(charge_e, 0, largest_dn, out=charge_e)
        numbers[rows] = charge_e

    def read_band(k: int, rows: slice) -> None:
        convert(exposure.charge(exposure.mean(signal, rows), rows, bit_source(seed, frame_index, k)), rows)

    if d.blooming <= 0:
        for_each_band(height, read_band)
        return numbers

    # Blooming spreads along whole columns. So the charge of columns with pixels near saturation is collected first, for
    # all rows, and read afterwards. All other columns are read at once.
    means = np.empty((height, width), np.float32)
    sources = {k: bit_source(seed, frame_index, k) for k in range(NOISE_BANDS)}
    safe_e = well - np.float32(FULL_WELL_MARGIN_SIGMAS) * np.sqrt(well)
    may_overflow = np.zeros((NOISE_BANDS, width), bool)

    def light_band(k: int, rows: slice) -> None:
        means[rows] = exposure.mean(signal, rows)
        may_overflow[k] = means[rows].max(axis=0, initial=0) > safe_e
        if exposure.particles is not None:
            may_overflow[k] |= (exposure.particles[rows] > 0).any(axis=0)

    for_each_band(height, light_band)
    full_columns = np.flatnonzero(may_overflow.any(axis=0))
    charge = np.empty((height, full_columns.size), np.float32)
    has_other_columns = full_columns.size < width

    def collect_band(k: int, rows: slice) -> None:
        hits = (
            None
            if exposure.particles is None
            else np.ascontiguousarray(exposure.particles[rows][:, full_columns])
        )
        charge[rows] = exposure.collect(np.ascontiguousarray(means[rows][:, full_columns]), hits, sources[k])

    def read_charge(k: int, rows: slice) -> None:
        charge_e = means[rows]
        if has_other_columns:
            np.minimum(charge_e, safe_e, out=charge_e)  # columns with blooming are overwritten below
            charge_e = exposure.charge(charge_e, rows, sources[k], with_particles=False)
        if full_columns.size:
            part = charge[rows]
            exposure.add_read_noise(part, sources[k])
            if has_other_columns:
                charge_e[:, full_columns] = part
            else:
                charge_e = part
        convert(charge_e, rows)

    if full_columns.size:
        for_each_band(height, collect_band)
        bloom(charge, float(well), d.blooming)
    for_each_band(height, read_charge)
    return numbers


def _line_noise(count: int, sigma_e: float, seed: int, frame_index: int, key: int) -> Float32Array | None:
    if sigma_e <= 0:
        return None
    rng = np.random.Generator(bit_source(seed, frame_index, key))
    return np.asarray(rng.standard_normal(count, np.float32) * np.float32(sigma_e))
