"""Optical flow of a plane under a turn, against OpenCV's projection."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Distortion
from flyaround.simulator.labels.layers import optical_flow
from flyaround.simulator.labels.truth import FlowLabel
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
)


def matrix(camera):
    return np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1.0]])


@pytest.mark.parametrize("lens", [True, False], ids=["lens", "pinhole"])
@pytest.mark.parametrize(
    ("turn", "shift_m"),
    [
        ((0.03, -0.05, 0.3), (0.1, -0.06, 0.4)),
        ((0.0, 0.06, 0.0), (0.0, 0.0, 0.0)),
        ((0.0, 0.0, 0.0), (0.05, 0.1, -0.5)),
    ],
    ids=["screw", "yaw", "shift"],
)
def test_flow_leads_to_where_opencv_has_the_point_next(draw_kit, lens, turn, shift_m):
    """The camera turns and the craft moves; ``turn`` is of the craft about the camera's axes, then ``shift_m``."""
    camera = draw_kit.lens_camera
    coefficients = np.array(camera.distortion.coefficients if lens else (0.0,) * 5)
    if not lens:
        camera = replace(camera, distortion=Distortion())
    craft = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    scene = draw_kit.scene(craft, camera=camera, rotvec_rad=(0.2, -0.4, 0.7), t_m=(0.2, -0.1, 4.0))
    q, t = scene.q_camera_from_target_wxyz, np.array(scene.t_camera_from_target_m)
    spin = quat_from_rotvec(np.array(turn))
    q_next = quat_multiply(spin, q)
    t_next = matrix_from_quat(spin) @ t + shift_m
    # a plane across the craft, z = 4 + 0.3 x - 0.2 y, seen in a window of the image
    mask = np.zeros((camera.height_px, camera.width_px), np.uint8)
    mask[60:200, 70:260] = 255
    rows, columns = np.nonzero(mask)
    pixels = np.stack([columns, rows], 1).astype(float)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    x, y = cv2.undistortPoints(pixels[:, None], matrix(camera), coefficients, criteria=stop)[:, 0].T
    z = 4.0 / (1 - 0.3 * x + 0.2 * y)
    depth_m = np.full(mask.shape, np.nan, np.float32)
    depth_m[rows, columns] = z
    points = np.stack([x * z, y * z, z], 1)
    on_craft = (points - t) @ matrix_from_quat(quat_conjugate(q)).T
    there, _ = cv2.projectPoints(
        on_craft, cv2.Rodrigues(matrix_from_quat(q_next))[0], t_next, matrix(camera), coefficients
    )
    label = FlowLabel(t_s=1.0, q_camera_from_target_wxyz=tuple(q_next), t_camera_from_target_m=tuple(t_next))
    flow = optical_flow(scene, label, depth_m, mask)
    assert flow.shape == (*mask.shape, 2)
    assert np.isnan(flow[mask == 0]).all()
    moved = there[:, 0] - pixels
    assert np.abs(moved).max() > 15
    # depth and flow are float32: 1e-7 of 600 px, and OpenCV's inverse of the lens is iterated
    assert np.abs(flow[rows, columns] - moved).max() < 1e-3
