"""Charge of one exposure: photo-electrons, dark current and its pattern, cosmic rays, blooming, read noise.

If the read noise exceeds `JOINT_SAMPLING_MIN_E` and the charge is well below the full well, the sum of shot and read
noise is drawn as one deviate of the same distribution, which halves the number of random numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.camera.detector.deviates import add_normal, bit_source, poisson

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Detector, Sensor
    from flyaround.simulator.runtime.arrays import Float32Array

JOINT_SAMPLING_MIN_E = 2.0
"""Read noise above which the sum is sampled [e]. Its skewness is then below 0.2, its quantisation below 1e-30."""
FULL_WELL_MARGIN_SIGMAS = 6.0
"""Margin of the expected charge below the full well, in shot noise, within which a pixel may overflow."""
ELECTRONS_PER_M = 80e6
"""Electrons that a minimum-ionising particle frees in silicon [e m-1]: some 80 a micrometre, Damerell (2009), Physics
and technology of silicon detectors, Rutherford Appleton Laboratory."""
_TESTED_ROWS = 8  # blooming tests at every eighth row if any charge still moves
_PARTICLE_KEY = 0x636F73  # key of the random numbers of particles
_TRACK_STEP_PX = 0.1  # spacing of the points of a particle's track
_PATTERN_KEY = 0x466C79  # key of the random numbers of the fixed pattern


@dataclass(frozen=True, eq=False)
class FixedPattern:
    """Fixed pattern of a detector, as maps over the image's pixels; `None` for a term that is zero.

    Parameters
    ----------
    sensitivity : (H, W) array or None
        Factor of mean one; zero for a dead pixel.
    offset_e : (H, W) array or None
        Offset [e].
    dark_e_s : (H, W) array or None
        Dark current of each pixel [e s-1].
    """

    sensitivity: Float32Array | None
    offset_e: Float32Array | None
    dark_e_s: Float32Array | None


def fixed_pattern(detector: Detector, height: int, width: int) -> FixedPattern:
    """Return the fixed pattern of a detector, at the image's pixels.

    Each physical row has its own random numbers, so that a region of interest shows the same pixels as the whole image.
    """
    # the pattern does not depend on the terms that vary from frame to frame, so the cache key omits them
    return _pattern(
        replace(detector, gain_e_per_dn=1.0, black_level_dn=0.0, read_noise_e=0.0, full_well_e=1.0),
        height,
        width,
    )


@lru_cache(maxsize=4)
def _pattern(d: Detector, height: int, width: int) -> FixedPattern:
    b = d.binning
    rows, columns = height * b, width * b
    has_gain = d.prnu > 0 or d.dead_pixel_share > 0
    has_dark = d.dark_e_s > 0 or (d.hot_pixel_share > 0 and d.hot_pixel_e_s > 0)
    sensitivity = np.ones((rows, columns), np.float32) if has_gain else None
    offset = np.zeros((rows, columns), np.float32) if d.dsnu_e > 0 else None
    dark = np.full((rows, columns), d.dark_e_s, np.float32) if has_dark else None
    warming = d.dark_e_s / d.dark_current_e_s if d.dark_current_e_s > 0 else 1.0
    last = d.roi_x0_px + columns
    for row in range(rows):
        rng = np.random.Generator(bit_source(d.serial, _PATTERN_KEY, d.roi_y0_px + row))
        gain_n, offset_n, dark_n = (
            rng.standard_normal(last + 1, np.float32)[d.roi_x0_px : last] for _ in range(3)
        )
        hot, dead = (rng.random(last + 1)[d.roi_x0_px : last] for _ in range(2))
        heat = rng.standard_exponential(last + 1)[d.roi_x0_px : last]
        if sensitivity is not None:
            sensitivity[row] = np.where(dead < d.dead_pixel_share, 0, np.maximum(1 + d.prnu * gain_n, 0))
        if offset is not None:
            offset[row] = d.dsnu_e * offset_n
        if dark is not None:
            dark[row] *= np.maximum(1 + d.dark_nonuniformity * dark_n, 0)
            dark[row] += np.where(hot < d.hot_pixel_share, heat * d.hot_pixel_e_s * warming, 0)
    return FixedPattern(
        None if sensitivity is None else _bin(sensitivity, b) / np.float32(b * b),
        None if offset is None else _bin(offset, b),
        None if dark is None else _bin(dark, b),
    )


def _bin(values: Float32Array, b: int) -> Float32Array:
    height, width = values.shape[0] // b, values.shape[1] // b
    return np.asarray(values.reshape(height, b, width, b).sum(axis=(1, 3), dtype=np.float32))


@dataclass(frozen=True, eq=False)
class Exposure:
    """Charge of one exposure, computed for a block of rows at a time.

    Parameters
    ----------
    sensor : Sensor
        Sensor with the detector.
    detector : Detector
        Its detector.
    exposure_s : float
        Exposure time.
    pattern : FixedPattern
        Fixed pattern of the detector.
    particles : (H, W) array or None
        Electrons from particle tracks.
    read_tables : tuple of array
        Tables for `add_normal` with the standard deviation of the read noise.
    unit_tables : tuple of array
        Tables for `add_normal` with standard deviation 1.
    """

    sensor: Sensor
    detector: Detector
    exposure_s: float
    pattern: FixedPattern
    particles: Float32Array | None
    read_tables: tuple[NDArray[Any], ...]
    unit_tables: tuple[NDArray[Any], ...]

    @property
    def well_e(self) -> float:
        """Full well of an image pixel [e]."""
        return self.detector.full_well_e * self.detector.pixels_per_bin

    def mean(self, signal: Float32Array, rows: slice) -> Float32Array:
        """Return the expected electrons (rows, W) from light and dark current.

        Parameters
        ----------
        signal : (H, W) array
            Expected photo-electrons over the saturation charge.
        rows : slice
            Rows of the image.
        """
        saturation = self.sensor.saturation_e
        sensitivity, dark = self.pattern.sensitivity, self.pattern.dark_e_s
        if sensitivity is None:
            electrons = signal[rows] * np.float32(saturation)
        else:
            electrons = np.asarray(cv2.multiply(signal[rows], sensitivity[rows], scale=saturation))
        np.maximum(electrons, 0, out=electrons)
        if dark is not None:
            cv2.scaleAdd(dark[rows], self.exposure_s, electrons, dst=electrons)
        return electrons

    def charge(
        self, mean: Float32Array, rows: slice, source: np.random.SFC64, *, with_particles: bool = True
    ) -> Float32Array:
        """Draw the charge (rows, W) that is read from each pixel [e]: electrons up to the full well, plus read noise.

        Parameters
        ----------
        mean : (rows, W) array
            Expected electrons, as from `mean`; may be overwritten.
        rows : slice
            Rows of the image.
        source : SFC64
            Source of random numbers.
        with_particles : bool, optional
            False to leave out the particles.
        """
        d, well = self.detector, np.float32(self.well_e)
        particles = self.particles[rows] if with_particles and self.particles is not None else None
        if not d.shot_noise or d.read_noise_per_pixel_e < JOINT_SAMPLING_MIN_E:
            return self._separately(mean, particles, source)
        # pixels that may partly exceed the full well, and those hit by particles
        margin = np.float32(FULL_WELL_MARGIN_SIGMAS) * np.sqrt(well)
        separate_pixels, photo_electrons = np.zeros(0, int), mean
        is_bright = float(mean.max()) > well - margin
        if is_bright or particles is not None:
            bright_columns = np.abs(mean - well) < margin
            if particles is not None:
                bright_columns |= particles > 0
            separate_pixels = np.flatnonzero(bright_columns)
        if separate_pixels.size > mean.size // 2:
            return self._separately(mean, particles, source)
        separate_mean = mean.ravel()[separate_pixels]
        if is_bright:
            photo_electrons = np.where(mean < well, mean, np.float32(0))
            mean = np.minimum(mean, well)
        charge = self.join(mean, photo_electrons, source)
        if separate_pixels.size:
            hits = None if particles is None else particles.ravel()[separate_pixels]
            charge.ravel()[separate_pixels] = self._separately(separate_mean, hits, source)
        return charge

    def _separately(
        self, mean: Float32Array, particles: Float32Array | None, source: np.random.SFC64
    ) -> Float32Array:
        electrons = self.collect(mean, particles, source)
        np.minimum(electrons, np.float32(self.well_e), out=electrons)
        self.add_read_noise(electrons, source)
        return electrons

    def collect(
        self, mean: Float32Array, particles: Float32Array | None, source: np.random.SFC64
    ) -> Float32Array:
        """Draw the charge in whole electrons, without a full well; overwrites ``mean``."""
        # limit to a thousand wells: the Sun's disc would overflow the counters
        np.minimum(mean, np.float32(1000 * self.well_e), out=mean)
        electrons = poisson(mean, source) if self.detector.shot_noise else mean
        if particles is not None:
            electrons += particles
        return electrons

    def join(self, mean: Float32Array, light: Float32Array, source: np.random.SFC64) -> Float32Array:
        """Draw the charge with photon and read noise [e], by the second-order expansion of their sum's distribution.

        For mean m and variance v = n + r^2, where n electrons were drawn and the third cumulant is n: m + z sqrt(v) +
        (z^2 - 1) n / (6 v). Terms of the next order stay below sigma / 50 up to three sigma.

        References
        ----------
        Fisher & Cornish (1960), The percentile points of distributions having known cumulants, Technometrics 2(2).
        """
        z = np.zeros_like(mean)
        add_normal(z, self.unit_tables, source)
        variance = light + np.float32(self.detector.read_noise_per_pixel_e**2)
        skew = np.asarray(cv2.divide(light, variance, scale=1 / 6), np.float32)
        charge = np.asarray(cv2.sqrt(variance, dst=variance), np.float32)
        charge += skew * z
        charge *= z
        charge += mean
        charge -= skew
        return charge

    def add_read_noise(self, charge: Float32Array, source: np.random.SFC64) -> None:
        """Add the noise of one read-out to each pixel, in place."""
        if self.detector.read_noise_e > 0:
            add_normal(charge, self.read_tables, source)


def bloom(charge: Float32Array, well_e: float, share: float) -> None:
    """Spill charge above the full well along its column, half upwards and half downwards, in place.

    Parameters
    ----------
    charge : (H, W) array
        Charge of the columns [e].
    well_e : float
        Full well.
    share : float
        Fraction of the overflow that stays in the column. The rest flows into the anti-blooming drain.
    """
    overflow = np.maximum(charge - np.float32(well_e), 0)
    rows = np.flatnonzero(overflow.any(axis=1))
    if not rows.size:
        return
    overflow *= np.float32(0.5 * share)
    np.minimum(charge, np.float32(well_e), out=charge)
    capacity = np.float32(well_e) - charge
    if not capacity.any():
        return
    height, width = charge.shape
    spill, absorbed = np.empty(width, np.float32), np.empty(width, np.float32)
    first, last = int(rows[0]), int(rows[-1])
    for order in (range(first, height), range(last, -1, -1)):
        # the moving charge obeys the recursion of waiting times in a queue: Lindley (1952)
        moving = np.zeros(width, np.float32)
        for row in order:
            if row % _TESTED_ROWS == 0 and not first <= row <= last and not moving.any():
                break
            row_capacity = capacity[row]
            np.minimum(moving, row_capacity, out=absorbed)
            row_capacity -= absorbed
            charge[row] += absorbed
            np.subtract(moving, absorbed, out=spill)
            np.add(spill, overflow[row], out=moving)


def cosmic_ray_charge(
    sensor: Sensor, height: int, width: int, exposure_s: float, seed: int, frame_index: int
) -> Float32Array | None:
    """Draw particle tracks; return their electrons (H, W), or None without particles.

    Directions are isotropic, so the rate through a flat layer is proportional to the cosine of the angle of incidence.
    """
    d = sensor.detector
    if d is None or d.cosmic_rays_cm2_s <= 0:
        return None
    rng = np.random.Generator(bit_source(seed, frame_index, _PARTICLE_KEY))
    area_cm2 = height * width * sensor.pixel_pitch_x_m * sensor.pixel_pitch_y_m * 1e4
    count = int(rng.poisson(d.cosmic_rays_cm2_s * area_cm2 * exposure_s))
    if count == 0:
        return None
    charge = np.zeros((height, width), np.float32)
    for _ in range(count):
        x, y = rng.uniform(-0.5, width - 0.5), rng.uniform(-0.5, height - 0.5)
        cosine = max(np.sqrt(rng.random()), 1e-3)
        azimuth = rng.uniform(0, 2 * np.pi)
        path_m = d.layer_m / cosine
        lateral_m = path_m * np.sqrt(1 - cosine**2)
        dx, dy = (
            lateral_m * np.cos(azimuth) / sensor.pixel_pitch_x_m,
            lateral_m * np.sin(azimuth) / sensor.pixel_pitch_y_m,
        )
        steps = max(int(np.hypot(dx, dy) / _TRACK_STEP_PX), 1)
        t = (np.arange(steps) + 0.5) / steps
        column, row = np.rint(x + dx * t).astype(int), np.rint(y + dy * t).astype(int)
        is_inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        np.add.at(charge, (row[is_inside], column[is_inside]), np.float32(ELECTRONS_PER_M * path_m / steps))
    return charge
