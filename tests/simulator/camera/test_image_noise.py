"""Additive noise drawn ahead of the image equals noise drawn with it."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.detector.image_noise import start_noise
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.imaging.image_formation import digitise


@pytest.mark.parametrize("shape", [(300, 512), (200, 300, 3), (40, 50)])
@pytest.mark.parametrize(("preset", "bits"), [("speed", 8), ("speed", 12), ("thesis", 8)])
def test_noise_drawn_ahead_changes_no_byte(shape, preset, bits):
    sensor = replace(sensor_preset(preset), bits=bits)
    signal = np.random.default_rng(1).random(shape, np.float32)
    ahead = start_noise(shape, sensor, 5, 9)
    start_noise(shape, sensor, 5, 10)()  # another frame's, between the two
    assert np.array_equal(digitise(signal, sensor, 5, 9, noise=ahead), digitise(signal, sensor, 5, 9))
