"""The estimator's bench as a process of its own: it begins with what a board has, and says what it measured."""

import json
import subprocess
import sys

import numpy as np

from flyaround.hil.board_model.write import write_board_model
from flyaround.simulator.targets.library import load_target


def test_the_process_times_single_and_tracked_frames(tmp_path):
    write_board_model(load_target("tango"), tmp_path / "model.json")
    camera = {
        "width_px": 96, "height_px": 60, "fx_px": 150.0, "fy_px": 150.0, "cx_px": 47.5, "cy_px": 29.5,
        "distortion": {"model": "none", "coefficients": []},
    }  # fmt: skip
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    noise = np.random.default_rng(1).integers(0, 60, (3, 60, 96)).astype(np.uint8)
    np.save(tmp_path / "single.npy", noise)
    np.save(tmp_path / "sequence.npy", noise[:2])
    words = [sys.executable, "-m", "flyaround.hil.bench.board_process", str(tmp_path), "0.5"]
    found = json.loads(subprocess.run(words, stdout=subprocess.PIPE, check=True).stdout)
    assert len(found["single"]) == 3
    assert all(ms >= 0 for ms in found["single"])
    assert len(found["tracked"]) <= 2
    assert found["peak_mb"] is None or found["peak_mb"] > 10
    assert found["kernels"]
