"""Drawn labels: pictures under them as bright in eight bits of any depth, edges that bow with the lens."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.gui.picture.truth_overlay import wireframe_at
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.camera_model import Camera, Distortion
from flyaround.simulator.labels.boxes import amodal_box
from flyaround.simulator.labels.overlay import draw_wireframe, screen_rgb
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose

IDEAL = sensor_preset("ideal")


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
def test_a_picture_of_any_depth_is_as_bright_in_eight_bits(bits):
    share = np.linspace(0, 1, 12)
    kind = np.uint8 if bits == 8 else np.uint16
    grey = np.rint(share * (2**bits - 1)).astype(kind).reshape(3, 4)
    drawn = screen_rgb(grey, replace(IDEAL, bits=bits), "linear")
    assert (drawn.dtype, drawn.shape) == (np.uint8, (3, 4, 3))
    wanted = screen_rgb(np.rint(share * 255).astype(np.uint8).reshape(3, 4), IDEAL, "linear")
    assert np.abs(drawn.astype(int) - wanted).max() <= 3
    # three equal bands are grey; red light alone is red
    colour = screen_rgb(np.dstack([grey] * 3), replace(IDEAL, bits=bits), "linear")
    assert np.abs(colour.astype(int) - drawn).max() <= 1
    red = screen_rgb(np.dstack([grey, 0 * grey, 0 * grey]), replace(IDEAL, bits=bits), "linear")
    assert (red[..., 0] >= red[..., 1:].max(axis=2)).all()


@pytest.mark.parametrize("k1", [-0.25, 0.0, 0.25])
def test_drawn_edges_bow_with_the_lens(k1):
    lens = Distortion("brown_conrady", (k1, 0.0, 0.0, 0.0))
    camera = Camera(
        width_px=640, height_px=480, fx_px=560.0, fy_px=560.0, cx_px=319.5, cy_px=239.5, distortion=lens
    )
    # the back of the board is away from the camera
    pose = Pose.from_arrays("camera", "target", (0.0, 1.0, 0.0, 0.0), np.array([0.0, 0.0, 0.6]))
    board = load_target("chessboard")
    box = amodal_box(SimpleNamespace(camera=camera, camera_from_target=pose), board)
    drawn = draw_wireframe(np.zeros((480, 640, 3), np.uint8), camera, pose, board).max(axis=2) > 0
    rows, columns = np.nonzero(drawn)
    assert (columns.min(), rows.min(), columns.max(), rows.max()) == pytest.approx(box, abs=2.0)
    ends = np.array(wireframe_at(camera, pose, board)).reshape(-1, 2)
    assert (*ends.min(axis=0), *ends.max(axis=0)) == pytest.approx(box, abs=0.1)
