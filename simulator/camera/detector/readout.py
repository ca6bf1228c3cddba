"""One exposure of a detector: from expected photo-electrons to digital numbers, band of rows by band of rows.

The order is that of the charge: photo-electrons and dark current (Poisson), particles, full well and blooming, then
what the read-out adds (fixed offset, noise of pixel, row and column), gain, black level, converter.

Where the read noise smears whole electrons anyway, and the well is not near its brim, photon and read noise are drawn
as one deviate of their sum's law: half the random numbers for the same digital numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.camera.detector.deviates import (
    NOISE_BANDS,
    add_normal,
    bit_source,
    for_each_band,
    normal_tables,
)
from flyaround.simulator.camera.detector.fixed_pattern import FixedPattern, fixed_pattern
from flyaround.simulator.camera.detector.poisson import poisson

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.detector.sensor import Detector, Sensor
    from flyaround.simulator.runtime.arrays import Float32Array


_ROW_KEY, _COLUMN_KEY = 0x726F77, 0x636F6C
JOINED_FROM_E = 2.0
"""Read noise from which the sum's law is drawn: its skewness is below 0.2, its comb of electrons below 1e-30."""
_BRIM_SIGMAS = 6.0
_LOOKED_EVERY = 8
_COARSE_BELOW_DN = 25.0  # a wider noise shows the steps of two-byte deviates in a histogram of 1e5 pixels


@dataclass(frozen=True, eq=False)
class _Exposure:
    """What every block of one exposure needs."""

    sensor: Sensor
    detector: Detector
    exposure_s: float
    pattern: FixedPattern
    particles: Float32Array | None
    read_tables: tuple[NDArray[Any], ...]
    unit_tables: tuple[NDArray[Any], ...]

    @property
    def well_e(self) -> float:
        return self.detector.full_well_e * self.detector.pixels_per_bin

    def mean(self, signal: Float32Array, rows: slice) -> Float32Array:
        """(rows, W) expected electrons of light and heat."""
        saturation = self.sensor.saturation_e
        sensitivity, dark = self.pattern.sensitivity, self.pattern.dark_e_s
        if sensitivity is None:
            out = signal[rows] * np.float32(saturation)
        else:
            out = np.asarray(cv2.multiply(signal[rows], sensitivity[rows], scale=saturation))
        np.maximum(out, 0, out=out)
        if dark is not None:
            cv2.scaleAdd(dark[rows], self.exposure_s, out, dst=out)
        return out

    def charge(
        self, mean: Float32Array, rows: slice, source: np.random.SFC64, *, particles_too: bool = True
    ) -> Float32Array:
        """(rows, W) what is read of each pixel [e]: electrons up to the well's brim, with read noise."""
        d, well = self.detector, np.float32(self.well_e)
        particles = self.particles[rows] if particles_too and self.particles is not None else None
        if not d.shot_noise or d.read_noise_per_pixel_e < JOINED_FROM_E:
            return self._one_by_one(mean, particles, source)
        # pixels of which some charge may be cut off, and some not, and those that particles hit
        brim = np.float32(_BRIM_SIGMAS) * np.sqrt(well)
        apart, light = np.zeros(0, int), mean
        bright = float(mean.max()) > well - brim
        if bright or particles is not None:
            special = np.abs(mean - well) < brim
            if particles is not None:
                special |= particles > 0
            apart = np.flatnonzero(special)
        if apart.size > mean.size // 2:
            return self._one_by_one(mean, particles, source)
        at_brim = mean.ravel()[apart]
        if bright:
            light = np.where(mean < well, mean, np.float32(0))
            mean = np.minimum(mean, well)
        out = self.join(mean, light, source)
        if apart.size:
            hits = None if particles is None else particles.ravel()[apart]
            out.ravel()[apart] = self._one_by_one(at_brim, hits, source)
        return out

    def _one_by_one(
        self, mean: Float32Array, particles: Float32Array | None, source: np.random.SFC64
    ) -> Float32Array:
        electrons = self.collect(mean, particles, source)
        np.minimum(electrons, np.float32(self.well_e), out=electrons)
        self.add_read_noise(electrons, source)
        return electrons

    def collect(
        self, mean: Float32Array, particles: Float32Array | None, source: np.random.SFC64
    ) -> Float32Array:
        """Charge in whole electrons, as if wells had no brim; ``mean`` is lost."""
        # a thousand wells are as good as any more; the Sun's disc would overflow what is counted
        np.minimum(mean, np.float32(1000 * self.well_e), out=mean)
        electrons = poisson(mean, source) if self.detector.shot_noise else mean
        if particles is not None:
            electrons += particles
        return electrons

    def join(self, mean: Float32Array, light: Float32Array, source: np.random.SFC64) -> Float32Array:
        """Charge with the noise of photons and read-out [e], by the second-order expansion of their sum's law.

        For mean m and variance v = n + r^2, where n electrons were drawn and none cut off, as the third cumulant is n:
        m + z sqrt(v) + (z^2 - 1) n / (6 v). Terms of the next order stay below a fiftieth of sigma up to three sigma.

        References
        ----------
        Fisher & Cornish (1960), The percentile points of distributions having known cumulants, Technometrics 2(2).
        """
        z = np.zeros_like(mean)
        add_normal(z, self.unit_tables, source)
        variance = light + np.float32(self.detector.read_noise_per_pixel_e**2)
        skew = np.asarray(cv2.divide(light, variance, scale=1 / 6), np.float32)
        out = np.asarray(cv2.sqrt(variance, dst=variance), np.float32)
        out += skew * z
        out *= z
        out += mean
        out -= skew
        return out

    def add_read_noise(self, charge: Float32Array, source: np.random.SFC64) -> None:
        """What one read-out adds to each pixel, in place."""
        if self.detector.read_noise_e > 0:
            add_normal(charge, self.read_tables, source)


