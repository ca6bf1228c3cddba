"""The published methods' own stages on inputs whose answer is known."""

import cv2
import numpy as np
import pytest

from flyaround.hil.board.estimation import BoardModel, BoardModelError, CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import undistorted_rays
from flyaround.hil.board.estimation.record import StageRecord
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.board.svd.ellipses import (
    EllipseFit,
    circle_poses,
    circle_views,
    hough_ellipses,
    model_circles,
)
from flyaround.hil.board.svd.line_streams import Streams, find_streams, harris_corners, sobel_edges
from flyaround.hil.board.svd.perceptual_groups import image_point_groups
from flyaround.hil.board.svd.pipeline import PublishedEstimator
from flyaround.hil.board.svd.pose_solvers import from_rotvecs, point_solver, three_point_poses
from flyaround.hil.board.svd.refinement import (
    corner_map,
    model_corners,
    refine_on_corners,
    reprojection,
)
from flyaround.hil.board.svd.region_of_interest import Region, grown_region
from flyaround.hil.board.svd.settings import SOLVERS, SVD_2018, SVD_THESIS
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients
from flyaround.hil.board.svd.wireframe_groups import model_point_groups
from tests.harness.box_model import box_model

CAMERA = CameraIntrinsics(640, 480, 900.0, 900.0, 319.5, 239.5)
HALF = np.array([0.5, 0.4, 0.15])
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * HALF
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
NORMALS = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))


def edge(a, b, normals, radius=0.0):
    return {"name": "e", "a_m": a.tolist(), "b_m": b.tolist(), "normals": normals, "radius_m": radius}


def box(*more):
    """A box of 1.0 x 0.8 x 0.3 m, and more edges."""
    record = box_model(tuple(HALF))
    return BoardModel.from_dict(record | {"wireframe": [*record["wireframe"], *more]})


MODEL = box(edge(np.array([0.5, 0.4, 0.15]), np.array([0.75, 0.6, 0.15]), [], 0.02))
Q, T = quat.normalise(np.array([0.8, 0.45, -0.35, 0.2])), np.array([0.15, -0.1, 4.0])


def test_the_wireframe_of_a_box_has_its_groups():
    groups = model_point_groups(MODEL)
    # six faces, each from its four corners in two senses
    assert groups.of_kind("closed_tetrad").shape == (6 * 8, 4, 3)
    assert groups.of_kind("open_tetrad").shape == (6 * 8, 5, 3)
    assert len(groups.of_kind("open_triad")) == 6 * 8
    # 8 corners of three edges: three pairs each, both ways round
    assert len(groups.of_kind("proximity_pair")) == 8 * 3 * 2
    assert groups.of_kind("antenna").shape == (2, 2, 3)


def test_a_drawn_face_and_rod_are_grouped():
    quad = np.array([[100.0, 100], [300, 120], [290, 260], [110, 250]])
    sides = [np.concatenate([quad[k], quad[(k + 1) % 4]]) for k in range(4)]
    rod = [np.array([320.0, 100, 400, 60]), np.array([322.0, 106, 402, 66])]
    groups = image_point_groups(np.array([*sides, *rod]), 300.0)
    assert len(groups.of_kind("closed_tetrad")) == 1
    found = groups.of_kind("closed_tetrad")[0]
    assert np.abs(np.sort(found, axis=0) - np.sort(quad, axis=0)).max() < 1.0
    assert len(groups.of_kind("antenna")) == 1
    assert groups.of_kind("antenna")[0].mean(axis=0) == pytest.approx([361, 83], abs=0.5)
    # with one side missing the face is an open triad, with one broken corner an open tetrad
    assert len(image_point_groups(np.array(sides[:3]), 300.0).of_kind("open_triad")) == 1
    broken = np.array([*sides[:3], np.concatenate([quad[3], 0.75 * quad[0] + 0.25 * quad[3]])])
    assert len(image_point_groups(broken, 300.0).of_kind("open_tetrad")) >= 1


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_gives_the_pose_of_exact_points(solver):
    plane = solver == "ippe"
    points = CORNERS[[0, 2, 6, 4]] if plane else CORNERS[[0, 3, 5, 6, 1, 7]]
    if solver in ("p3p", "ap3p"):
        points = points[: 3 if solver == "p3p" else 4]
    rays = undistorted_rays(CAMERA, CAMERA.pixels(points @ quat.matrix(Q).T + T))
    q, t = from_rotvecs(*point_solver(solver)(points, rays))
    errors = quat.angle_rad(q, Q) + np.linalg.norm(t - T, axis=1)
    assert errors.min() < 2e-3


