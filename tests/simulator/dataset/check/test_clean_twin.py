"""The check of the clean twin: good frames of every detector pass, a twin of another image does not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.detector.response import white_balance
from flyaround.simulator.camera.detector.sensor import Detector, Sensor, noiseless, with_bits
from flyaround.simulator.camera.detector.transfer import converter, encode_numbers
from flyaround.simulator.dataset.check.clean_twin import check_clean
from flyaround.simulator.imaging.image_formation import digitise
from flyaround.simulator.scene.illumination.bands import sunlight_balance

EXPOSURE_S = 0.1

LINEAR = SimpleNamespace(pixel_encoding="linear")


def taken(sensor, level, exposure_s=EXPOSURE_S):
    """A smooth picture about a level: record, image, mask, clean twin."""
    signal = np.full((96, 128), level, np.float32) + np.linspace(-0.02, 0.02, 128, dtype=np.float32)
    image = digitise(signal, sensor, 1, 2, exposure_s)
    clean = digitise(signal, noiseless(sensor), 1, 2, exposure_s)
    mask = np.zeros((96, 128), np.uint8)
    mask[20:70, 20:100] = 255
    return (
        SimpleNamespace(camera=LINEAR, scene=SimpleNamespace(sensor=sensor, exposure_s=exposure_s)),
        image,
        mask,
        clean,
    )


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
    longer = SimpleNamespace(
        camera=LINEAR, scene=SimpleNamespace(sensor=truth.scene.sensor, exposure_s=2 * EXPOSURE_S)
    )
    assert check_clean(longer, image, mask, clean)


def sky_and_craft(sensor, level, exposure_s, colours=None, encoding="linear"):
    """A black sky, an Earth of a level on its left and a craft of a third of that: record, image, mask, clean twin.

    Parameters
    ----------
    colours : of Earth and craft, over white in sunlight; one band without.
    """
    mask = np.zeros((96, 128), np.uint8)
    mask[20:70, 20:100] = 255
    light = np.float32(0.02 * level) * np.linspace(0, 1, 128, dtype=np.float32) + np.float32(level / 3) * (
        mask > 0
    )
    light[:, :40] += np.float32(level)
    balance = 1.0
    if colours is not None:
        balance = sunlight_balance("rgb")
        balance = balance if sensor.detector is None else white_balance(sensor, Optics(), balance)
        light = (light[..., None] * np.asarray(colours) / balance).astype(np.float32)
    image, clean = (
        encode_numbers(digitise(light, converter(s, encoding), 1, 2, exposure_s, balance), s, encoding)
        for s in (sensor, noiseless(sensor))
    )
    scene = SimpleNamespace(
        sensor=sensor, exposure_s=exposure_s, optics=Optics(), bands="mono" if colours is None else "rgb"
    )
    return SimpleNamespace(camera=SimpleNamespace(pixel_encoding=encoding), scene=scene), image, mask, clean


def detector_of(preset, bits, colour_filter="none", noise=1.0):
    sensor = with_bits(sensor_preset(preset), bits)
    d = sensor.detector
    more = {"read_noise_e": d.read_noise_e * noise, "dsnu_e": d.dsnu_e * noise}
    return replace(sensor, detector=replace(d, colour_filter=colour_filter, **more))


WHITE, BLUE, RED = (1, 1, 1), (0.4, 0.7, 1.2), (1.2, 0.6, 0.3)


@pytest.mark.parametrize("preset", ["imx174", "cmv4000"])
@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize(
    ("colours", "colour_filter"),
    [(None, "none"), (BLUE, "none"), (RED, "none"), (WHITE, "rggb"), (BLUE, "gbrg")],
)
def test_good_frames_of_detectors_pass_at_every_depth(preset, bits, colours, colour_filter):
    for level, exposure_s, noise in (
        (0.0005, 1e-4, 0.1),
        (0.05, 0.5, 0.1),
        (0.2, 0.5, 0.1),
        (0.5, 1e-4, 1.0),
        (0.9, 1e-4, 3.0),
    ):
        sensor = detector_of(preset, bits, colour_filter, noise)
        assert check_clean(*sky_and_craft(sensor, level, exposure_s, colours)) == []


@pytest.mark.parametrize("preset", ["speed", "thesis"])
@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("colours", [None, WHITE, RED])
def test_good_frames_of_noise_recipes_pass(preset, bits, colours):
    sensor = with_bits(sensor_preset(preset), bits)
    for level in (0.001, 0.1, 0.9):
        assert check_clean(*sky_and_craft(sensor, level, 1e-3, colours)) == []


@pytest.mark.parametrize("encoding", ["srgb", "gamma"])
@pytest.mark.parametrize("colours", [WHITE, BLUE, RED])
@pytest.mark.parametrize("preset", ["speed", "thesis", "imx174"])
def test_good_encoded_frames_in_colour_pass_and_others_are_caught(preset, colours, encoding):
    sensor = detector_of(preset, 8) if preset == "imx174" else sensor_preset(preset)
    for level in (0.05, 0.2, 0.6):
        truth, image, mask, clean = sky_and_craft(sensor, level, 1e-3, colours, encoding)
        assert check_clean(truth, image, mask, clean) == []
    for channel in range(3):
        brighter = image.copy()
        brighter[..., channel] = np.clip(image[..., channel].astype(int) + 60, 0, 255)
        assert check_clean(truth, brighter, mask, clean)


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("colour_filter", ["none", "rggb"])
def test_a_twin_of_another_image_is_caught_in_any_band(bits, colour_filter):
    sensor = detector_of("imx174", bits, colour_filter)
    truth, image, mask, clean = sky_and_craft(sensor, 0.5, 1e-3, BLUE)
    assert check_clean(truth, image, mask, clean) == []
    step = 2 ** (bits - 8) * 4
    for band, name in enumerate(("red", "green", "blue")):
        brighter, darker, flat = clean.copy(), clean.copy(), image.copy()
        brighter[..., band] += np.array(step, clean.dtype)
        darker[..., band] -= np.minimum(darker[..., band], np.array(step, clean.dtype))
        assert f"({name})" in check_clean(truth, image, mask, brighter)[0]
        assert f"({name})" in check_clean(truth, image, mask, darker)[0]
        if bits == 12:  # an image without the noise that its record has
            flat[..., band] = clean[..., band]
            assert f"({name})" in check_clean(truth, flat, mask, clean)[0]
    assert check_clean(truth, np.ascontiguousarray(image[..., ::-1]), mask, clean)
    assert check_clean(truth, image, mask, np.ascontiguousarray(clean[:, ::-1]))
