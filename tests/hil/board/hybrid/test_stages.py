"""Each stage of the estimator on inputs whose answer is known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.record import Trace
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.debug.stage_pictures import write_stage_pictures
from flyaround.hil.board.hybrid.decide.confidence import Evidence, confidence, decide
from flyaround.hil.board.hybrid.geometry.wireframe import jacobian, project
from flyaround.hil.board.hybrid.image.edge_field import edge_field, gradient_noise
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.view_tables import build_views
from flyaround.hil.board.hybrid.model.visibility import occluders, sample_edges, visible_samples
from flyaround.hil.board.hybrid.propose.plane_poses import plane_poses
from flyaround.hil.board.hybrid.propose.regions import propose_regions, straight_windows
from flyaround.hil.board.hybrid.refine.edges import align_to_field
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients
from tests.harness.box_model import box_model

CAMERA = CameraIntrinsics(640, 480, 800.0, 800.0, 320.0, 240.0)
MODEL = BoardModel.from_dict(box_model())
POSE_Q = quat.normalise(np.array([0.7, 0.5, -0.3, 0.2]))
POSE_T = np.array([0.1, -0.05, 3.0])


@pytest.mark.parametrize("sigma", [2.0, 6.0, 12.0])
def test_noise_is_measured_through_the_clip_at_black(sigma: float) -> None:
    rng = np.random.default_rng(4)
    dark = np.clip(rng.normal(0, sigma, (300, 400)) + 0.5, 0, 255).astype(np.uint8)
    assert noise_sigma(dark, 255.0) == pytest.approx(sigma, rel=0.4)
    dark[50:250, 100:300] = np.clip(rng.normal(120, sigma, (200, 200)), 0, 255).astype(np.uint8)
    assert noise_sigma(dark, 255.0) == pytest.approx(sigma, rel=0.15)


def test_region_holds_a_dim_part_beside_a_bright_one() -> None:
    rng = np.random.default_rng(5)
    small = rng.normal(3, 1.5, (300, 480)).astype(np.float32)
    small[100:140, 200:260] += 200
    small[115:125, 260:300] += 25
    regions, busy, _ = propose_regions(small, eliminate_weak_gradients(small), 1.5)
    assert busy < 0.05
    r = regions[0]
    assert (r.x0, r.y0, r.x1, r.y1) == pytest.approx((800, 400, 1200, 560), abs=16)


@pytest.mark.parametrize("seed", [416, 688, 872])
def test_windows_of_straight_lines_hold_what_made_them(seed: int) -> None:
    # a cross whose middle lies beside the pixel that it is counted at must be found from there
    middle = np.random.default_rng(seed).uniform([0, 0], [160, 100], (1, 2)).repeat(2, axis=0)
    half = np.array([[6.0, 0.0], [0.0, 6.0]])
    cross = np.concatenate([middle - half, middle + half], axis=1)
    boxes = straight_windows(np.zeros((100, 160), np.float32), cross)
    assert any(np.allclose(box, (*(middle[0] - 6), *(middle[0] + 6))) for box in boxes)


def test_nearest_edges_are_told_apart_by_direction() -> None:
    image = np.zeros((120, 160), np.float32)
    image[:, 80:] = 100
    field = edge_field(image, (0, 0, 160, 120), 1.0, 200)
    assert field.factor == 1.0
    flat, inside = field.lookup(np.array([[70.0, 60.0], [70.0, 60.0]]), np.array([0.0, np.pi / 2]))
    assert inside.all()
    across, along = field.distance.reshape(-1)[flat]
    assert across == pytest.approx(9.5, abs=1.0)
    assert along > 1000
    assert gradient_noise(1.0) > gradient_noise(1.7) > 0
    # few places are looked up without the whole table
    everywhere, _ = field.lookup(np.random.default_rng(1).uniform(0, 119, (400, 2)), np.linspace(0, 3, 400))
    near = field.distance.reshape(-1)[everywhere] < 1000
    assert near.sum() > 50
    whole = field.nearest.reshape(-1, 2)[everywhere]
    assert np.array_equal(field.nearest_at(everywhere)[near], whole[near])


def test_plane_poses_hold_the_true_one() -> None:
    rng = np.random.default_rng(6)
    square = np.array([[-0.4, 0.3, 0.1], [-0.4, -0.3, 0.1], [0.4, -0.3, 0.1], [0.4, 0.3, 0.1]])
    for _ in range(50):
        q = quat.normalise(rng.normal(size=4))
        t = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(3, 15)])
        p = square @ quat.matrix(q).T + t
        if abs((quat.matrix(q) @ [0, 0, 1]) @ t) < 0.15 * np.linalg.norm(t):
            continue
        qs, ts, valid = plane_poses(square[None], (p[:, :2] / p[:, 2:])[None])
        assert valid.all()
        k = int(np.argmin(quat.angle_rad(qs[0], q)))
        assert quat.angle_rad(qs[0, k], q) < 1e-5
        assert ts[0, k] == pytest.approx(t, rel=1e-5, abs=1e-5)


def test_a_box_shows_three_faces_and_nine_edges() -> None:
    samples, occ = sample_edges(MODEL, 0.02), occluders(MODEL)
    visible, outline = visible_samples(samples, occ, np.array([2.0, 1.8, 1.5]))
    assert len(set(samples.edge[visible])) == 9
    assert len(set(samples.edge[visible & outline])) == 6


def test_the_outline_of_a_rod_lies_a_radius_from_its_axis() -> None:
    data = box_model()
    data["wireframe"] = [
        {"name": "rod", "a_m": [-0.5, 0, 0], "b_m": [0.5, 0, 0], "normals": [], "radius_m": 0.03}
    ]
    samples = sample_edges(BoardModel.from_dict(data), 0.1)
    X, _ = samples.outline(np.arange(len(samples))[None], np.array([[0, 0, -4.0]]))
    assert np.sort(np.unique(X[0, :, 1].round(6))).tolist() == [-0.03, 0.03]


def test_the_jacobian_is_the_derivative() -> None:
    samples = sample_edges(MODEL, 0.2)
    idx = np.arange(len(samples))[None]
    q, t = POSE_Q[None], POSE_T[None]
    pr = project(samples, CAMERA, quat.matrix(q), t, idx)
    J = jacobian(pr, CAMERA, t)[0]
    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-6
        q2, t2 = quat.multiply(quat.from_rotvec(step[:3]), q), t + step[3:]
        moved = project(samples, CAMERA, quat.matrix(q2), t2, idx)
        slope = np.einsum("mi,mi->m", (moved.pixels - pr.pixels)[0], pr.normals[0]) / 1e-6
        assert J[:, k] == pytest.approx(slope, abs=0.05)


def test_alignment_pulls_a_pose_onto_its_edges() -> None:
    samples, occ = sample_edges(MODEL, 0.02), occluders(MODEL)
    table = build_views(MODEL, samples, occ, 3.0, views=150)
    R = quat.matrix(POSE_Q)
    visible, _ = visible_samples(samples, occ, -R.T @ POSE_T)
    image = np.zeros((480, 640), np.float32)
    corners = MODEL.vertices_m[MODEL.triangles] @ R.T + POSE_T
    for k, triangle in enumerate(CAMERA.pixels(corners)):
        a, b, c = corners[k]
        if np.cross(b - a, c - a) @ a < 0:
            cv2.fillConvexPoly(
                image, np.rint(triangle * 16).astype(np.int32), 60.0 + 25 * (k // 2), cv2.LINE_8, 4
            )
    field = edge_field(image, (0, 0, 640, 480), 1.0, 640)
    start = quat.multiply(quat.from_rotvec(np.array([0.06, -0.05, 0.05])), POSE_Q)[None]
    target = PreparedTarget(MODEL, CAMERA, samples, 0.02, occ, (table,), MODEL.centre_m, MODEL.radius_m)
    q, t = align_to_field(target, start, (POSE_T * 1.03)[None], table, field, (20, 16, 12, 9, 7, 6, 5))
    assert visible.sum() > 50
    assert np.degrees(quat.angle_rad(q[0], POSE_Q)) < 1.0
    assert np.linalg.norm(t[0] - POSE_T) < 0.03


def evidence(**change: float) -> Evidence:
    good: dict[str, Any] = {
        "drawn": 0.9,
        "explained": 0.9,
        "outside": 0.0,
        "margin": 0.2,
        "matched_share": 0.9,
        "tight": 0.8,
        "rms_px": 0.3,
        "sigma_rad": 0.002,
        "sigma_share": 0.001,
        "edges": 200,
        "size_px": 300.0,
        "empty": True,
    }
    return Evidence(**{**good, **change})


def test_good_evidence_is_accepted() -> None:
    assert decide(evidence()) == ""
    assert confidence(evidence()) > 0.95


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"margin": 0.0}, "ambiguous"),
        ({"edges": 5}, "few edges"),
        ({"size_px": 40.0}, "too small"),
        ({"drawn": 0.1}, "supported"),
        ({"sigma_rad": 0.5}, "confidence"),
    ],
)
def test_weak_evidence_is_declined_and_says_why(change: dict[str, float], word: str) -> None:
    assert word in decide(evidence(**change))
    assert confidence(evidence(**change)) <= confidence(evidence())


def test_a_stage_picture_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    image = np.random.default_rng(1).integers(0, 255, (CAMERA.height_px, CAMERA.width_px), np.uint8)
    trace: Trace = {"image_gradient": eliminate_weak_gradients(image)}
    result = PoseResult(
        accepted=False,
        reason="nothing there",
        q_camera_from_target_wxyz=None,
        t_camera_from_target_m=None,
        confidence=0.0,
    )
    names = write_stage_pictures(tmp_path, image, trace, result, MODEL, CAMERA)
    assert cv2.imread(str(tmp_path / names[0])).shape[2] == 3
    with pytest.raises(FileNotFoundError, match="gone"):
        write_stage_pictures(tmp_path / "gone", image, trace, result, MODEL, CAMERA)