def read_out(
    signal: Float32Array, sensor: Sensor, d: Detector, seed: int, frame_index: int, exposure_s: float
) -> NDArray[np.unsignedinteger]:
    """Digital numbers (H, W) of one exposure; parameters as of `flyaround.simulator.camera.detector.electrons.detect`."""
    height, width = signal.shape
    sigma_dn = (d.full_well_e * d.pixels_per_bin) ** 0.5 / d.gain_e_per_dn
    e = _Exposure(
        sensor=sensor,
        detector=d,
        exposure_s=exposure_s,
        pattern=fixed_pattern(d, height, width),
        particles=cosmic_ray_charge(sensor, height, width, exposure_s, seed, frame_index),
        read_tables=normal_tables(d.read_noise_per_pixel_e, np.dtype(np.float32)),
        unit_tables=normal_tables(1.0, np.dtype(np.float32), smooth=sigma_dn > _COARSE_BELOW_DN),
    )
    by_row = _line_noise(height, d.row_noise_e, seed, frame_index, _ROW_KEY)
    by_column = _line_noise(width, d.column_noise_e, seed, frame_index, _COLUMN_KEY)
    out = np.empty((height, width), np.uint8 if sensor.bits <= 8 else np.uint16)
    full, well = np.float32(2**sensor.bits - 1), np.float32(e.well_e)

    def convert(volts: Float32Array, rows: slice) -> None:
        if e.pattern.offset_e is not None:
            volts += e.pattern.offset_e[rows]
        if by_row is not None:
            volts += by_row[rows, None]
        if by_column is not None:
            volts += by_column
        volts *= np.float32(1 / d.gain_e_per_dn)
        volts += np.float32(d.black_level_dn + 0.5)  # the fraction is cut off: with the half, rounding
        np.clip(volts, 0, full, out=volts)
        out[rows] = volts

    def read_band(k: int, rows: slice) -> None:
        convert(e.charge(e.mean(signal, rows), rows, bit_source(seed, frame_index, k)), rows)

    if d.blooming <= 0:
        for_each_band(height, read_band)
        return out

    # what runs over runs along whole columns: those are filled first, and read afterwards; in the others every well is
    # so far from its brim that they are read at once
    means = np.empty((height, width), np.float32)
    sources = {k: bit_source(seed, frame_index, k) for k in range(NOISE_BANDS)}
    brim = well - np.float32(_BRIM_SIGMAS) * np.sqrt(well)
    hit = np.zeros((NOISE_BANDS, width), bool)

    def light_band(k: int, rows: slice) -> None:
        means[rows] = e.mean(signal, rows)
        hit[k] = means[rows].max(axis=0, initial=0) > brim
        if e.particles is not None:
            hit[k] |= (e.particles[rows] > 0).any(axis=0)

    for_each_band(height, light_band)
    full_columns = np.flatnonzero(hit.any(axis=0))
    charge = np.empty((height, full_columns.size), np.float32)
    others = full_columns.size < width

    def collect_band(k: int, rows: slice) -> None:
        hits = None if e.particles is None else np.ascontiguousarray(e.particles[rows][:, full_columns])
        charge[rows] = e.collect(np.ascontiguousarray(means[rows][:, full_columns]), hits, sources[k])

    def read_charge(k: int, rows: slice) -> None:
        volts = means[rows]
        if others:
            np.minimum(
                volts, brim, out=volts
            )  # what is read of the full columns here is put in their place below
            volts = e.charge(volts, rows, sources[k], particles_too=False)
        if full_columns.size:
            part = charge[rows]
            e.add_read_noise(part, sources[k])
            if others:
                volts[:, full_columns] = part
            else:
                volts = part
        convert(volts, rows)

    if full_columns.size:
        for_each_band(height, collect_band)
        bloom(charge, float(well), d.blooming)
    for_each_band(height, read_charge)
    return out


