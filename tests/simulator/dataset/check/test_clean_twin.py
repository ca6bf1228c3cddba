"""The check of the clean twin where the detector is warm: the image has the dark current's mean, the twin has not."""

from types import SimpleNamespace

import numpy as np
import pytest

from simulator.camera.detector.sensor import Detector, Sensor, noiseless
from simulator.dataset.check.clean_twin import check_clean
from simulator.imaging.image_formation import digitise

EXPOSURE_S = 0.1


def taken(sensor, level, exposure_s=EXPOSURE_S):
    """A smooth picture about a level: record, image, mask, clean twin."""
    signal = np.full((96, 128), level, np.float32) + np.linspace(-0.02, 0.02, 128, dtype=np.float32)
    image = digitise(signal, sensor, 1, 2, exposure_s)
    clean = digitise(signal, noiseless(sensor), 1, 2, exposure_s)
    mask = np.zeros((96, 128), np.uint8)
    mask[20:70, 20:100] = 255
    return SimpleNamespace(scene=SimpleNamespace(sensor=sensor, exposure_s=exposure_s)), image, mask, clean


def warm(dark_e_s=2500.0, **options):
    """3 to 4 sigma of dark current at a quarter of full scale."""
    detector = Detector(
        full_well_e=16_000.0, gain_e_per_dn=4.0, black_level_dn=40.0, dark_current_e_s=dark_e_s, **options
    )
    return Sensor(bits=12, detector=detector)


@pytest.mark.parametrize("level", [0.03, 0.25, 0.6])
@pytest.mark.parametrize("binning", [1, 2])
@pytest.mark.parametrize("temperature_c", [20.0, 27.0])
def test_a_warm_detector_s_picture_is_right(level, binning, temperature_c):
    sensor = warm(2500.0 / binning**2, binning=binning, temperature_c=temperature_c)
    assert check_clean(*taken(sensor, level)) == []


@pytest.mark.parametrize("level", [0.03, 0.25, 0.6])
def test_a_picture_without_the_heat_that_its_record_has_is_caught(level):
    truth, image, mask, clean = taken(warm(), level)
    cold = taken(warm(0.0), level)[1]
    assert check_clean(truth, cold, mask, clean)
    # and a twin that was given the heat
    heated = clean + np.uint16(2500 * EXPOSURE_S / 4)
    assert check_clean(truth, image, mask, heated)


def test_heat_is_of_the_exposure():
    truth, image, mask, clean = taken(warm(), 0.25)
    longer = SimpleNamespace(scene=SimpleNamespace(sensor=truth.scene.sensor, exposure_s=2 * EXPOSURE_S))
    assert check_clean(longer, image, mask, clean)
