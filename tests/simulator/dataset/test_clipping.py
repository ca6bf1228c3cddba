"""A capture says how much of the target is burnt out, and the exposure that it proposes keeps it."""

import json
import re

import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.simulator.dataset.clipping import Clipping, summarise_clipping
from flyaround.simulator.dataset.formats.native import frame_paths, read_png

pytestmark = pytest.mark.gl

SCENARIO = """
epoch_utc = "2026-08-20T09:30:00Z"
duration_s = 60.0
[orbit]
kind = "elements"
altitude_km = 700.0
inclination_deg = 98.2
raan_deg = 14.7
true_anomaly_deg = 95.3
[chaser]
mode = "hold"
position_lvlh_m = [6.0, 6.0, 3.0]
[environment]
preset = "space"
[sensor]
preset = "ideal"
exposure_s = EXPOSURE
"""


def _capture(tmp_path, capsys, name, exposure, *options):
    scenario = tmp_path / f"{name}.toml"
    scenario.write_text(SCENARIO.replace("EXPOSURE", exposure))
    command = [
        "capture",
        str(scenario),
        "-n",
        "1",
        "--quality",
        "draft",
        "-o",
        str(tmp_path / name),
        *options,
    ]
    assert run(command) == 0
    return capsys.readouterr().out


def test_a_burnt_out_target_is_told_with_an_exposure_that_is_right(tmp_path, capsys):
    said = " ".join(_capture(tmp_path, capsys, "bright", "0.02").split())
    share = float(re.search(r"([\d.]+) % of the target's pixels are saturated", said)[1]) / 100
    # what anyone counts in the files: without noise, which pulls half of the full pixels below the top again
    paths = frame_paths(tmp_path / "bright", 0)
    white = (read_png(paths.image) == 255)[read_png(paths.mask) > 0].mean()
    assert share == pytest.approx(white, abs=0.03)
    assert share > 0.2
    proposed = re.search(r"set exposure_s = (\S+) in \[sensor\] \(here 0.02\)", said)[1]
    assert "[sensor.auto_exposure]" in said

    told = json.loads(_capture(tmp_path, capsys, "right", proposed, "--json"))
    assert told["clipping"]["share"] < 0.05
    assert told["clipping"]["advice"] == ""
    paths = frame_paths(tmp_path / "right", 0)
    bright = read_png(paths.image)[read_png(paths.mask) > 0]
    # nothing is lost at the other end: the brightest of the craft use the scale
    assert np.quantile(bright, 0.98) > 150


def test_what_is_proposed_follows_what_the_scenario_can_do():
    document = {"schema": "flyaround.scenario", "sensor": {"exposure_s": 0.01}}
    even = [Clipping(1000, 300, 0.01, 0.002), Clipping(1000, 100, 0.01, 0.003)]
    told = summarise_clipping(even, document)
    assert (told.share, told.worst_share) == (0.2, 0.3)
    assert "exposure_s = 0.002 in [sensor] (here 0.01)" in told.advice
    far = summarise_clipping([*even, Clipping(1000, 0, 0.01, 0.05)], document)
    assert far.advice.startswith("add [sensor.auto_exposure], because the frames need 0.002 to 0.05 s")
    following = {**document, "sensor": {"auto_exposure": {"level": 0.5}}}
    assert "set level below 0.5" in summarise_clipping(even, following).advice
    assert "recipe" in summarise_clipping(even, {"name": "eval-black"}).advice
    # a few highlights are no fault, and a frame without a target none either
    assert summarise_clipping([Clipping(1000, 40, 0.01, 0.005)], document).advice == ""
    assert summarise_clipping([Clipping(0, 0, 0.01, 0.0)], document) is None
    # most of the frames use less than a fifth of the scale
    dark = summarise_clipping([Clipping(1000, 0, 0.01, 0.2), Clipping(1000, 0, 0.01, 0.3)], document)
    assert dark.dark_frames == 2
    assert "exposure_s = 0.2 in [sensor] (here 0.01)" in dark.advice
    assert "set level above 0.5" in summarise_clipping([Clipping(1000, 0, 0.01, 0.2)], following).advice
