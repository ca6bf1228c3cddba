"""Encoded images: the curves, the camera's default encoding, and decoding."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.hil.board.encoding import linear_picture
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.detector.response import SRGB_FROM_BANDS
from flyaround.simulator.camera.detector.transfer import (
    converter,
    decode_numbers,
    default_encoding,
    encode_numbers,
    encoding_problem,
)
from flyaround.simulator.camera.encoding import decode, encode, step_share
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.imaging.display import display_picture

CURVES = ("srgb", "gamma")
EIGHT = np.arange(256, dtype=np.uint8)


@pytest.mark.parametrize("encoding", ["linear", *CURVES])
def test_decode_inverts_encode(encoding):
    light = np.linspace(0, 1, 1001)
    assert decode(encode(light, encoding), encoding) == pytest.approx(light, abs=1e-12)


def test_srgb_matches_the_standard():
    # IEC 61966-2-1:1999: middle grey of 18 % is 118 of 255, half of the light 188; the toe is straight
    assert np.rint(255 * encode([0.18, 0.5, 1.0], "srgb")).tolist() == [118, 188, 255]
    assert encode(0.001, "srgb") == pytest.approx(0.01292)


@pytest.mark.parametrize("encoding", CURVES)
@pytest.mark.parametrize("preset", ["speed", "imx174"])
def test_a_delivered_image_gives_its_light_back_to_half_a_step(encoding, preset):
    sensor = replace(sensor_preset(preset), bits=8)
    if sensor.detector is not None:
        detector = replace(sensor.detector, black_level_dn=4.0, gain_e_per_dn=8.16 * 16)
        sensor = replace(sensor, detector=detector)
    linear = converter(sensor, encoding)
    black = linear.scale_dn[1]
    numbers = np.arange(round(black), 2**linear.bits, dtype=np.uint16)
    image = encode_numbers(numbers, sensor, encoding)
    assert image.dtype == np.uint8
    assert (image[0], image[-1]) == (0, 255)
    back, of = decode_numbers(image, sensor, encoding)
    assert of == linear
    top = 2**linear.bits - 1 - black
    off = np.abs(back.astype(float) - numbers) / top
    assert (off <= 0.5 * step_share((numbers - black) / top, encoding) + 1 / top).all()


@pytest.mark.parametrize("encoding", CURVES)
def test_the_board_reads_what_the_camera_wrote(encoding):
    light = decode(EIGHT / 255, encoding)
    assert np.array_equal(linear_picture(EIGHT, encoding), np.rint(255 * light).astype(np.uint8))
    with pytest.raises(ValueError, match="8 bits"):
        linear_picture(EIGHT.astype(np.uint16), encoding)
    with pytest.raises(ValueError, match="unknown"):
        linear_picture(EIGHT, "hlg")


def test_colour_of_eight_bits_is_srgb_and_all_else_linear():
    eight, twelve = sensor_preset("speed"), sensor_preset("imx174")
    assert default_encoding(eight, "rgb") == "srgb"
    assert default_encoding(eight, "mono") == default_encoding(twelve, "rgb") == "linear"
    assert "12" in str(encoding_problem("srgb", twelve))
    detector = replace(twelve.detector, colour_filter="rggb", demosaic=False)
    assert "mosaic" in str(encoding_problem("srgb", replace(twelve, bits=8, detector=detector)))


def test_linear_encoding_equals_the_default():
    plain = {
        "width_px": 640,
        "height_px": 480,
        "fx_px": 800.0,
        "fy_px": 800.0,
        "cx_px": 319.5,
        "cy_px": 239.5,
    }
    assert Camera(**plain, encoding="linear") == Camera(**plain)
    assert Camera(**plain, encoding="srgb") != Camera(**plain)


def test_a_screen_shows_black_as_black_and_full_scale_as_white_of_every_camera():
    for bits, encoding in ((8, "linear"), (12, "linear"), (8, "srgb")):
        sensor = replace(sensor_preset("ideal"), bits=bits)
        image = np.array([[0, 2 ** (bits - 1), 2**bits - 1]], np.uint16 if bits > 8 else np.uint8)
        shown = display_picture(image, sensor, encoding)[0]
        assert shown[[0, 2]].tolist() == [0, 255]
        # half of the light is shown brighter than half of sRGB's scale; half of an encoded scale nearly as it is
        assert shown[1] > 185 if encoding == "linear" else 120 < shown[1] < 150


def four_colours(sensor, encoding):
    """Numbers (1, 4, 3) of a detector for grey, sky, foil and full scale."""
    light = np.array([[[0.3, 0.3, 0.3], [0.2, 0.35, 0.6], [0.8, 0.6, 0.25], [1.0, 1.0, 1.0]]])
    full, black = converter(sensor, encoding).scale_dn
    return light, np.rint(black + light * full).astype(np.uint16)


@pytest.mark.parametrize("black", [0.0, 4.0])
def test_srgb_in_colour_has_the_primaries_of_srgb_and_all_else_those_of_the_detector(black):
    sensor = replace(sensor_preset("imx174"), bits=8)
    detector = replace(sensor.detector, black_level_dn=black, gain_e_per_dn=33_000 / (255 - black))
    sensor = replace(sensor, detector=replace(detector, full_well_e=33_000.0))
    for encoding in CURVES:
        light, numbers = four_colours(sensor, encoding)
        wanted = light @ np.transpose(SRGB_FROM_BANDS) if encoding == "srgb" else light
        image = encode_numbers(numbers, sensor, encoding)
        assert image == pytest.approx(255 * encode(np.clip(wanted, 0, 1), encoding), abs=0.6)
        assert len(set(image[0, 0].tolist())) == 1  # grey stays grey
    light, numbers = four_colours(sensor, "linear")
    assert np.array_equal(encode_numbers(numbers, sensor, "linear"), numbers)


def test_a_screen_shows_one_colour_whatever_the_encoding():
    sensor = sensor_preset("ideal")
    shown = [
        display_picture(
            encode_numbers(four_colours(sensor, encoding)[1], sensor, encoding).astype(np.uint8),
            sensor,
            encoding,
        )
        for encoding in ("linear", *CURVES)
    ]
    for other in shown[1:]:
        assert shown[0].astype(float) == pytest.approx(other, abs=3)
