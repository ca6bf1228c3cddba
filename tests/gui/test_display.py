"""The optical loop on a virtual screen, with a warped and noisy grab of it in the camera's place."""

import json
import os
import subprocess
import sys
from importlib.resources import files

import cv2
import numpy as np
import pytest
from PIL import ImageGrab
from screen import SCREEN
from standin_camera import StandInCamera

import flyaround as fa
from flyaround.__main__ import run

pytestmark = [pytest.mark.gui, pytest.mark.gl]

CAMERA_PX = (1200, 900)


def grab(display):
    """(H, W) levels on the virtual screen."""
    return np.asarray(ImageGrab.grab(xdisplay=display))[..., 0]


def shown_one_by_one(display, arguments, look):
    """Run hil display with --step; ``look(name)`` while each picture is on the screen."""
    command = [sys.executable, "-m", "flyaround", "hil", "display", "--step", *arguments]
    environment = {**os.environ, "DISPLAY": display}
    with subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        for line in process.stdout:
            look(line.strip())
            process.stdin.write("\n")
            process.stdin.flush()
        said = process.stderr.read()
        assert process.wait(timeout=60) == 0, said
    return said


def test_a_camera_sees_what_was_drawn(display, tmp_path, capsys):
    camera = StandInCamera(SCREEN, CAMERA_PX)
    grabs = tmp_path / "grabs"
    grabs.mkdir()

    def take(folder, name):
        cv2.imwrite(str(folder / f"{name}.png"), camera.look(grab(display)).astype(np.uint16))

    shown_one_by_one(display, ["--patterns"], lambda name: take(grabs, name))
    calibration = tmp_path / "calibration.json"
    words = ["hil", "display-calibrate", str(grabs), "--screen", "1280x800", "-o", str(calibration), "--json"]
    assert run(words) == 0
    assert json.loads(capsys.readouterr().out)["geometry_rms_px"] < 0.2

    # Tango as the calibrated camera would see it
    (tmp_path / "camera.json").write_text(
        json.dumps(
            {
                "width_px": CAMERA_PX[0],
                "height_px": CAMERA_PX[1],
                "fx_px": 1900.0,
                "fy_px": 1900.0,
                "cx_px": 599.5,
                "cy_px": 449.5,
                "distortion": {"model": "none", "coefficients": []},
            }
        )
    )
    text = files("flyaround.assets").joinpath("scenarios", "tango-space-10m.toml").read_text()
    scenario = tmp_path / "mine.toml"
    assert 'camera = "speed"' in text
    scenario.write_text(text.replace('camera = "speed"', 'camera = "camera.json"'))
    flight, kept = tmp_path / "flight", tmp_path / "kept"
    flight.mkdir()
    arguments = [str(scenario), "-n", "2", "--calibration", str(calibration), "--save", str(kept)]
    said = shown_one_by_one(display, arguments, lambda name: take(flight, name.replace(" ", "_")))
    assert "2 of 2 frames shown" in said

    pictures = sorted(str(p) for p in flight.glob("*.png"))
    assert run(["hil", "display-match", *pictures, "--calibration", str(calibration), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [row["frame_id"] for row in found] == [0, 1]
    rows = [line.split(",") for line in (kept / "shown.csv").read_text().splitlines()[1:]]
    assert [int(row[1]) for row in rows] == [row["time_ns"] for row in found]

    # the grab beside the frame itself: no shift, and the same light
    seen = json.loads(calibration.read_text())
    plan = fa.plan_flight(fa.load_scenario(scenario), n=2)
    with fa.Renderer() as renderer:
        frame = fa.take_frame(renderer, plan.scene(1), plan.target)
    light = (cv2.imread(pictures[1], cv2.IMREAD_UNCHANGED) - seen["black_dn"]) / seen["white_dn"]
    x0, y0, x1, y1 = (round(v) for v in frame.truth.box_px)
    ours = cv2.GaussianBlur(frame.image[y0:y1, x0:x1].astype(np.float64) / 255, (0, 0), 2)
    theirs = cv2.GaussianBlur(light[y0:y1, x0:x1], (0, 0), 2)
    (dx, dy), response = cv2.phaseCorrelate(ours, theirs)
    assert response > 0.5
    assert np.hypot(dx, dy) < 0.3
    assert np.abs(theirs - ours).mean() < 0.02


def test_mistakes_are_one_sentence(display, tmp_path):
    environment = {**os.environ, "DISPLAY": display}
    for arguments, sentence in (
        ([], "name a scenario"),
        (["--patterns", "--monitor", "7"], "there is no monitor 7"),
        (["tango-space-10m", "-n", "1"], "the frame is 1920 x 1200 px but the screen 1280 x 800"),
    ):
        command = [sys.executable, "-m", "flyaround", "hil", "display", *arguments]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=environment, timeout=120
        )
        assert done.returncode == 2, done.stderr
        assert sentence in done.stderr
    assert run(["hil", "display-calibrate", str(tmp_path), "--screen", "wide"]) == 2
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((200, 300), np.uint8))
    assert run(["hil", "display-match", str(tmp_path / "black.png")]) == 1
