"""Milliseconds of blur, noise and quantisation of a 1920 x 1200 picture by each built-in sensor.

As in a frame, a recipe's noise has been drawn before: while the renderer began.
"""

from __future__ import annotations

import time

import numpy as np

from simulator.bench.parts import PartCost, cost
from simulator.camera.detector.image_noise import start_noise
from simulator.camera.detector.presets import list_sensor_presets, sensor_preset
from simulator.imaging.image_formation import digitise, expose

SHAPE = (1200, 1920)
EXPOSURE_S = 1e-3
LAPS, WARM_UP = 12, 2
AHEAD_S = 0.03  # of the renderer's work


def bench_sensor() -> tuple[PartCost, ...]:
    """Each preset on a third of dark sky, a third of even grey, and a third that rises beyond saturation."""
    picture = np.zeros(SHAPE, np.float32)
    third = SHAPE[0] // 3
    costs = []
    for name in list_sensor_presets():
        sensor = sensor_preset(name)
        unit = float(expose(np.ones((1, 1), np.float32), sensor, EXPOSURE_S)[0, 0])
        picture[third : 2 * third] = 0.5 / unit
        picture[2 * third :] = np.linspace(0, 1.2 / unit, SHAPE[1], dtype=np.float32)
        laps = []
        for k in range(LAPS + WARM_UP):
            noise = start_noise(SHAPE, sensor, 1, k)
            time.sleep(AHEAD_S)
            start = time.perf_counter()
            digitise(expose(picture, sensor, EXPOSURE_S), sensor, 1, k, EXPOSURE_S, noise=noise)
            laps.append((time.perf_counter() - start) * 1e3)
        costs.append(cost(f"{name}, 1920 x 1200", laps[WARM_UP:]))
    return tuple(costs)
