"""One frame alone has the bytes that it has in its flight, by the commands that people type."""

import json
import tomllib
from importlib.resources import files

import msgspec
import pytest
from typer.testing import CliRunner

from flyaround.cli.app import app
from flyaround.simulator.scenario.load import load_scenario

pytestmark = pytest.mark.gl

FAST_TUMBLE = "rate_deg_s = [6.0, -10.0, 17.0]"
ROLLING = """
[sensor]
preset = "speed"
shutter = "rolling"
readout_s = 0.4
motion_blur = true

[sensor.auto_exposure]
lag_s = 2.0
longest_s = 0.2
"""


def _run(*words):
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    return result.output


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A flight with a lagging exposure, a rolling shutter and blur, captured with all labels by the command line."""
    place = tmp_path_factory.mktemp("flight")
    text = (files("flyaround.assets") / "scenarios" / "tango-flyaround.toml").read_text()
    text = text.replace('target = "tango"', 'target = "tango@low"').replace(
        "rate_deg_s = [-0.7, -1.4, 0.2]", FAST_TUMBLE
    )
    text = text[: text.index("[sensor]")] + ROLLING + text[text.index("[output]") :]
    assert tomllib.loads(text)["attitude"]["rate_deg_s"] == [6.0, -10.0, 17.0]
    (place / "flight.toml").write_text(text)
    camera = load_scenario("tango-flyaround").camera_model.resized(96)
    (place / "camera.json").write_bytes(msgspec.json.encode(camera))
    command = [
        "capture",
        place / "flight.toml",
        "--camera",
        place / "camera.json",
        "-n",
        2,
        "--labels",
        "all",
    ]
    command += ["--quality", "draft", "-o", place / "set"]
    _run(*command)
    return place / "set", command


def _images(folder):
    return {path.name: path.read_bytes() for path in (folder / "images").iterdir()}


def test_a_frame_drawn_alone_has_the_bytes_of_the_flight(flight, tmp_path):
    folder, _ = flight
    records = [json.loads((folder / "images" / f"{k:06d}.json").read_text()) for k in range(2)]
    assert records[0]["exposure_s"] != records[1]["exposure_s"]  # the exposure was still following the light
    assert all(r["row_poses"] and r["scene"]["shutter"]["motion_blur"] for r in records)
    _run("render", "--from-truth", folder / "images" / "000001.json", "-o", tmp_path / "000001.png")
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    # the mask is a file of data sets alone
    kept = {n: b for n, b in _images(folder).items() if n.startswith("000001") and n != "000001.mask.png"}
    assert len(kept) == 7
    assert {name: made[name] for name in kept} == kept


def test_an_interrupted_and_resumed_capture_has_the_same_bytes(flight):
    folder, command = flight
    before = _images(folder)
    for name in ("000001.json", "000001.png", "000001.depth.exr"):
        (folder / "images" / name).unlink()
    _run(*command, "--resume")
    assert _images(folder) == before
    assert "0 faults" in _run("check", folder)
