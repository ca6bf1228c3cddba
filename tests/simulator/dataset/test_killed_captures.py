"""Captures that are killed at seeded moments and resumed: in the end every file is that of an undisturbed one."""

import json
import random
import shutil
import subprocess
import sys
import time

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.gl, pytest.mark.timeout(7200)]

KILLS = 50
CAMERA = {"width_px": 160, "height_px": 120, "fx_px": 150.0, "fy_px": 150.0, "cx_px": 79.5, "cy_px": 59.5}


def capture(folder, *more):
    camera = folder.parent / "camera.json"
    camera.write_text(json.dumps(CAMERA))
    command = ["capture", "eval-black", "-n", "24", "-o", str(folder), "--camera", str(camera)]
    command += ["--quality", "draft", "--labels", "depth", "--format", "coco,speed"]
    return subprocess.Popen(
        [sys.executable, "-m", "flyaround", *command, *more],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_resumed_data_set_is_an_undisturbed_one_in_every_file(tmp_path):
    whole = tmp_path / "whole"
    assert capture(whole).wait() == 0
    began = time.monotonic()
    assert capture(whole.with_name("again")).wait() == 0
    took_s = time.monotonic() - began
    expected = files(whole)
    assert files(whole.with_name("again")) == expected
    rng = random.Random(38)
    begun = 0
    for k in range(KILLS):
        folder = tmp_path / f"killed-{k}"
        process = capture(folder)
        time.sleep(took_s * rng.uniform(0.3, 1.0))
        process.kill()
        process.wait()
        begun += folder.is_dir()
        named = {path.name for path in folder.glob("images/??????.*")}
        manifest = folder / "manifest.sha256"
        listed = manifest.read_text() if manifest.is_file() else ""
        assert all(name in listed for name in named), f"kill {k}: a frame without a line"
        assert capture(folder, "--resume").wait() == 0, f"kill {k}"
        assert files(folder) == expected, f"kill {k}"
        shutil.rmtree(folder)
    assert begun > KILLS // 2