def test_three_points_of_a_batch_give_the_truth_and_what_opencv_finds():
    rng = np.random.default_rng(5)
    q = quat.normalise(rng.normal(size=(300, 4)))
    t = np.stack([rng.uniform(-2, 2, 300), rng.uniform(-2, 2, 300), rng.uniform(3, 20, 300)], axis=-1)
    points = rng.uniform(-0.6, 0.6, (300, 3, 3))
    seen = np.einsum("nij,nkj->nki", quat.matrix(q), points) + t[:, None]
    rays = seen[..., :2] / seen[..., 2:]
    turned, moved, of = three_point_poses(points, rays)
    off = np.linalg.norm(moved - t[of], axis=1) + quat.angle_rad(turned, q[of])
    assert max(off[of == k].min() for k in range(300)) < 1e-6
    # every pose found puts the points where they were seen
    again = np.einsum("nij,nkj->nki", quat.matrix(turned), points[of]) + moved[:, None]
    assert np.abs(again[..., :2] / again[..., 2:] - rays[of]).max() < 1e-8
    for k in range(0, 300, 5):
        other_q, other_t = from_rotvecs(*point_solver("p3p")(points[k], rays[k]))
        mine = moved[of == k]
        assert len(mine) == len(other_t)
        assert all(np.linalg.norm(mine - shift, axis=1).min() < 1e-5 for shift in other_t)
        assert all(quat.angle_rad(turned[of == k], turn).min() < 1e-5 for turn in other_q)


def test_three_points_on_one_line_have_no_pose():
    line = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.0, 0, 0]]) @ quat.matrix(Q).T
    rays = ((line + T)[:, :2] / (line + T)[:, 2:])[None]
    assert len(three_point_poses(line[None], rays)[2]) == 0
    assert three_point_poses(np.zeros((0, 3, 3)), np.zeros((0, 3, 2)))[0].shape == (0, 4)


def test_refinement_on_corners_returns_to_the_truth():
    corners = model_corners(MODEL)
    region = Region(150, 90, 520, 380, "test")
    image = corner_map(CAMERA.pixels(corners.points_m @ quat.matrix(Q).T + T), region)
    q = quat.normalise(quat.multiply(quat.from_rotvec(np.array([0.02, -0.03, 0.02])), Q))[None]
    t = T[None] + [[0.01, -0.01, 0.05]]
    before = reprojection(q, t, corners, CAMERA, image)[0][0]
    q, t, covariance = refine_on_corners(q, t, corners, CAMERA, image, MODEL.radius_m)
    after = reprojection(q, t, corners, CAMERA, image)[0][0]
    assert after < 0.5 * before
    assert quat.angle_rad(q[0], Q) < 1e-3
    assert np.linalg.norm(t[0] - T) < 5e-3
    assert np.linalg.eigvalsh(covariance[0]).min() > 0


def drawn(shape, noise=6.0):
    image = np.zeros((480, 640), np.float32)
    if shape == "square":
        cv2.fillPoly(image, [np.array([[200, 150], [420, 170], [400, 330], [190, 300]])], 150)
    else:
        cv2.ellipse(image, (320, 240), (120, 70), 25, 0, 360, 150, -1)
    rng = np.random.default_rng(7)
    return np.clip(
        cv2.GaussianBlur(image, (0, 0), 1.0) + 10 + rng.normal(0, noise, image.shape), 0, 255
    ).astype(np.float32)


def test_both_streams_find_the_sides_and_harris_the_corners():
    image = drawn("square")
    wge = eliminate_weak_gradients(image, blur_px=1.5)
    region = Region(180, 140, 430, 340, "test")
    streams = find_streams(image, wge, region, SVD_THESIS)
    assert min(len(streams.by_name[s]) for s in ("wge", "sh")) >= 4
    # of some hundred segments one for each side, and a few strays
    assert 4 <= len(streams.lines) <= 10
    corners = harris_corners(image[140:340, 180:430], (180.0, 140.0))
    for at in ([200, 150], [420, 170], [400, 330], [190, 300]):
        assert np.linalg.norm(corners - at, axis=1).min() < 5
    thin = sobel_edges(image)
    assert 400 < thin.sum() < 3000
    bigger = grown_region(region, streams.lines, 0.05, image.shape)
    mean = np.hypot(*(streams.lines[:, 2:] - streams.lines[:, :2]).T).mean()
    assert region.x0 - bigger.x0 == pytest.approx(0.05 * mean)
    assert streams.region.x0 < region.x0


