"""Rasteriser, shadows and hidden edges by the compiled library: the same answers as numpy's."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from kernel_oracle import raster as oracle

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.hybrid.model import rasteriser as shade
from flyaround.hil.board.hybrid.model.face_gains import shade as shaded
from flyaround.hil.board.hybrid.model.rasteriser import order_faces
from flyaround.hil.board.hybrid.model.shadow_map import BEHIND, ShadowMap, ShadowMapTable
from flyaround.hil.board.hybrid.model.visibility import occluders, sample_edges, visible_samples
from flyaround.hil.board.hybrid.propose.variants import _middle
from flyaround.hil.board_model.write import board_record
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(200, 160, 400.0, 400.0, 99.5, 79.5)


@pytest.fixture(scope="module")
def tango() -> BoardModel:
    return BoardModel.from_dict(msgspec.to_builtins(board_record(load_target("tango"))))


def some_pose(model: BoardModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Anywhere in view, now and then cut off by the picture's border."""
    t = np.array([0.0, 0.0, model.radius_m * rng.uniform(4, 12)])
    return quat.matrix(quat.normalise(rng.normal(size=4))), t + rng.normal(size=3) * model.radius_m * 0.4


def test_polygons_are_filled_to_the_pixel_as_by_opencv() -> None:
    rng = np.random.default_rng(4)
    for k in range(300):
        middle, size = rng.uniform(-50, 250, (40, 1, 2)), rng.choice([3, 20, 60, 300, 6000])
        a = np.sort(rng.uniform(0, 2 * np.pi, (40, 4)), axis=1)
        if k % 3 == 0:
            a[:, 3] = a[:, 2]
        # slender ones cross over themselves when they are rounded to sixteenths
        p = middle + size * np.stack([np.cos(a), np.sin(a) * rng.choice([1, 0.02])], axis=-1)
        p = p[:, ::-1] if k % 2 and k % 3 else p
        some = rng.permutation(40)
        one, other = (
            fill(p, some, (180, 200), 0.5, exact=k % 5 == 0) for fill in (shade.fill_faces, oracle.fill_faces)
        )
        np.testing.assert_array_equal(one, other)


def test_faces_are_ordered_and_drawn_as_by_numpy(tango: BoardModel) -> None:
    faces, rng = tango.faces, np.random.default_rng(5)
    empty = shade.ImagePatch(np.zeros((64, 80), np.float32), 1.0, 10.0, 5.0, 2.2, 3, tall=1.02)
    for k in range(40):
        R, t = some_pose(tango, rng)
        order = oracle.order_faces(faces, -R.T @ t)
        np.testing.assert_array_equal(order_faces(faces, -R.T @ t), order)
        canvas = replace(empty, exact=bool(k % 2))
        p = (CAMERA.pixels(faces.corners[order] @ R.T + t) - (10.0, 5.0) + 0.5) * canvas.scale - 0.5
        seen = shade.draw_faces(faces, order, CAMERA, R, t, canvas)
        # a corner within a rounding of a sixteenth's middle may fall either way
        assert np.mean(seen != oracle.fill_faces(p, order, seen.shape, 0.5, exact=canvas.exact)) < 1e-4
        assert seen.any()


@pytest.mark.parametrize("kind", [np.int32, np.uint16])
def test_the_suns_pictures_and_shadows_are_numpys(tango: BoardModel, kind: type) -> None:
    faces, rng = tango.faces, np.random.default_rng(6)
    canvas = shade.ImagePatch(np.zeros((100, 120), np.float32), 1.0, 10.0, 5.0, 1.6, 2, tall=1.02)
    poses = [some_pose(tango, rng) for _ in range(8)]
    suns = rng.normal(size=(8, 3))
    seen = [shade.draw_faces(faces, order_faces(faces, -R.T @ t), CAMERA, R, t, canvas) for R, t in poses]

    differ = shaded_px = 0
    for direction, one, (R, t) in zip(suns, seen, poses, strict=True):
        painted = ShadowMap.of(faces, direction, 96)
        sun = replace(painted, seen=painted.seen.astype(kind))
        *_, height, reference = oracle.seen_from_the_sun(faces, sun.direction, sun.axes, 96)
        np.testing.assert_allclose(sun.height, height, atol=2e-6)
        assert np.mean(sun.seen != reference) < 1e-4
        dark, expected = (
            shadows(sun, faces, one, canvas, CAMERA, R, t) for shadows in (ShadowMap.shadows, oracle.shadows)
        )
        differ, shaded_px = differ + int((dark != expected).sum()), shaded_px + int(expected.sum())
    assert shaded_px > 2000
    assert differ <= 1e-3 * shaded_px


