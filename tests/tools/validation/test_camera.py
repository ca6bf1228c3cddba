"""The camera's proof in short: EMVA 1288 on the built-in detectors, photon noise, transfer function."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.camera.detector.presets import sensor_preset
from tools.validation.camera.counts import electron_chance, reading_chance
from tools.validation.camera.emva1288 import (
    READOUT_MODES,
    measure,
    measure_colours,
    photon_transfer,
    without_nonuniformity,
)
from tools.validation.camera.mtf import CASES, compare
from tools.validation.camera.report import COLOUR_GOAL, GOALS, MTF_GOAL, OTHER_GOAL


def test_photon_transfer_gives_the_data_sheet_s_gain_and_read_noise():
    for name in ("imx174", "cmv4000"):
        sensor = sensor_preset(name)
        gain, noise = photon_transfer(sensor, 3)
        assert gain == pytest.approx(1 / sensor.detector.gain_e_per_dn, rel=0.01)
        # the columns' own noise is in the pictures too
        expected = np.hypot(sensor.detector.read_noise_e, sensor.detector.column_noise_e)
        assert noise == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("way", READOUT_MODES)
def test_electrons_per_digital_number_of_each_colour(way):
    """imx174 as a colour detector: 8.16 e/DN, over the white balance of sunlight in 100 nm bands."""
    found = measure_colours("imx174", mode=way, levels=12)
    # photons of a white plate: irradiance (G173) x wavelength, 159.0 x 648.6, 184.75 x 549.7, 186.4 x 451.7
    factors = np.array([1.0, 1.0155, 1.2248]) if way != READOUT_MODES[0] else np.ones(3)
    assert [1 / m.given for m in found] == pytest.approx(8.16 / factors, rel=2e-3)
    for m in found:
        assert abs(m.error) <= COLOUR_GOAL, m


@pytest.mark.slow
@pytest.mark.parametrize("name", ["imx174", "cmv4000"])
def test_every_term_is_recovered_by_emva_1288(name):
    for m in measure(name):
        assert abs(m.error) <= GOALS.get(m.name, OTHER_GOAL), m


@pytest.mark.parametrize("mean", [0.004, 0.5, 3.0, 11.97, 12.5, 30.0, 3000.0])
def test_counts_are_poisson(mean):
    assert electron_chance(mean)[2] > 1e-3


@pytest.mark.parametrize("name", ["imx174", "cmv4000"])
@pytest.mark.parametrize("share", [0.0, 1e-4, 0.01, 0.5, 0.99, 1.0, 1.2])
def test_digital_numbers_follow_photons_well_and_read_noise(name, share):
    sensor = without_nonuniformity(sensor_preset(name))
    assert reading_chance(sensor, share * sensor.saturation_e)[2] > 1e-3


@pytest.mark.parametrize("read_noise_e", [0.5, 1.9, 2.1])
def test_a_detector_that_counts_electrons_shows_them_one_by_one(read_noise_e):
    base = without_nonuniformity(sensor_preset("imx174"))
    detector = replace(base.detector, gain_e_per_dn=0.25, read_noise_e=read_noise_e, full_well_e=900.0)
    for mean_e in (0.3, 6.0, 200.0, 890.0):
        assert reading_chance(replace(base, detector=detector), mean_e)[2] > 1e-3


@pytest.mark.parametrize("case", CASES)
def test_the_edge_s_transfer_function_is_the_psf_s(case):
    found, ideal, used = compare(case)
    assert np.abs(found - used).max() <= MTF_GOAL
    assert np.abs(found - ideal).max() <= MTF_GOAL
