"""Makes the image of docs/hil_camera.md that shows what a board sees of the simulated camera, through Aravis.

    python -m tools.docs.camera_board -o docs/images

Starts ``hil camera``, grabs the whole detector and a part of it with other settings, and draws the estimated pose.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import msgspec
import numpy as np

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.gige.camera import CameraSettings, GigeCamera
from flyaround.hil.board.gige.camera_board import camera_of_part
from flyaround.hil.board.hybrid.debug.overlay import draw_wireframe, grey
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.targets.library import load_target

SCENARIO, ADDRESS = "tango-earth-10m-1024", "127.0.7.77"
COLOUR = (80, 200, 80)
SIDE = 640
WHOLE = CameraSettings(software_trigger=True, roi_px=(0, 0, 1024, 1024))
PART_PX = (192, 192, 640, 640)


def seen(settings: CameraSettings, camera: dict[str, object], model: BoardModel) -> np.ndarray:
    """Return the (SIDE, SIDE, 3) image of the camera with the estimate's wireframe."""
    device = GigeCamera(ADDRESS, settings)
    try:
        device.start()
        device.trigger()
        frame = device.frame(30.0)
    finally:
        device.close()
    if frame is None:
        raise SystemExit("no picture came: run it again")
    lens = CameraIntrinsics.from_dict(camera_of_part(camera, frame.roi_px))
    result = make_estimator(model, lens).estimate(frame.image)
    scale = SIDE / frame.image.shape[0]
    canvas = cv2.resize(grey(frame.image, 255.0), (SIDE, SIDE), interpolation=cv2.INTER_AREA)
    draw_wireframe(
        canvas,
        model,
        lens,
        result.q_camera_from_target_wxyz,
        result.t_camera_from_target_m,
        COLOUR,
        scale=scale,
    )
    return np.asarray(canvas)


def main() -> None:
    """Write the image."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--out", type=Path, required=True)
    out = parser.parse_args().out
    model = board_model(load_target("tango"))
    plan = plan_flight(load_scenario(SCENARIO), n=1)
    scene = plan.scene(0)
    camera = msgspec.to_builtins(scene.camera)
    whole = replace(WHOLE, exposure_us=1e6 * scene.exposure_s, gain_db=0.0)
    part = replace(WHOLE, roi_px=PART_PX, exposure_us=0.25e6 * scene.exposure_s, gain_db=15.0)
    line = [sys.executable, "-m", "flyaround", "hil", "camera", SCENARIO, "--interface", "lo"]
    with subprocess.Popen([*line, "--address", ADDRESS], stderr=subprocess.PIPE, text=True) as endpoint:
        assert endpoint.stderr is not None  # noqa: S101 - it is a pipe
        while "camera endpoint on" not in endpoint.stderr.readline():
            pass
        pictures = [seen(settings, camera, model) for settings in (whole, part)]
        endpoint.terminate()
    gap = np.full((SIDE, 12, 3), 255, np.uint8)
    cv2.imwrite(
        str(out / "hil_camera_board.jpg"),
        np.hstack([pictures[0], gap, pictures[1]]),
        [cv2.IMWRITE_JPEG_QUALITY, 88],
    )


if __name__ == "__main__":
    main()
