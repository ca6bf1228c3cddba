"""The additive noise that is drawn ahead is the noise of the picture."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.detector.image_noise import MIN_THREADED_VALUES, start_noise
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.imaging.image_formation import digitise


@pytest.mark.parametrize("shape", [(300, 512), (200, 300, 3), (40, 50)])
@pytest.mark.parametrize(("preset", "bits"), [("speed", 8), ("speed", 12), ("thesis", 8)])
def test_noise_drawn_ahead_changes_no_byte(shape: tuple[int, ...], preset: str, bits: int) -> None:
    sensor = replace(sensor_preset(preset), bits=bits)
    signal = np.random.default_rng(1).random(shape, np.float32)
    ahead = start_noise(shape, sensor, 5, 9)
    start_noise(shape, sensor, 5, 10)()  # another frame's, between the two
    assert np.array_equal(digitise(signal, sensor, 5, 9, noise=ahead), digitise(signal, sensor, 5, 9))


def test_rows_and_frames_share_no_noise() -> None:
    size = (512, MIN_THREADED_VALUES // 256)
    sensor = sensor_preset("speed")
    grey = np.full(size, 0.5, np.float32)
    first, second = (digitise(grey, sensor, 1, k).astype(float) - 127.5 for k in (0, 1))
    for a, b in ((first, second), (first[:-1], first[1:]), (first[:, :-1], first[:, 1:])):
        # of independent values: one over the root of their number
        assert abs(np.corrcoef(a.ravel(), b.ravel())[0, 1]) < 4 / np.sqrt(a.size)
