"""BOP's boxes and counts against a raster of the whole craft on a larger image, and models of the shapes drawn."""

import dataclasses
import io
import json

import msgspec
import numpy as np
import pytest
import trimesh
from small_flight import small_flight

import flyaround as fa
from flyaround.simulator.dataset.capture import capture_card
from flyaround.simulator.dataset.formats.bop import gt_info
from flyaround.simulator.dataset.formats.labelled_frame import frame_from_files
from flyaround.simulator.dataset.formats.native import encode_frame
from flyaround.simulator.dataset.formats.registry import find_format
from flyaround.simulator.scenario.poses import scene_with_pose
from flyaround.simulator.scenario.vary import Vary
from flyaround.simulator.targets.joined_mesh import joined_mesh

pytestmark = pytest.mark.gl
SIZE = np.array([192, 120])


@pytest.fixture(scope="module")
def plan():
    plan = small_flight(int(SIZE[0]), n=1)
    return dataclasses.replace(plan, camera=dataclasses.replace(plan.camera, height_px=int(SIZE[1])))


def by_the_toolkit(renderer, scene, target):
    """The entry as `calc_gt_info.py` makes it: from the craft on a canvas of three images by three."""
    camera = scene.camera
    large = dataclasses.replace(
        camera,
        width_px=3 * camera.width_px,
        height_px=3 * camera.height_px,
        cx_px=camera.cx_px + camera.width_px,
        cy_px=camera.cy_px + camera.height_px,
    )
    whole = np.isfinite(renderer.surfaces(dataclasses.replace(scene, camera=large), target).depth_m)
    seen = whole[SIZE[1] : 2 * SIZE[1], SIZE[0] : 2 * SIZE[0]]

    def box(mask, origin):
        ys, xs = mask.nonzero()
        return [xs.min() - origin[0], ys.min() - origin[1], xs.max() - xs.min(), ys.max() - ys.min()]

    visible = int(seen.sum())
    return {
        "bbox_obj": box(whole, SIZE) if visible else [-1] * 4,
        "bbox_visib": box(seen, (0, 0)) if visible else [-1] * 4,
        "px_count_all": int(whole.sum()),
        "px_count_valid": visible,
        "px_count_visib": visible,
        "visib_fract": visible / whole.sum() if whole.any() else 0.0,
    }


@pytest.mark.parametrize(
    ("share_x", "share_y"),
    [
        (0, 0),
        (0.45, 0),
        (-0.5, 0),
        (0, 0.5),
        (0, -0.48),
        (0.5, 0.5),
        (-0.55, 0.4),
        (0.9, 0),
        (0, 1.2),
        (4.0, 0),
    ],
)
@pytest.mark.parametrize("z_m", [3.0, 8.0])
def test_boxes_and_counts_of_craft_in_part_or_wholly_outside(renderer, plan, share_x, share_y, z_m):
    camera = plan.camera
    t = np.array([share_x * SIZE[0] / camera.fx_px, share_y * SIZE[1] / camera.fy_px, 1.0]) * z_m
    pose = fa.Pose.from_arrays("camera", "target", (0.5, 0.5, -0.5, 0.5), t)
    scene = scene_with_pose(plan.scene(0), plan.target, pose, 0)
    taken = fa.take_frame(renderer, scene, plan.target)
    found = gt_info(frame_from_files(0, encode_frame(taken)), plan.target)
    wanted = by_the_toolkit(renderer, scene, plan.target)
    assert found["px_count_visib"] == found["px_count_valid"] == wanted["px_count_visib"]
    # outlines of the part beside the image are filled by OpenCV, half a pixel more or less
    assert found["px_count_all"] == pytest.approx(wanted["px_count_all"], rel=0.08, abs=12)
    assert found["visib_fract"] == pytest.approx(wanted["visib_fract"], abs=0.05)
    assert found["bbox_visib"] == pytest.approx(wanted["bbox_visib"])
    assert found["bbox_obj"] == pytest.approx(wanted["bbox_obj"], abs=1)


def test_each_shape_that_was_drawn_has_its_model(renderer, plan):
    vary = msgspec.convert({"craft": {"every": 2, "model_error_mm": [5.0, 9.0]}}, Vary)
    varied = fa.varied_plan(dataclasses.replace(plan, times_s=(0.0, 1.0, 2.0, 3.0)), vary)
    written = {}
    files = type("Files", (), {"write": lambda _self, name, data: written.__setitem__(name, data)})()
    writer = find_format("bop").open_writer(files, capture_card(varied, ("bop",), (), None, ()))
    for k, frame in enumerate(fa.run_frames(varied, renderer)):
        writer.write(frame_from_files(k, encode_frame(frame)))
    writer.finish()
    gt = json.loads(written["train/000000/scene_gt.json"])
    assert [gt[str(k)][0]["obj_id"] for k in range(4)] == [1, 1, 2, 2]
    infos = json.loads(written["models/models_info.json"])
    assert sorted(infos) == ["1", "2"]
    for k, number in ((0, 1), (2, 2)):
        mesh = trimesh.load(
            io.BytesIO(written[f"models/obj_{number:06d}.ply"]), file_type="ply", process=False
        )
        drawn = joined_mesh(varied.target_of(k)).positions_m * 1e3
        np.testing.assert_allclose(mesh.vertices, drawn, atol=1e-2)
        moved = np.linalg.norm(drawn - joined_mesh(varied.target).positions_m * 1e3, axis=1).max()
        assert 4.9 < moved < 9.1
        assert infos[str(number)]["min_x"] == pytest.approx(drawn[:, 0].min(), abs=1e-2)
