"""Every example runs and gives what it says."""

import subprocess
import sys
from pathlib import Path

import cv2
import pytest

pytestmark = pytest.mark.gl

EXAMPLES = Path(__file__).parents[2] / "examples"


def _run(name, *arguments):
    command = [sys.executable, str(EXAMPLES / name), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
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


def test_every_example_is_tested():
    tests = Path(__file__).read_text()
    assert all(path.name in tests for path in EXAMPLES.glob("*.py"))