def _line_noise(count: int, sigma_e: float, seed: int, frame_index: int, key: int) -> Float32Array | None:
    if sigma_e <= 0:
        return None
    rng = np.random.Generator(bit_source(seed, frame_index, key))
    return np.asarray(rng.standard_normal(count, np.float32) * np.float32(sigma_e))


def bloom(charge: Float32Array, well_e: float, share: float) -> None:
    """Blooming, in place: charge above the full well spills half up, half down its column until it fits.

    Parameters
    ----------
    share : of the overflow that stays on the column; the rest goes into the anti-blooming drain.
    """
    over = np.maximum(charge - np.float32(well_e), 0)
    rows = np.flatnonzero(over.any(axis=1))
    if not rows.size:
        return
    over *= np.float32(0.5 * share)
    np.minimum(charge, np.float32(well_e), out=charge)
    room = np.float32(well_e) - charge
    if not room.any():
        return
    height, width = charge.shape
    moved, taken = np.empty(width, np.float32), np.empty(width, np.float32)
    first, last = int(rows[0]), int(rows[-1])
    for order in (range(first, height), range(last, -1, -1)):
        # what is carried on is what waits in a queue: Lindley (1952), The theory of queues with a single server
        waiting = np.zeros(width, np.float32)
        for row in order:
            if row % _LOOKED_EVERY == 0 and not first <= row <= last and not waiting.any():
                break
            here = room[row]
            np.minimum(waiting, here, out=taken)
            here -= taken
            charge[row] += taken
            np.subtract(waiting, taken, out=moved)
            np.add(moved, over[row], out=waiting)


ELECTRONS_PER_M = 80e6
"""Minimum-ionising particle in silicon: Janesick (2001), Scientific charge-coupled devices, section 8."""
_PARTICLE_KEY = 0x636F73
_TRACK_STEP_PX = 0.1


def cosmic_ray_charge(
    sensor: Sensor, height: int, width: int, exposure_s: float, seed: int, frame_index: int
) -> Float32Array | None:
    """(H, W) electrons of the tracks, or None without any.

    Directions are even over the sky, so that the number through a flat layer goes with the cosine of the angle.
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
        turn = rng.uniform(0, 2 * np.pi)
        path_m = d.layer_m / cosine
        across_m = path_m * np.sqrt(1 - cosine**2)
        dx, dy = (
            across_m * np.cos(turn) / sensor.pixel_pitch_x_m,
            across_m * np.sin(turn) / sensor.pixel_pitch_y_m,
        )
        steps = max(int(np.hypot(dx, dy) / _TRACK_STEP_PX), 1)
        t = (np.arange(steps) + 0.5) / steps
        column, row = np.rint(x + dx * t).astype(int), np.rint(y + dy * t).astype(int)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        np.add.at(charge, (row[inside], column[inside]), np.float32(ELECTRONS_PER_M * path_m / steps))
    return charge
