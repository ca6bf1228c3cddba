"""Boxes of made-up masks, and of a craft under a lens that bows its edges."""

from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from small_flight import small_flight

from flyaround.simulator.camera.lens.camera_model import Camera, Distortion
from flyaround.simulator.dataset.check.keypoint_states import check_amodal_box
from flyaround.simulator.frame import take_frame
from flyaround.simulator.labels.boxes import amodal_box, mask_box
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose

FOCAL_PX = 560.0


def test_one_pixel_mask_has_the_box_of_the_contract():
    mask = np.zeros((10, 12), np.uint8)
    mask[4, 3] = 255
    assert mask_box(mask) == (2.5, 3.5, 3.5, 4.5)


def test_empty_mask_has_no_box():
    assert mask_box(np.zeros((5, 5), np.uint8)) is None


def test_box_touches_the_image_edges():
    assert mask_box(np.full((6, 8), 255, np.uint8)) == (-0.5, -0.5, 7.5, 5.5)


def lens_camera(k1):
    return Camera(
        width_px=640,
        height_px=480,
        fx_px=FOCAL_PX,
        fy_px=FOCAL_PX,
        cx_px=319.5,
        cy_px=239.5,
        distortion=Distortion("brown_conrady", (k1, 0.0, 0.0, 0.0)),
    )


def view(camera, q=(0.0, 1.0, 0.0, 0.0), range_m=0.6):
    """A board before a camera, face-on by default."""
    pose = Pose.from_arrays("camera", "target", q, np.array([0.0, 0.0, range_m]))
    return SimpleNamespace(camera=camera, camera_from_target=pose)


@pytest.mark.parametrize("k1", [-0.25, 0.25])
def test_a_face_on_board_is_widest_at_the_middles_of_its_edges_or_at_its_corners(k1):
    board, camera = load_target("chessboard"), lens_camera(k1)
    in_camera = view(camera).camera_from_target.apply(joined_mesh(board).hull_m)
    half, z = np.abs(in_camera[:, :2]).max(axis=0), in_camera[:, 2].min()
    x, y = half / z
    # a barrel lens bows edges outwards, a pincushion lens inwards
    rx, ry = (x * x, y * y) if k1 < 0 else (x * x + y * y,) * 2
    wide, high = FOCAL_PX * x * (1 + k1 * rx), FOCAL_PX * y * (1 + k1 * ry)
    expected = (319.5 - wide, 239.5 - high, 319.5 + wide, 239.5 + high)
    np.testing.assert_allclose(amodal_box(view(camera), board), expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("name", ["chessboard", "cubesat-6u@low"])
@pytest.mark.parametrize("lens", ["brown_conrady", "kannala_brandt"])
def test_the_box_of_a_lens_is_that_of_all_points_along_all_edges(name, lens):
    target, mesh = load_target(name), joined_mesh(load_target(name))
    camera = lens_camera(-0.25)
    if lens == "kannala_brandt":
        camera = replace(camera, distortion=Distortion(lens, (0.05, -0.01, 0.0, 0.0)), fx_px=300, fy_px=300)
    radius = float(np.linalg.norm(mesh.hull_m, axis=1).max())
    rng = np.random.default_rng(5)
    for range_m in (1.5 * radius, 3 * radius):
        q = rng.normal(size=4)
        scene = view(camera, tuple(q / np.linalg.norm(q)), range_m)
        corners = scene.camera_from_target.apply(mesh.positions_m)[mesh.triangles]
        share = np.linspace(0, 1, 101)[:, None, None, None]
        along = camera.project(corners * (1 - share) + np.roll(corners, -1, axis=1) * share).reshape(-1, 2)
        low, high = along.min(axis=0), along.max(axis=0)
        box = np.array(amodal_box(scene, target))
        assert np.all(box[:2] <= low + 1e-7)
        assert np.all(box[2:] >= high - 1e-7)
        np.testing.assert_allclose(box, [*low, *high], rtol=0, atol=0.05)


@pytest.mark.gl
def test_the_visible_mask_lies_within_the_box_of_a_lens():
    """A pixel of the mask has its centre on the craft."""
    plan = small_flight(64)
    scene, board = plan.scene(0), load_target("chessboard")
    scene = replace(
        scene,
        camera=lens_camera(-0.25),
        target=replace(scene.target, name=board.name, sha256=board.sha256),
        q_camera_from_target_wxyz=(0.0, 1.0, 0.0, 0.0),
        t_camera_from_target_m=(0.0, 0.0, 0.6),
    )
    with Renderer() as renderer:
        truth = take_frame(renderer, scene, board).truth
    visible, amodal = np.array(truth.box_px), np.array(truth.box_amodal_px)
    assert np.all(visible[:2] + 0.5 >= amodal[:2] - 0.01)
    assert np.all(visible[2:] - 0.5 <= amodal[2:] + 0.01)
    assert np.abs(visible - amodal).max() < 1.5
    assert check_amodal_box(truth, board) == []
    corners = view(scene.camera).camera_from_target.apply(joined_mesh(board).positions_m)
    vertices = scene.camera.project(corners)
    by_vertices = (*vertices.min(axis=0).tolist(), *vertices.max(axis=0).tolist())
    assert check_amodal_box(msgspec.structs.replace(truth, box_amodal_px=by_vertices), board)
