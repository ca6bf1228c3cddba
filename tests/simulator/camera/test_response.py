"""Electrons from sunlight: integrals of spectrum, glass and quantum efficiency over the band."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from scenario_text import GOOD, write

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.detector.readout import detect
from flyaround.simulator.camera.detector.response import electrons_per_radiance, white_balance
from flyaround.simulator.camera.detector.sensor import Detector, Sensor, noiseless
from flyaround.simulator.camera.sections import DetectorSection
from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.image_formation import expose
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.illumination.bands import bands_of, sunlight_balance

# ASTM E490-00a (2006), zero air mass solar spectral irradiance, mean of each 10 nm from 400 nm [W m-2 nm-1]: another
# compilation than the one in the code (G173). Its integral over 450 to 750 nm is 0.1 % off ours.
# fmt: off
E490_W_M2_NM = np.array([
    1.685, 1.729, 1.659, 1.675, 1.932, 2.032, 2.016, 2.012, 1.931, 1.952, 1.908, 1.832, 1.866, 1.893, 1.861, 1.853,
    1.840, 1.838, 1.813, 1.785, 1.754, 1.702, 1.685, 1.651, 1.607, 1.533, 1.552, 1.511, 1.471, 1.434, 1.396, 1.361,
    1.339, 1.307, 1.275,
])
# fmt: on
CAMERA = {"pixel_pitch_x_m": 5e-6, "pixel_pitch_y_m": 5e-6}
LENS = Optics(f_number=2.0, transmission=0.8)
FLAT = ((300e-9, 0.5), (1100e-9, 0.5))
FRONT_LIT = ((400e-9, 0.40), (525e-9, 0.76), (600e-9, 0.66), (700e-9, 0.42), (800e-9, 0.25))
BACK_LIT = ((350e-9, 0.50), (450e-9, 0.85), (550e-9, 0.95), (650e-9, 0.93), (750e-9, 0.85), (900e-9, 0.5))
RED_ENHANCED = ((400e-9, 0.20), (500e-9, 0.30), (600e-9, 0.55), (700e-9, 0.80), (800e-9, 0.90))
FILTER = ((560e-9, 0.0), (570e-9, 0.9), (690e-9, 0.9), (700e-9, 0.0))


def detector(curve=(), **changes):
    return Sensor(
        detector=Detector(quantum_efficiency_curve=curve, **changes), blur_sigma_px=0.0, bits=12, **CAMERA
    )


def electrons_by_hand(low_nm, high_nm, curve, filtered=()):
    """Electrons a second of a pixel that looks at a white plate in the Sun: photons of E490, nanometre by nanometre."""
    wavelength = np.arange(low_nm, high_nm) + 0.5
    # the plate reflects all light evenly, the lens takes pi / (4 N^2) of its radiance
    on_pixel = E490_W_M2_NM[((wavelength - 400) // 10).astype(int)] / np.pi * np.pi / 16 * 0.8 * 25e-12
    share = np.interp(wavelength * 1e-9, *np.array(curve).T, left=0, right=0)
    if filtered:
        share = share * np.interp(wavelength * 1e-9, *np.array(filtered).T, left=0, right=0)
    return np.sum(on_pixel * share * wavelength * 1e-9 / (6.62607015e-34 * 299792458.0))


@pytest.mark.parametrize("filtered", [(), FILTER])
@pytest.mark.parametrize("curve", [FLAT, FRONT_LIT, BACK_LIT, RED_ENHANCED])
@pytest.mark.parametrize("bands", ["mono", "rgb"])
def test_a_white_plate_in_the_sun_gives_the_electrons_of_its_photons(bands, curve, filtered):
    lens = replace(LENS, transmission_curve=filtered)
    each = bands_of(bands)
    per_radiance = electrons_per_radiance(detector(curve), lens, 1.0, len(each))
    for band, per_unit in zip(each, per_radiance, strict=True):
        by_hand = electrons_by_hand(band.low_nm, band.high_nm, curve, filtered)
        # the two published spectra differ by up to 0.3 % in 50 nm; a filter's edge inside such a step makes it 1 %
        assert per_unit * band.sun_irradiance_w_m2 / np.pi == pytest.approx(by_hand, rel=0.01, abs=1e-6)


def test_one_number_is_a_level_curve_and_sunlight_has_seven_per_cent_more_photons_than_at_550_nm():
    number, curve = (
        float(electrons_per_radiance(s, LENS, 1.0, 1)[0])
        for s in (detector(quantum_efficiency=(0.5,)), detector(FLAT))
    )
    assert number == pytest.approx(curve, rel=1e-12)
    at_550_nm = np.pi / 16 * 0.8 * 25e-12 * 0.5 * 550e-9 / (6.62607015e-34 * 299792458.0)
    assert number / at_550_nm == pytest.approx(1.070, abs=0.003)
    # and the black body of the Sun's 5772 K agrees (its mean wavelength is within a hundredth of the Sun's own)
    wavelength = np.arange(450.5, 750)
    planck = wavelength**-5.0 / np.expm1(1.438777e7 / (wavelength * 5772))
    assert number / at_550_nm == pytest.approx(planck @ wavelength / planck.sum() / 550, rel=0.01)


@pytest.mark.parametrize("name", ["imx174", "cmv4000"])
def test_wavelength_affects_only_diffraction(name):
    scenario = load_scenario("tango-space-10m")
    sensor = sensor_preset(name)
    flat = np.full((64, 64), 20.0, np.float32)
    signals = []
    for nm in (400.0, 550.0, 700.0):
        section = msgspec.structs.replace(scenario.optics, wavelength_nm=nm, psf="airy", f_number=4.0)
        signals.append(expose(flat, sensor, 1e-4, optics=section.optics()))
    # an even picture stays as bright under any PSF
    for signal in signals:
        assert signal == pytest.approx(signals[0], rel=1e-5)


@pytest.mark.parametrize("curve", [(), FRONT_LIT, RED_ENHANCED])
def test_white_balance_makes_a_white_plate_in_sunlight_grey(curve):
    sensor = noiseless(detector(curve, quantum_efficiency=(0.5, 0.6, 0.4), black_level_dn=32.0))
    lens = replace(LENS, transmission_curve=((400e-9, 0.7), (700e-9, 0.95)))
    sun = np.array([band.sun_irradiance_w_m2 for band in bands_of("rgb")]) / np.pi
    plate = np.broadcast_to(
        (sun * electrons_per_radiance(sensor, lens, 1e-5, 3)).astype(np.float32), (8, 8, 3)
    )
    signal = plate / np.float32(sensor.saturation_e)
    balance = white_balance(sensor, lens, sunlight_balance("rgb"))
    assert balance.min() == 1
    balanced = detect(signal, sensor, 0, 0, 1e-5, balance).astype(float) - 32
    assert balanced.reshape(-1, 3).mean(axis=0) == pytest.approx(np.full(3, balanced.mean()), rel=0.02)
    raw = detect(signal, sensor, 0, 0, 1e-5).astype(float).reshape(-1, 3).mean(axis=0) - 32
    assert raw.max() / raw.min() > 1.1


@pytest.mark.parametrize(
    ("table", "complaint"),
    [
        ("[sensor.detector]\nquantum_efficiency_curve = [[500, 0.5], [450, 0.4]]", "ascending"),
        ("[sensor.detector]\nquantum_efficiency_curve = [[500, 0.5]]", "two or more"),
        (
            "[sensor.detector]\nquantum_efficiency_curve = [[500, 0.5], [600, 1.5]]",
            "quantum_efficiency_curve",
        ),
        ("[sensor.detector]\nquantum_efficiency_curve = [[300, 0.5], [400, 0.5]]", "between 450 and 750 nm"),
        ("[optics]\ntransmission_curve = [[500, 0.5], [500, 0.4]]", "ascending"),
        ("[optics]\ntransmission_curve = [[100, 0.5], [500, 0.4]]", "transmission_curve"),
    ],
)
def test_invalid_spectral_curve_is_refused(tmp_path, table, complaint):
    sensor = GOOD.replace('preset = "speed"', 'preset = "imx174"')
    with pytest.raises(UserError, match=complaint):
        load_scenario(write(tmp_path, sensor + table))


def test_a_curve_of_the_scenario_arrives_and_a_number_takes_its_place(tmp_path):
    table = """
[sensor.detector]
quantum_efficiency_curve = [[450, 0.5], [750, 0.3]]
[optics]
transmission_curve = [[400, 0.9], [800, 0.7]]
"""
    scenario = load_scenario(write(tmp_path, GOOD + table))
    sensor, lens = scenario.sensor_model, scenario.optics.optics()
    assert np.allclose(sensor.detector.quantum_efficiency_curve, ((450e-9, 0.5), (750e-9, 0.3)), rtol=1e-12)
    assert np.allclose(lens.transmission_curve, ((400e-9, 0.9), (800e-9, 0.7)), rtol=1e-12)
    number = DetectorSection(quantum_efficiency=[0.4]).detector(sensor.detector)
    assert number.quantum_efficiency_curve == ()


def test_records_from_before_there_were_curves_are_read():
    assert msgspec.convert({"quantum_efficiency": [0.5]}, Detector).quantum_efficiency_curve == ()
    assert msgspec.convert({"f_number": 2.0}, Optics).transmission_curve == ()
