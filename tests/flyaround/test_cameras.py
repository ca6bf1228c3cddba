"""flyaround cameras: what a file has beyond the camera is said, unknown keys end with 2, help lists the formats."""

import json
from pathlib import Path

import pytest

from flyaround.__main__ import run
from flyaround.simulator.camera.lens.formats.registry import CAMERA_FORMATS

REPORTS = Path(__file__).parents[1] / "data" / "reports"
ONE = """  camera_model: pinhole
  intrinsics: [600, 601, 320, 240]
  resolution: [640, 480]
  distortion_model: none
"""


def test_what_is_left_out_is_said_beside_the_numbers(tmp_path, capsys):
    chain = tmp_path / "chain.yaml"
    chain.write_text(f"cam0:\n{ONE}cam1:\n{ONE}")
    assert run(["cameras", str(chain), "--json"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["cam0"]["fx_px"] == 600
    assert "cam0 was taken of cam0, cam1" in " ".join(said.err.split())
    assert run(["cameras", "speed", "--json"]) == 0
    assert not capsys.readouterr().err


@pytest.mark.parametrize("side", ["--width", "--height"])
def test_an_image_of_no_pixels_is_refused(side, capsys):
    assert run(["cameras", "speed", side, "0"]) == 2
    assert side in capsys.readouterr().err


def test_a_file_that_is_not_understood_whole_writes_nothing(tmp_path, capsys):
    out = tmp_path / "CAMERA.json"
    assert run(["cameras", str(REPORTS / "unknown_key" / "cam.yaml"), "--export", str(out)]) == 2
    assert "xyz_unknown" in capsys.readouterr().err
    assert not out.exists()


def test_help_names_every_format(capsys):
    assert run(["cameras", "--help"]) == 0
    words = " ".join(capsys.readouterr().out.replace("│", " ").split())
    for form in CAMERA_FORMATS:
        assert form.title in words
