"""The detector: blur keeps energy, noise has its variance, the seed alone decides."""

from itertools import pairwise

import numpy as np
import pytest

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.imaging.image_formation import digitise, expose, noise_sigma


def test_point_source_keeps_its_energy_through_the_psf():
    radiance = np.zeros((41, 41), np.float32)
    radiance[20, 20] = 100.0
    sensor = sensor_preset("speed")
    signal = expose(radiance, sensor, exposure_s=0.001)
    assert signal.sum() == pytest.approx(100.0 * 0.001 / sensor.full_scale_j_m2_sr, rel=1e-4)
    _rows, columns = np.mgrid[:41, :41] - 20.0
    variance = float((signal * columns**2).sum() / signal.sum())
    # the 7-tap kernel cuts the Gaussian at 3 sigma, which takes 3 % off its variance
    assert variance == pytest.approx(sensor.blur_sigma_px**2, rel=0.04)


@pytest.mark.parametrize("level", [0.3, 0.5, 0.7])
@pytest.mark.parametrize("preset", ["speed", "thesis", "ideal"])
def test_noise_has_the_recipe_s_mean_and_variance(preset, level):
    sensor = sensor_preset(preset)
    flat = np.full((600, 800), level, np.float32)
    image = digitise(flat, sensor, seed=3, frame_index=7) / 255.0
    # standard error of the mean and of the standard deviation with 480,000 samples, five sigma
    sigma = noise_sigma(sensor, level)
    assert abs(image.mean() - level) < 5 * sigma / np.sqrt(flat.size) + 0.5 / 255
    if preset != "ideal":
        assert image.std() == pytest.approx(sigma, rel=5 / np.sqrt(2 * flat.size) + 2e-3)


def test_frame_noise_depends_on_seed_and_frame_alone():
    sensor = sensor_preset("thesis")
    flat = np.full((120, 160), 0.4, np.float32)
    first = digitise(flat, sensor, seed=1, frame_index=5)
    digitise(flat, sensor, seed=1, frame_index=4)
    assert np.array_equal(first, digitise(flat, sensor, seed=1, frame_index=5))
    assert not np.array_equal(first, digitise(flat, sensor, seed=1, frame_index=6))
    assert not np.array_equal(first, digitise(flat, sensor, seed=2, frame_index=5))


def test_noise_is_white_across_the_bands_of_rows():
    sensor = sensor_preset("speed")
    image = digitise(np.full((256, 256), 0.5, np.float32), sensor, seed=0, frame_index=0).astype(float)
    bands = [image[k * 32 : (k + 1) * 32] - image.mean() for k in range(8)]
    for a, b in pairwise(bands):
        correlation = float((a * b).mean() / image.var())
        assert abs(correlation) < 5 / np.sqrt(a.size)
    assert abs(float((bands[0][:, 1:] * bands[0][:, :-1]).mean() / image.var())) < 5 / np.sqrt(bands[0].size)


def test_sixteen_bits_keep_sixteen_bits():
    sensor = sensor_preset("ideal")
    ramp = np.linspace(0, 1, 65536, dtype=np.float32).reshape(256, 256)
    from dataclasses import replace

    image = digitise(ramp, replace(sensor, bits=16), seed=0, frame_index=0)
    assert image.dtype == np.uint16
    assert len(np.unique(image)) > 65000
