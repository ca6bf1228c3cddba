"""Width of the blur against the requested one, for each kind of point-spread function."""

import numpy as np
import pytest

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.psf import (
    applied_mtf,
    gaussian_variance_px2,
)
from flyaround.simulator.camera.detector.sensor import Sensor

SENSOR = Sensor(preset="t", blur_sigma_px=0.9, pixel_pitch_x_m=5e-6, pixel_pitch_y_m=5e-6)
FREQUENCY = np.linspace(0, 0.4, 9)


def test_the_recipe_s_blur_and_the_lens_s_add_as_variances():
    assert gaussian_variance_px2(Optics(psf="gaussian", psf_sigma_px=1.2), SENSOR) == pytest.approx(
        0.81 + 1.44
    )
    assert gaussian_variance_px2(Optics(psf="airy", psf_sigma_px=1.2), SENSOR) == pytest.approx(0.81 + 1.44)
    kernel = ((0.0, 0.1, 0.0), (0.1, 0.6, 0.1), (0.0, 0.1, 0.0))
    assert gaussian_variance_px2(Optics(psf="kernel", kernel=kernel), SENSOR) == pytest.approx(0.81)
    wanted = np.exp(-2 * np.pi**2 * FREQUENCY**2 * (0.81 + 1.44))
    used = applied_mtf(FREQUENCY, 0 * FREQUENCY, Optics(psf="gaussian", psf_sigma_px=1.2), SENSOR)
    np.testing.assert_allclose(used, wanted, atol=0.01)  # taps end at three sigma