def test_a_line_that_leaves_the_region_keeps_its_end_and_one_outside_is_dropped():
    image = drawn("square")
    cv2.line(image, (60, 60), (60, 400), 200, 3)
    # the square's right side lies 30 px beyond this region: its middle is outside, the long sides' middles inside
    region = Region(180, 140, 390, 340, "test")
    streams = find_streams(image, eliminate_weak_gradients(image, blur_px=1.5), region, SVD_2018)
    ends = streams.lines.reshape(-1, 2)
    assert np.linalg.norm(ends - [420, 170], axis=1).min() < 6
    assert np.abs(ends[:, 0] - 60).min() > 50


def test_a_saturated_part_does_not_hide_the_rest_from_the_sobel_stream():
    image = drawn("square") * 0.3
    image[200:215, 450:520] = 255
    streams = find_streams(
        image, eliminate_weak_gradients(image, blur_px=1.5), Region(180, 140, 530, 340, "test"), SVD_THESIS
    )
    dim = streams.by_name["sh"][streams.by_name["sh"].max(axis=1) < 435]
    along = np.hypot(*(dim[:, 2:] - dim[:, :2]).T).sum()
    assert along > 0.7 * (221 + 161 + 212 + 150)


@pytest.mark.parametrize("config", [SVD_2018, SVD_THESIS])
def test_exact_lines_give_the_pose(config):
    """Everything after the streams, on the outline of a box that is drawn without error."""
    seen = [f for f, n in enumerate(NORMALS) if (quat.matrix(Q) @ n) @ (quat.matrix(Q) @ (n * HALF) + T) < 0]
    sides = {tuple(sorted((FACES[f][k], FACES[f][(k + 1) % 4]))) for f in seen for k in range(4)}
    pixels = CAMERA.pixels(CORNERS @ quat.matrix(Q).T + T)
    lines = np.array([np.concatenate([pixels[i], pixels[j]]) for i, j in sorted(sides)])
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    region = Region(*low, *high, "test")
    streams = Streams(lines, {"wge": lines}, np.zeros((0, 2)), (), region)
    frame = StageRecord(drawn("square").astype(np.uint8))
    result = PublishedEstimator(box(), CAMERA, config).from_streams(frame, streams)
    assert result.q_camera_from_target_wxyz is not None
    assert result.t_camera_from_target_m is not None
    # the box looks the same after a half turn about each of its axes
    turns = [np.eye(4)[k] for k in range(4)]
    off = min(
        quat.angle_rad(quat.multiply(result.q_camera_from_target_wxyz, turn)[None], Q)[0] for turn in turns
    )
    assert np.degrees(off) < 2
    assert np.linalg.norm(result.t_camera_from_target_m - T) < 0.05


def test_an_ellipse_is_found_by_its_hough_transform():
    found = hough_ellipses(sobel_edges(drawn("ellipse")), (0.0, 0.0), 280.0)
    e = found[0]
    assert (e.u, e.v, e.a, e.b) == pytest.approx((320, 240, 120, 70), abs=2.5)
    assert np.degrees(e.angle_rad) % 180 == pytest.approx(25, abs=2)


def test_a_circle_seen_as_an_ellipse_gives_its_pose():
    s = np.arange(48) * (2 * np.pi / 48)
    ring = np.stack([0.6 * np.cos(s), 0.6 * np.sin(s), np.full(48, 0.3)], axis=-1)
    model = box(*(edge(ring[k], ring[(k + 1) % 48], [(0, 0, 1), (1, 0, 0)]) for k in range(48)))
    circles = model_circles(model)
    assert circles[0].radius_m == pytest.approx(0.6, rel=0.01)
    pixels = CAMERA.pixels(ring @ quat.matrix(Q).T + T)
    views = circle_views(undistorted_rays(CAMERA, pixels))
    centre = quat.matrix(Q) @ [0, 0, 0.3] + T
    assert min(np.linalg.norm(0.6 * c - centre) for _, c in views) < 1e-6
    (u, v), (w, h), angle = cv2.fitEllipseDirect(pixels.astype(np.float32))
    long = np.radians(angle) + (0 if w >= h else np.pi / 2)
    q, t = circle_poses((EllipseFit(u, v, max(w, h) / 2, min(w, h) / 2, long, 1.0),), circles, CAMERA)
    near = np.linalg.norm(t - T, axis=1) < 0.1
    assert np.degrees(quat.angle_rad(q[near], Q).min()) < 8


@pytest.mark.parametrize(
    ("method", "solver", "streams", "word"),
    [
        ("guess", None, None, "unknown method"),
        ("hybrid", "epnp", None, "no choice"),
        ("svd-2018", "dls", None, "unknown solver"),
        ("svd-2018", None, ["wge", "x"], "unknown stream"),
    ],
)
def test_unknown_choices_are_refused(method, solver, streams, word):
    with pytest.raises(BoardModelError, match=word):
        make_estimator(MODEL, CAMERA, method, solver, streams)
