"""The detector, photon by photon: from expected electrons to digital numbers.

The order is that of the charge: photo-electrons and dark current (Poisson), particles, full well and blooming, then
what the read-out adds (fixed offset, noise of pixel, row and column), gain, black level, converter.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.camera.deviates import add_normal, bit_source, for_each_band, normal_tables
from simulator.camera.fixed_pattern import fixed_pattern
from simulator.camera.particles import cosmic_ray_charge
from simulator.camera.poisson import poisson

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from simulator.arrays import Float32Array
    from simulator.camera.optics import Optics
    from simulator.camera.sensor import Detector, Sensor

PLANCK_J_S, LIGHT_M_S = 6.62607015e-34, 299_792_458.0
BAND_WAVELENGTHS_M = (650e-9, 550e-9, 450e-9)
_ROW_KEY, _COLUMN_KEY = 0x726F77, 0x636F6C
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
    wavelength = np.array([optics.wavelength_m] if bands == 1 else BAND_WAVELENGTHS_M)
    efficiency = (
        np.resize(np.array(d.quantum_efficiency), bands) if bands > 1 else np.mean(d.quantum_efficiency)
    )
    energy = (
        np.pi
        / (4 * optics.f_number**2)
        * optics.transmission
        * sensor.pixel_pitch_x_m
        * sensor.pixel_pitch_y_m
        * exposure_s
    )
    return np.asarray(energy * efficiency * wavelength / (PLANCK_J_S * LIGHT_M_S))


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
    band_gain : white balance per band, applied to the digital numbers of a colour image.

    Returns
    -------
    (H, W) or (H, W, 3), uint8 for up to 8 bits, uint16 above. A mosaic that is not interpolated is (H, W).
    """
    d = sensor.detector
    if d is None:
        raise ValueError("a noise recipe on a 0..1 image has no electrons")
    if signal.ndim == 2:
        return _read_out(signal, sensor, d, seed, frame_index, exposure_s)
    balance = np.asarray(band_gain, float)
    if d.colour_filter == "none":
        channels = [
            _read_out(np.ascontiguousarray(signal[..., k]), sensor, d, seed, frame_index * 4 + k, exposure_s)
            for k in range(signal.shape[2])
        ]
        return _balanced(np.stack(channels, axis=-1), sensor, balance)
    raw = _read_out(mosaic(signal, d), sensor, d, seed, frame_index, exposure_s)
    if not d.demosaic:
        return raw
    return _balanced(cv2.cvtColor(raw, _DEMOSAIC[d.colour_filter]).astype(raw.dtype), sensor, balance)


def mosaic(signal: Float32Array, detector: Detector) -> Float32Array:
    """(H, W) of (H, W, 3): each pixel keeps the band of its filter."""
    out = np.empty(signal.shape[:2], np.float32)
    for k, name in enumerate(detector.colour_filter):
        # the pattern belongs to the detector, not to the region that is read
        y, x = (k // 2 - detector.roi_y0_px) % 2, (k % 2 - detector.roi_x0_px) % 2
        out[y::2, x::2] = signal[y::2, x::2, _MOSAIC[name]]
    return out


def _balanced(
    image: NDArray[np.unsignedinteger], sensor: Sensor, balance: NDArray[np.float64]
) -> NDArray[np.unsignedinteger]:
    d = sensor.detector
    if balance.size == 1 or d is None:
        return image
    gain = balance / np.resize(np.array(d.quantum_efficiency), 3) / np.array(BAND_WAVELENGTHS_M)
    gain /= gain.min()
    full = 2**sensor.bits - 1
    values = (image.astype(np.float32) - np.float32(d.black_level_dn)) * gain.astype(np.float32)
    return np.clip(np.rint(values + np.float32(d.black_level_dn)), 0, full).astype(image.dtype)


def _read_out(
    signal: Float32Array, sensor: Sensor, d: Detector, seed: int, frame_index: int, exposure_s: float
) -> NDArray[np.unsignedinteger]:
    height, width = signal.shape
    pattern = fixed_pattern(d, height, width)
    particles = cosmic_ray_charge(sensor, height, width, exposure_s, seed, frame_index)
    saturation, well = np.float32(sensor.saturation_e), np.float32(d.full_well_e * d.pixels_per_bin)
    charge = np.empty((height, width), np.float32)
    sources = {k: bit_source(seed, frame_index, k) for k in range(8)}

    def collect(k: int, rows: slice) -> None:
        mean = np.maximum(signal[rows], 0) * saturation
        if pattern.sensitivity is not None:
            mean *= pattern.sensitivity[rows]
        if pattern.dark_e_s is not None:
            mean += pattern.dark_e_s[rows] * np.float32(exposure_s)
        # a thousand wells are as good as any more; the Sun's disc would overflow what is counted
        np.minimum(mean, 1000 * well, out=mean)
        electrons = poisson(mean, sources[k]) if d.shot_noise else mean
        if particles is not None:
            electrons += particles[rows]
        if d.blooming <= 0:
            np.minimum(electrons, well, out=electrons)
        charge[rows] = electrons

    for_each_band(height, collect)
    if d.blooming > 0:
        bloom(charge, float(well), d.blooming)
    by_row = _line_noise(height, d.row_noise_e, seed, frame_index, _ROW_KEY)
    by_column = _line_noise(width, d.column_noise_e, seed, frame_index, _COLUMN_KEY)
    tables = normal_tables(d.read_noise_per_pixel_e, np.dtype(np.float32))
    full = np.float32(2**sensor.bits - 1)
    out = np.empty((height, width), np.uint8 if sensor.bits <= 8 else np.uint16)

    def convert(k: int, rows: slice) -> None:
        volts = charge[rows]
        if d.read_noise_e > 0:
            add_normal(volts, tables, sources[k])
        if pattern.offset_e is not None:
            volts += pattern.offset_e[rows]
        if by_row is not None:
            volts += by_row[rows, None]
        if by_column is not None:
            volts += by_column
        volts *= np.float32(1 / d.gain_e_per_dn)
        volts += np.float32(d.black_level_dn + 0.5)  # the fraction is cut off: with the half, rounding
        np.clip(volts, 0, full, out=volts)
        out[rows] = volts

    for_each_band(height, convert)
    return out


def _line_noise(count: int, sigma_e: float, seed: int, frame_index: int, key: int) -> Float32Array | None:
    if sigma_e <= 0:
        return None
    rng = np.random.Generator(bit_source(seed, frame_index, key))
    return np.asarray(rng.standard_normal(count, np.float32) * np.float32(sigma_e))


def bloom(charge: Float32Array, well_e: float, share: float) -> None:
    """Let what is above the full well run over, in place: half up, half down its column, on and on.

    Parameters
    ----------
    share : of the overflow that stays on the column; the rest goes into the anti-blooming drain.
    """
    columns = np.flatnonzero((charge > well_e).any(axis=0))
    if not columns.size:
        return
    part = charge[:, columns]
    over = np.maximum(part - well_e, 0) * (0.5 * share)
    np.minimum(part, well_e, out=part)
    for rows in (range(len(part)), range(len(part) - 1, -1, -1)):
        carried = np.zeros(columns.size, np.float32)
        for row in rows:
            room = well_e - part[row]
            taken = np.minimum(room, carried)
            part[row] += taken
            carried += over[row] - taken
    charge[:, columns] = part
