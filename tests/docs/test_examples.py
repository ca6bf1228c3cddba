"""Every example runs and gives what it says."""

import sys
from pathlib import Path

import cv2
import pytest
from programs import completed

import flyaround as fa

pytestmark = pytest.mark.gl

EXAMPLES = Path(__file__).parents[2] / "examples"


def _run(name, *arguments):
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    done = completed(*command)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_first_frame(tmp_path):
    text = _run("first_frame.py", str(tmp_path))
    assert "visible keypoints: ['" in text
    assert cv2.imread(str(tmp_path / "overlay.png")).shape == (1200, 1920, 3)


def test_own_sink():
    values = _run("own_sink.py").split("[")[1].rstrip("]\n").split(",")
    assert len(values) == 4
    assert min(int(v) for v in values) > 50


def test_own_pose(tmp_path):
    text = _run("own_pose.py", str(tmp_path))
    assert "accepted: True" in text
    # a pose right to a hundredth of the range of 8 m
    assert float(text.split("off by [m]:")[1]) < 0.08
    truth = fa.read_truth(tmp_path / "own_pose.json")
    assert truth.t_camera_from_target_m == pytest.approx((0.4, -0.2, 8.0), abs=1e-12)
    norm = 0.98**0.5
    q = [x / norm for x in (0.3, 0.8, 0.4, -0.3)]
    assert truth.q_camera_from_target_wxyz == pytest.approx(q, abs=1e-12)


def test_read_dataset(tmp_path):
    plan = fa.plan_flight(fa.load_scenario("tango-flyaround"), n=2, quality="draft")
    fa.capture(plan, tmp_path / "set", split=(1, 1, 0))
    text = _run("read_dataset.py", str(tmp_path / "set"))
    assert "2 frames of tango, 1920 pixels wide" in text
    assert float(text.split("to [px]:")[1]) < 1e-9
    assert "1 frames of tango" in _run("read_dataset.py", str(tmp_path / "set"), "validation")


def test_every_example_is_tested():
    tests = "".join(path.read_text() for path in Path(__file__).parents[1].rglob("test_*.py"))
    assert all(path.name in tests for path in EXAMPLES.glob("*.py"))
