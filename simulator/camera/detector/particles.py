"""Charge that ionising particles leave on a detector during one exposure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.camera.detector.deviates import bit_source

if TYPE_CHECKING:
    from simulator.camera.detector.sensor import Sensor
    from simulator.runtime.arrays import Float32Array

ELECTRONS_PER_M = 80e6
"""Minimum-ionising particle in silicon: Janesick (2001), Scientific charge-coupled devices, section 8."""
_KEY = 0x636F73
_STEP_PX = 0.1


def cosmic_ray_charge(
    sensor: Sensor, height: int, width: int, exposure_s: float, seed: int, frame_index: int
) -> Float32Array | None:
    """(H, W) electrons of the tracks, or None without any.

    Directions are even over the sky, so that the number through a flat layer goes with the cosine of the angle.
    """
    d = sensor.detector
    if d is None or d.cosmic_rays_cm2_s <= 0:
        return None
    rng = np.random.Generator(bit_source(seed, frame_index, _KEY))
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
        steps = max(int(np.hypot(dx, dy) / _STEP_PX), 1)
        t = (np.arange(steps) + 0.5) / steps
        column, row = np.rint(x + dx * t).astype(int), np.rint(y + dy * t).astype(int)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        np.add.at(charge, (row[inside], column[inside]), np.float32(ELECTRONS_PER_M * path_m / steps))
    return charge