@pytest.mark.parametrize("pixels", [60, 500, 10**6])
def test_the_sun_is_sought_as_by_numpy(tango: BoardModel, pixels: int) -> None:
    faces, rng = tango.faces, np.random.default_rng(7)
    table = ShadowMapTable.of(faces, 60)
    empty = shade.ImagePatch(rng.uniform(0, 90, (100, 120)).astype(np.float32), 1.0, 10.0, 5.0, 1.6, 2)
    for grouped in (faces, faces.grouped(40)):
        # bytes number few groups, two of them many
        R, t = some_pose(tango, rng)
        canvas = replace(empty)
        seen = shade.draw_faces(grouped, order_faces(grouped, -R.T @ t), CAMERA, R, t, canvas)
        shading, some = shaded(grouped, seen, canvas), np.arange(3, 60, 2)
        args = grouped, shading, canvas, CAMERA, R, t
        darkest, dim = float(canvas.gray.min()), max(2.0 * canvas.full / 255.0, canvas.sigma)
        every = oracle.sun_costs(table, *args, np.arange(60), pixels, darkest, dim)
        expected = oracle.sun_costs(table, *args, some, pixels, darkest, dim)
        np.testing.assert_allclose(table._costs(*args, some, pixels), expected, rtol=1e-5)
        # of directions that leave as much either may be named
        found = table.find(*args, 4, pixels)
        assert len(found) == 4
        facing = table.directions @ (-R.T @ t) / np.linalg.norm(t) > BEHIND
        assert every[found[0]] == pytest.approx(every[facing].min(), rel=1e-5)
    nothing = replace(shading, area=np.zeros_like(shading.area))
    assert table.find(grouped, nothing, canvas, CAMERA, R, t, 4, pixels) == []


def test_the_middle_of_what_is_seen_is_numpys(tango: BoardModel) -> None:
    craft = SimpleNamespace(model=tango, camera=CAMERA)
    canvas = shade.ImagePatch(np.zeros((64, 80), np.float32), 1.0, 10.0, 5.0, 2.2, 3)
    for x, seen in ((0.2, True), (9.0, False)):
        pose = Hypothesis(PoseFit(np.array([0.5, 0.5, -0.5, 0.5]), np.array([x, 0.1, 4.0])), Any)
        R = quat.matrix(pose.q)
        drawn = shade.draw_faces(
            tango.faces, order_faces(tango.faces, -R.T @ pose.t), CAMERA, R, pose.t, canvas
        )
        middle = _middle(craft, canvas, pose)
        np.testing.assert_allclose(middle, oracle.mean_pixel(drawn) / canvas.scale, atol=1e-9)
        assert np.isfinite(middle).all() == seen


@pytest.mark.parametrize("radius_m", [0.0, 0.02])
def test_what_hides_the_wireframe_is_numpys(tango: BoardModel, radius_m: float) -> None:
    samples, occ, rng = sample_edges(tango, 0.01), occluders(tango), np.random.default_rng(9)
    # round members besides: their outline lies beside them
    samples = replace(samples, radius_m=np.where(samples.edge % 3 == 0, radius_m, samples.radius_m))
    differ = hidden = 0
    for _ in range(12):
        R, t = some_pose(tango, rng)
        ours, reference = (see(samples, occ, -R.T @ t) for see in (visible_samples, oracle.visible_samples))
        np.testing.assert_array_equal(ours[1], reference[1])
        differ += int((ours[0] != reference[0]).sum())
        hidden += int((~reference[0]).sum())
    assert hidden > 2000
    # a sample on a hiding part's very edge may fall either way
    assert differ <= 1e-3 * hidden
    for place in ([np.nan] * 3, [np.inf, 0, 0], [0, 0, 0]):
        assert len(visible_samples(samples, occ, np.array(place, float))[0]) == len(samples)


def test_poses_that_are_none_draw_nothing_and_harm_nothing(tango: BoardModel) -> None:
    faces = tango.faces
    canvas = shade.ImagePatch(np.zeros((16, 16), np.float32), 1.0, 0.0, 0.0, 1.0, 3)
    sun = ShadowMap.of(faces, np.array([0.2, 0.3, 0.9]), 64)
    for place in ([np.nan] * 3, [0, 0, np.inf], [0, 0, -5.0], [1e30, 0, 1.0], [0, 0, 0]):
        R, t = np.eye(3), np.array(place, float)
        some = order_faces(faces, -t)
        seen = shade.draw_faces(faces, np.arange(len(faces.corners)), CAMERA, R, t, canvas)
        assert len(some) <= len(faces.corners)
        assert seen.min() >= 0
        assert seen.max() <= len(faces.corners)
        # whatever a picture holds: numbers of faces that are not there
        wild = np.full_like(seen, 2**31 - 1)
        wild[::2] = -5
        dark = sun.shadows(faces, wild, canvas, CAMERA, R, t)
        assert not dark.any()
        sun.shadows(faces, np.maximum(seen, 1), canvas, CAMERA, R, t)
    nothing = replace(canvas, gray=np.zeros((0, 4), np.float32))
    assert shade.draw_faces(faces, np.arange(9), CAMERA, np.eye(3), np.array([0, 0, 4.0]), nothing).size == 0
