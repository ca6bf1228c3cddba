"""The estimator's bench as a process of its own: it begins with what a board has, and says what it measured."""

import json
import subprocess
import sys

import numpy as np
import pytest

from flyaround.hil.bench.board_process import peak_mb
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


def test_the_peak_does_not_hold_the_input(tmp_path):
    stack = np.zeros((32, 2, 1 << 20), np.uint16)  # 4 MB an image
    stack[:, 0, 0] = range(32)
    np.save(tmp_path / "images.npy", stack)
    program = (
        "import sys; from pathlib import Path; from flyaround.hil.bench.board_process import images, peak_mb;"
        "before = peak_mb(); read = [int(a[0, 0]) for a in images(Path(sys.argv[1])) if a.sum() == a[0, 0]];"
        "assert read == list(range(32)); print((peak_mb() or 0) - (before or 0))"
    )
    words = [sys.executable, "-c", program, str(tmp_path / "images.npy")]
    assert float(subprocess.run(words, stdout=subprocess.PIPE, check=True).stdout) < 30


def test_a_status_without_a_peak_is_none(tmp_path):
    (tmp_path / "status").write_text("Name:\tpython\nVmRSS:\t  9 kB\n")
    assert peak_mb(tmp_path / "status") is None
    (tmp_path / "status").write_text("VmHWM:\t  100000 kB\n")
    assert peak_mb(tmp_path / "status") == pytest.approx(102.4)
    assert peak_mb(tmp_path / "none") is None
