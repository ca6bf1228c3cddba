"""Two pictures of one scene, of different noise, are the same one: also of a detector that is much balanced."""

from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.readout import detect
from flyaround.simulator.camera.detector.response import white_balance
from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.dataset.check.clean_twin import band_gains
from flyaround.simulator.dataset.check.redraw import check_same_picture
from flyaround.simulator.scene.illumination.bands import sunlight_balance

EXPOSURE_S = 0.1

LINEAR = SimpleNamespace(pixel_encoding="linear")


def scene_of(sensor):
    return SimpleNamespace(
        camera=LINEAR, scene=SimpleNamespace(sensor=sensor, optics=Optics(), exposure_s=EXPOSURE_S)
    )


def taken(sensor, seed, level):
    """A grey card whose weakest band is a tenth of the others, balanced."""
    balance = white_balance(sensor, Optics(), sunlight_balance("rgb"))
    signal = np.broadcast_to((level / balance).astype(np.float32), (200, 200, 3))
    return detect(np.ascontiguousarray(signal), sensor, seed, 0, EXPOSURE_S, balance)


def sensor_of(blue, **options):
    detector = Detector(
        quantum_efficiency=(0.6, 0.6, blue),
        full_well_e=4_000.0,
        gain_e_per_dn=1.0,
        read_noise_e=12.0,
        **options,
    )
    return Sensor(bits=14, detector=detector)


@pytest.mark.parametrize("level", [0.05, 0.3])
@pytest.mark.parametrize("colour_filter", ["none", "rggb"])
@pytest.mark.parametrize("blue", [0.03, 0.4])
def test_noise_that_white_balance_multiplies_is_noise(blue, colour_filter, level):
    sensor = sensor_of(blue, colour_filter=colour_filter, black_level_dn=100.0)
    truth, mask = scene_of(sensor), np.zeros((200, 200), np.uint8)
    assert (band_gains(truth).max() > 10) == (blue < 0.1)
    first, second = (taken(sensor, seed, level) for seed in (1, 2))
    assert check_same_picture(truth, first, second, mask) == []
    brighter = taken(sensor, 1, level + 0.35)
    assert check_same_picture(truth, brighter, second, mask)


def test_a_black_level_is_no_light_whose_noise_would_hide_a_change():
    """Of 3,000 numbers of black level the shot noise would be 14 times the read noise that there is."""
    sensor = Sensor(
        bits=14,
        detector=Detector(full_well_e=4_000.0, gain_e_per_dn=1.0, read_noise_e=4.0, black_level_dn=3_000.0),
    )
    truth, mask = scene_of(sensor), np.zeros((200, 200), np.uint8)
    dark, other, lit = (
        detect(np.full((200, 200), level, np.float32), sensor, seed, 0, EXPOSURE_S)
        for seed, level in ((1, 0.0), (2, 0.0), (3, 0.017))
    )
    assert check_same_picture(truth, dark, other, mask) == []
    assert check_same_picture(truth, lit, dark, mask)


def test_a_noise_recipe_has_no_white_balance():
    assert np.array_equal(band_gains(scene_of(Sensor(bits=8))), np.eye(3))
