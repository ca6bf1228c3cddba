"""Each stage of the estimator on inputs whose answer is known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics, undistorted_rays
from flyaround.hil.board.estimation.record import Trace
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.estimation.vectors import cross
from flyaround.hil.board.hybrid.debug.stage_pictures import write_stage_pictures
from flyaround.hil.board.hybrid.decide.confidence import Evidence, confidence, decide
from flyaround.hil.board.hybrid.geometry.wireframe import jacobian, project
from flyaround.hil.board.hybrid.image.edge_field import edge_field, gradient_noise
from flyaround.hil.board.hybrid.image.line_segments import cleaned_stream
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.hybrid.model.view_tables import build_views, sphere_directions
from flyaround.hil.board.hybrid.model.visibility import hidden, occluders, sample_edges, visible_samples
from flyaround.hil.board.hybrid.propose.plane_poses import plane_poses
from flyaround.hil.board.hybrid.propose.regions import propose_regions, straight_windows
from flyaround.hil.board.hybrid.refine.edges import align_to_field
from flyaround.hil.board.svd.perceptual_groups import (
    Lines,
    antennas,
    image_triads,
    parallel_pairs,
    proximity_pairs,
)
from flyaround.hil.board.svd.pose_solvers import solve_points
from flyaround.hil.board.svd.region_of_interest import marginal_interval
from flyaround.hil.board.svd.segment_merging import merge_segments
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients, exponential_threshold
from flyaround.hil.board.svd.wireframe_groups import model_triads

CAMERA = CameraIntrinsics(640, 480, 800.0, 800.0, 320.0, 240.0)


def box_model() -> dict[str, Any]:
    """A closed box of 1.0 x 0.8 x 0.4 m."""
    h = np.array([0.5, 0.4, 0.2])
    v = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * h
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    normals = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]]
    edges: dict[tuple[int, ...], list[list[int]]] = {}
    triangles = []
    for f, n in zip(faces, normals, strict=True):
        triangles += [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]
        for k in range(4):
            edges.setdefault(tuple(sorted((f[k], f[(k + 1) % 4]))), []).append(n)
    return {
        "schema": "flyaround.board_model",
        "version": 1,
        "name": "box",
        "sha256": "0",
        "keypoints": [{"name": f"corner_{i}", "position_m": p} for i, p in enumerate(v.tolist())],
        "wireframe": [
            {
                "name": f"edge_{a}_{b}",
                "a_m": v[a].tolist(),
                "b_m": v[b].tolist(),
                "normals": n,
                "radius_m": 0.0,
            }
            for (a, b), n in edges.items()
        ],
        "occluders": {"vertices_m": v.tolist(), "triangles": triangles},
        "symmetry_wxyz": [[0, 0, 0, 1]],
        "mass_kg": 10.0,
    }


MODEL = BoardModel.from_dict(box_model())
POSE_Q = quat.normalise(np.array([0.7, 0.5, -0.3, 0.2]))
POSE_T = np.array([0.1, -0.05, 3.0])


def test_quaternions_and_matrices_are_inverse() -> None:
    q = quat.normalise(np.random.default_rng(0).normal(size=(200, 4)))
    assert quat.angle_rad(quat.from_matrix(quat.matrix(q)), q).max() < 1e-6
    v = np.array([0.0, 0.0, np.pi / 2])
    assert quat.matrix(quat.from_rotvec(v)) @ [1, 0, 0] == pytest.approx([0, 1, 0])


@pytest.mark.parametrize(
    "change",
    [
        {"schema": "other"},
        {"version": 2},
        {"wireframe": []},
        {"wireframe": [{"name": "x", "a_m": [0, 0], "b_m": [0, 0, 1]}]},
        {"occluders": {"vertices_m": [[0, 0, 0]], "triangles": [[0, 1, 2]]}},
    ],
)
def test_a_bad_model_is_refused_with_a_reason(tmp_path: Path, change: dict[str, Any]) -> None:
    path = tmp_path / "model.json"
    path.write_text(json.dumps({**box_model(), **change}))
    with pytest.raises(BoardModelError, match="board model"):
        BoardModel.read(path)
    with pytest.raises(BoardModelError, match="cannot be read"):
        BoardModel.read(tmp_path / "missing.json")


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [("brown_conrady", (-0.22, 0.5, -7e-4, -2e-4, -0.13)), ("kannala_brandt", (-0.01, 0.02, -0.01, 0.002))],
)
def test_distortion_is_opencvs_and_undone(model: str, coefficients: tuple[float, ...]) -> None:
    camera = CameraIntrinsics(640, 480, 800.0, 810.0, 320.0, 240.0, model, coefficients)
    points = np.random.default_rng(1).uniform([-0.3, -0.2, 1], [0.3, 0.2, 1], (50, 3))
    K = np.array([[800.0, 0, 320], [0, 810, 240], [0, 0, 1]])
    d = np.array(coefficients)
    if model == "brown_conrady":
        expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, d)[0]
    else:
        expected = cv2.fisheye.projectPoints(points.reshape(1, -1, 3), np.zeros(3), np.zeros(3), K, d)[0]
    pixels = camera.pixels(points)
    assert np.abs(pixels - np.asarray(expected).reshape(-1, 2)).max() < 1e-9
    assert np.abs(undistorted_rays(camera, pixels) - points[:, :2]).max() < 1e-6


def test_threshold_of_an_exponential_is_4605_times_its_mean() -> None:
    x = np.random.default_rng(2).exponential(0.02, 400_000)
    counts = np.histogram(x, 100, (0, 1))[0]
    threshold = exponential_threshold(counts, 0.99)
    assert threshold == pytest.approx(4.605 * 0.02, rel=0.05)
    assert (x > threshold).mean() == pytest.approx(0.01, abs=0.003)


def test_weak_gradients_vanish_and_the_outline_stays() -> None:
    image = np.random.default_rng(3).normal(20, 3, (120, 160)).astype(np.float32)
    image[40:80, 50:110] += 150
    strong = eliminate_weak_gradients(image).strong
    ys, xs = np.nonzero(strong)
    assert (xs.min(), xs.max(), ys.min(), ys.max()) == pytest.approx((49, 110, 39, 80), abs=2)
    assert not strong[45:75, 56:104].any()
    assert marginal_interval(np.ones(1000), 0.025, 0.975) == pytest.approx((24, 974), abs=1)


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


def test_a_few_places_have_the_nearest_edges_of_the_tables() -> None:
    rng = np.random.default_rng(5)
    image = cv2.GaussianBlur(rng.uniform(0, 255, (120, 160)).astype(np.float32), (0, 0), 3.0)
    field = edge_field(
        cv2.normalize(image, None, 0, 200, cv2.NORM_MINMAX).astype(np.uint8), (0, 0, 160, 120), 1.0, 200
    )
    some = rng.choice(field.distance.size, 500, replace=False)
    table, (distance, place) = field.distance.reshape(-1)[some], field.nearest_to(some)
    y, x = np.divmod(some % field.mask.size, field.size[0])
    assert np.allclose(np.hypot(place[:, 0] - x, place[:, 1] - y), distance, atol=1e-4)
    # the tables' distances are OpenCV's of a mask of 5 x 5, a fortieth off at most
    assert np.all(np.abs(distance - table) <= 0.025 * table + 1e-3)
    # an edge that is as near may be another
    other = np.hypot(*(field.nearest_at(some) - np.stack([x, y], axis=-1)).T)
    assert np.all(distance <= other + 1e-4)


def test_noise_of_a_picture_scales_with_it() -> None:
    rng = np.random.default_rng(3)
    picture = np.clip(rng.normal(90, 4, (480, 640)), 0, 255).astype(np.uint8)
    few = noise_sigma(picture, 255.0)
    # eight bits are counted, sixteen sorted
    assert few == pytest.approx(4.0, rel=0.1)
    assert noise_sigma(picture.astype(np.uint16) * 257, 65535.0) == pytest.approx(257 * few, rel=1e-9)


def test_broken_and_doubled_segments_become_one_line() -> None:
    pieces = [[10, 10, 50, 30], [56, 33, 90, 50], [12, 11.5, 60, 35.2], [10, 100, 90, 100]]
    merged = merge_segments(np.array(pieces, float), 150.0)
    assert len(merged) == 2
    first = merged[0].reshape(2, 2)
    assert first[np.argsort(first[:, 0])] == pytest.approx(np.array([[10, 10], [90, 50]]), abs=1.0)


def test_figures_of_a_square_and_a_rod() -> None:
    square = [[20, 20, 98, 20], [100, 22, 100, 100], [98, 100, 22, 100], [20, 98, 20, 23]]
    rod = [[130, 20, 130, 90], [136, 20, 136, 90]]
    lines = Lines.of(np.array(square + rod, float))
    corners = proximity_pairs(lines, 8.0)
    assert len(corners.line) == 4
    chains = image_triads(lines, corners)
    assert chains.closed.sum() == 4
    assert np.sort(chains.points[0][:, 0]) == pytest.approx([20, 20, 100, 100], abs=1e-6)
    pairs = parallel_pairs(lines)
    assert [4, 5] in pairs.tolist()
    assert antennas(lines, pairs, 150.0).tolist() == [[4, 5]]


def test_the_box_has_closed_figures_on_its_six_faces() -> None:
    chains = model_triads(MODEL)
    # 6 faces x 4 middle edges x 2 ways round
    assert len(chains.closed) == 48
    assert chains.closed.all()


def test_hough_finds_the_sides_of_a_square() -> None:
    mask = np.zeros((200, 200), np.uint8)
    cv2.rectangle(mask, (40, 50), (160, 150), 1, 1)
    lines = merge_segments(cleaned_stream(mask, 156.0), 156.0)
    assert len(lines) == 4
    assert np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]).min() > 85


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


@pytest.mark.parametrize("solver", ["epnp", "sqpnp", "ap3p", "p3p", "iterative"])
def test_point_solvers_hold_the_true_pose(solver: str) -> None:
    # not one plane: EPnP and three-point solvers are ill-posed there
    points = np.array(
        [
            [-0.5, -0.4, 0.2],
            [0.5, -0.4, 0.2],
            [0.5, 0.4, -0.2],
            [-0.4, 0.4, 0.1],
            [0.1, 0.2, 0.3],
            [0.3, 0, -0.3],
        ]
    )
    if solver in ("ap3p", "p3p"):
        points = points[:4]
    p = points @ quat.matrix(POSE_Q).T + POSE_T
    q, t = solve_points(points, p[:, :2] / p[:, 2:], solver)
    k = int(np.argmin(quat.angle_rad(q, POSE_Q)))
    assert quat.angle_rad(q[k], POSE_Q) < 1e-3
    assert t[k] == pytest.approx(POSE_T, abs=5e-3)


def test_a_box_shows_three_faces_and_nine_edges() -> None:
    samples, occ = sample_edges(MODEL, 0.02), occluders(MODEL)
    visible, outline = visible_samples(samples, occ, np.array([2.0, 1.8, 1.5]))
    assert len(set(samples.edge[visible])) == 9
    assert len(set(samples.edge[visible & outline])) == 6
    behind = hidden(
        occ, np.array([3.0, 0, 0]), np.array([[-3.0, 0, 0], [2.0, 0, 0], [-3, 2, 0]]), np.zeros(3)
    )
    assert behind.tolist() == [True, False, False]


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
    q, t = align_to_field(
        start,
        (POSE_T * 1.03)[None],
        samples,
        table,
        field,
        CAMERA,
        MODEL.centre_m,
        MODEL.radius_m,
        (20, 16, 12, 9, 7, 6, 5),
    )
    assert visible.sum() > 50
    assert np.degrees(quat.angle_rad(q[0], POSE_Q)) < 1.0
    assert np.linalg.norm(t[0] - POSE_T) < 0.03


def test_directions_cover_the_sphere() -> None:
    d = sphere_directions(500)
    probe = quat.normalise(np.random.default_rng(7).normal(size=(300, 4)))[:, 1:]
    probe /= np.linalg.norm(probe, axis=1, keepdims=True)
    assert np.degrees(np.arccos(np.clip((probe @ d.T).max(axis=1), -1, 1))).max() < 8.0


def evidence(**change: float) -> Evidence:
    good: dict[str, Any] = {
        "drawn": 0.9,
        "explained": 0.9,
        "outside": 0.0,
        "margin": 0.2,
        "found": 0.9,
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
    assert decide(evidence(), 0.8) == ""
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
    assert word in decide(evidence(**change), 0.8)
    assert confidence(evidence(**change)) <= confidence(evidence())


def test_a_vector_product_is_numpys_to_the_bit() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(4, 50, 3)), rng.normal(size=(50, 3)) * 1e-3
    assert np.array_equal(cross(a, b), np.cross(a, b))
    assert np.array_equal(cross(a[0, 0], b[0]), np.cross(a[0, 0], b[0]))


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
