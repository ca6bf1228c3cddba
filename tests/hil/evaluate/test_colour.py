"""Pictures in colour and of 16 bits: taken in grey, estimated, and said to be so; the same by `flyaround.estimate`."""

import json
import shutil

import cv2
import jsonschema
import msgspec
import numpy as np
import pytest

import flyaround as fa
from flyaround.__main__ import run
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.metrics import Metrics
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

TIME_S = 3.0


@pytest.fixture(scope="module")
def mono(tmp_path_factory):
    """A data set of one frame before black space, where the pose is accepted."""
    folder = tmp_path_factory.mktemp("colour") / "mono"
    capture(plan_flight(load_scenario("tango-space-10m"), times=(TIME_S,)), folder)
    return folder


@pytest.fixture(scope="module")
def colour(mono):
    """The same as another camera would have written it: in colour, each channel one third off."""
    folder = mono.with_name("colour")
    shutil.copytree(mono, folder)
    path = folder / "images" / "000000.png"
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED).astype(float)
    channels = [np.clip(image * factor, 0, 255) for factor in (0.7, 0.9, 1.1)]
    cv2.imwrite(str(path), np.rint(np.dstack(channels)).astype(np.uint8))
    return folder


def test_grey_is_the_mean_of_the_channels_in_the_same_bits():
    image = np.array([[[10, 20, 60], [65535, 65535, 65535]]], np.uint16)
    assert grey(image).tolist() == [[30, 65535]]
    assert grey(image).dtype == np.uint16
    assert grey(image[..., 0]).tolist() == [[10, 65535]]


def test_colour_is_evaluated_in_grey_and_that_is_said(colour, tmp_path, capsys):
    report = tmp_path / "report"
    assert run(["evaluate", str(colour), "-o", str(report)]) == 0
    assert "pictures: colour, taken in grey (the mean of the three channels)" in capsys.readouterr().out
    metrics = json.loads((report / "metrics.json").read_text())
    jsonschema.validate(metrics, msgspec.json.schema(Metrics))
    assert metrics["coarse_success"] == 1
    assert metrics["grey_from_colour"] is True
    assert "taken in grey" in metrics["pictures"]
    assert "taken in grey" in (report / "index.html").read_text()


def test_colour_and_deep_pictures_are_estimated_and_what_was_done_is_said(mono, colour, tmp_path, capsys):
    deep = tmp_path / "deep.png"
    cv2.imwrite(str(deep), read_png(mono / "images" / "000000.png").astype(np.uint16) * 16)
    files = [folder / "images" / "000000.png" for folder in (mono, colour)] + [deep]
    assert run(["estimate", *map(str, files), "--camera", "speed"]) == 0
    said = capsys.readouterr().out
    assert said.count("accepted") == 3
    assert f"{files[1]}: colour, taken in grey (the mean of the three channels), 8 bits\n" in said
    assert f"{deep}: mono, 16 bits, full scale taken from the brightest pixel\n" in said
    assert f"{files[0]}: mono" not in said


def test_estimate_from_python(mono, tmp_path):
    image, truth = mono / "images" / "000000.png", fa.read_truth(mono / "images" / "000000.json")
    found = fa.estimate(image, truth.camera, "tango")
    assert found.accepted
    assert found.t_camera_from_target_m == pytest.approx(truth.t_camera_from_target_m, abs=0.1)
    # names and files as well as objects, arrays as well as files; what was prepared is kept
    again = fa.estimate(read_png(image), "speed", fa.load_target("tango"))
    assert again.q_camera_from_target_wxyz.tolist() == found.q_camera_from_target_wxyz.tolist()
    lit = fa.estimate(image, truth.camera, "tango", sun_camera=truth.sun_direction_camera)
    assert lit.t_camera_from_target_m == pytest.approx(truth.t_camera_from_target_m, abs=0.1)
    # transparency is no channel of light
    clear = tmp_path / "clear.png"
    cv2.imwrite(str(clear), np.dstack([read_png(image)] * 3 + [np.full((1200, 1920), 255, np.uint8)]))
    shown = fa.estimate(str(clear), "speed")
    assert shown.t_camera_from_target_m.tolist() == found.t_camera_from_target_m.tolist()


def test_what_cannot_be_estimated_is_said_in_a_sentence():
    with pytest.raises(fa.UserError, match="40 x 30 pixels, the camera 1920 x 1200"):
        fa.estimate(np.zeros((30, 40), np.uint8), "speed", "tango")
    with pytest.raises(fa.UserError, match="float64 pixels: give uint8 or uint16"):
        fa.estimate(np.zeros((1200, 1920)), "speed", "tango")
    with pytest.raises(fa.UserError, match="unknown method 'svdd'"):
        fa.estimate(np.zeros((1200, 1920), np.uint8), "speed", "tango", method="svdd")
    with pytest.raises(fa.UserError, match="is not a unit vector: give three numbers of length 1"):
        fa.estimate(np.zeros((1200, 1920), np.uint8), "speed", "tango", sun_camera=(0.0, 0.0, 2.0))
