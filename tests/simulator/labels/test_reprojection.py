"""OpenCV's projection of the keypoints, by nothing but the exported JSON, meets the painted markers in the PNG."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.single_frames import save_picture
from flyaround.simulator.frame import take_frame
from flyaround.simulator.targets.model import Keypoint, Material
from flyaround.simulator.world.frames.rotation import matrix_from_quat

pytestmark = pytest.mark.gl

PLACES = [(x, y, -0.001) for x in (-0.6, -0.15, 0.35) for y in (-0.4, 0.05, 0.5)]
POSES = [(0, 0, 0), (0.5, 0.2, 0.3), (-0.4, 0.5, -1.0), (0.1, -0.6, 2.0)]
HALF_PX = 14


def test_keypoints_of_the_record_meet_the_picture(renderer, draw_kit, tmp_path):
    black = Material(name="black", base_color=(0.0, 0.0, 0.0), roughness=1.0)
    parts = [draw_kit.plate("ground", "black", (0, 0, 0), 0.9)]
    parts += [draw_kit.plate(f"marker{k}", "white", p, 0.012) for k, p in enumerate(PLACES)]
    target = replace(
        draw_kit.target(parts, [draw_kit.white(), black]),
        keypoints=tuple(Keypoint(name=f"k{k}", position_m=p) for k, p in enumerate(PLACES)),
    )
    errors = []
    for n, rotvec in enumerate(POSES):
        scene = replace(
            draw_kit.scene(target, t_m=(0.2, -0.1, 5.0), rotvec_rad=rotvec, sun_camera=(0.2, 0.1, -1)),
            camera=load_camera("speed"),
            sensor=replace(sensor_preset("ideal"), bits=16, full_scale_j_m2_sr=0.3),
            exposure_s=0.001,
        )
        truth_path = save_picture(take_frame(renderer, scene, target), tmp_path / f"{n}.png")
        errors += _errors(truth_path, tmp_path / f"{n}.png")
    errors = np.array(errors)
    assert len(errors) == len(POSES) * len(PLACES)
    # the goals of docs/conventions.md; measured 0.017 rms
    distances = np.hypot(*errors.T)
    assert np.sqrt((distances**2).mean()) <= 0.02
    assert distances.max() <= 0.04
    # and none of it is a shift: 4 standard errors
    assert np.abs(errors.mean(axis=0)).max() <= 4 * 0.02 / np.sqrt(len(errors))


def _errors(truth_path, image_path):
    truth = json.loads(truth_path.read_text())
    c = truth["camera"]
    K = np.array([[c["fx_px"], 0, c["cx_px"]], [0, c["fy_px"], c["cy_px"]], [0, 0, 1]])
    rotation = cv2.Rodrigues(matrix_from_quat(truth["q_camera_from_target_wxyz"]))[0]
    points = np.array([k["target_m"] for k in truth["keypoints"]])
    projected, _ = cv2.projectPoints(points, rotation, np.array(truth["t_camera_from_target_m"]), K, None)
    image = cv2.imread(str(image_path), cv2.IMREAD_UNCHANGED).astype(float)
    found = []
    for u, v in projected.reshape(-1, 2):
        x0, y0 = round(u) - HALF_PX, round(v) - HALF_PX
        patch = image[y0 : y0 + 2 * HALF_PX + 1, x0 : x0 + 2 * HALF_PX + 1]
        patch = np.clip(patch - np.median(patch), 0, None)
        yy, xx = np.mgrid[y0 : y0 + patch.shape[0], x0 : x0 + patch.shape[1]]
        found.append(((patch * xx).sum() / patch.sum() - u, (patch * yy).sum() / patch.sum() - v))
    return found
