"""The camera's proof in short: EMVA 1288 on the built-in detectors, photon noise, transfer function."""

import numpy as np
import pytest

from simulator.camera.presets import sensor_preset
from simulator.validation.camera import GOALS, MTF_GOAL, OTHER_GOAL
from simulator.validation.camera_mtf import CASES, compare
from simulator.validation.camera_sensor import measure, photon_transfer, poisson_chance


def test_photon_transfer_gives_the_data_sheet_s_gain_and_read_noise():
    for name in ("imx174", "cmv4000"):
        sensor = sensor_preset(name)
        gain, noise = photon_transfer(sensor, 3)
        assert gain == pytest.approx(1 / sensor.detector.gain_e_per_dn, rel=0.01)
        # the columns' own noise is in the pictures too
        expected = np.hypot(sensor.detector.read_noise_e, sensor.detector.column_noise_e)
        assert noise == pytest.approx(expected, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["imx174", "cmv4000"])
def test_every_term_is_recovered_by_emva_1288(name):
    for m in measure(name):
        assert abs(m.error) <= GOALS.get(m.name, OTHER_GOAL), m


@pytest.mark.parametrize("mean", [0.5, 3.0, 30.0, 3000.0])
def test_counts_are_poisson(mean):
    assert poisson_chance(mean)[2] > 1e-3


@pytest.mark.parametrize("case", CASES)
def test_the_edge_s_transfer_function_is_the_psf_s(case):
    found, ideal, used = compare(case)
    assert np.abs(found - used).max() <= MTF_GOAL
    assert np.abs(found - ideal).max() <= MTF_GOAL
