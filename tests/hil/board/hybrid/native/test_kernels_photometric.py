"""Brightness, score, derivatives and steps by the compiled library: what numpy says of the same drawings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np
import numpy_drawing
import pytest

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.model import face_gains as levels
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.hybrid.refine import motion_images as motion
from flyaround.hil.board.hybrid.refine import photometric
from flyaround.hil.board_model.write import board_record
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.board.estimation.faces import Faces

CAMERA = CameraIntrinsics(200, 160, 400.0, 400.0, 99.5, 79.5)
SUN = np.array([0.3, -0.5, 0.7])


@pytest.fixture(scope="module", params=["bytes number its groups", "more groups than that"])
def craft(request: pytest.FixtureRequest, tango: BoardModel) -> BoardModel:
    assert tango.faces is not None
    return replace(tango, faces=tango.faces.grouped(40)) if "more" in request.param else tango


@pytest.fixture(scope="module")
def tango() -> BoardModel:
    return BoardModel.from_dict(msgspec.to_builtins(board_record(load_target("tango"))))


@pytest.fixture
def by_numpy(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Use NumPy in place of the library."""

    def from_here() -> None:
        monkeypatch.setattr(levels, "_shade_groups", numpy_drawing.shaded)
        monkeypatch.setattr(levels, "_with_background", numpy_drawing.with_background)
        monkeypatch.setattr(motion, "motion_images", numpy_drawing.motion_images)
        monkeypatch.setattr(photometric, "_gram", numpy_drawing.gram)
        monkeypatch.setattr(photometric, "_unexplained", numpy_drawing.unexplained)

    return from_here


def scene(
    craft: BoardModel, rng: np.random.Generator, k: int, fine: int = 2
) -> tuple[Faces, ImagePatch, np.ndarray, np.ndarray, ShadowMap | None]:
    """A craft somewhere, on a picture of it from nearby: noisy, some saturated, some before a texture."""
    faces = craft.faces
    assert faces is not None
    t = np.array([0.0, 0.0, craft.radius_m * rng.uniform(5, 9)]) + rng.normal(size=3) * craft.radius_m * 0.2
    q = quat.normalise(rng.normal(size=4))
    # taller pixels, and a side that no register is filled from to the end
    blank = ImagePatch(
        np.zeros((77, 101), np.float32), 2.0, 8.0, 3.0, 1.8, fine, pixel_aspect=1.01, exact=bool(k % 2)
    )
    R, there = quat.matrix(q), t * (1 + 0.01 * rng.normal(size=3))
    seen = draw_faces(faces, order_faces(faces, -R.T @ there), CAMERA, R, there, blank)
    light = np.concatenate([[0.0], rng.uniform(0, 290, len(faces.corners))]).astype(np.float32)
    light[1:] = light[1 + faces.group]
    behind = (
        cv2.GaussianBlur(rng.normal(60, 90, (77, 101)).astype(np.float32), (0, 0), 6) if k % 3 == 0 else 0
    )
    picture = cv2.resize(light[seen], (101, 77), interpolation=cv2.INTER_AREA) + behind
    gray = np.clip(picture + rng.normal(0, 4, (77, 101)), 0, 255).astype(np.float32)
    plain = cv2.GaussianBlur(gray, (0, 0), 6) if k % 3 == 0 else 3.0
    canvas = replace(blank, gray=gray, background_level=plain, clipped=4.0 if k % 2 else 0.0)
    return faces, canvas, q, t, ShadowMap.from_faces(faces, SUN, 96) if k % 4 > 1 else None


def test_brightness_and_score_are_numpys(craft: BoardModel, by_numpy: Callable[[], None]) -> None:
    rng, cases, native = np.random.default_rng(1), [], []
    for k in range(12):
        faces, canvas, q, t, sun = scene(craft, rng, k, fine=2 + k // 10)
        R = quat.matrix(q)
        seen = draw_faces(faces, order_faces(faces, -R.T @ t), CAMERA, R, t, canvas)
        dark = None if sun is None else sun.shadows(faces, seen, canvas, CAMERA, R, t)
        cases.append((faces, seen, canvas, dark))
        shading = levels.shade(*cases[-1])
        native.append((shading, photometric.explained(shading, canvas)))
    by_numpy()
    for (one, score), case in zip(native, cases, strict=True):
        other, canvas = levels.shade(*case), case[2]
        # where many groups are seen bytes number them anew
        np.testing.assert_allclose(one.level[one.group], other.level[other.group], atol=2e-4)
        np.testing.assert_array_equal(one.area[one.centre], other.area[other.centre])
        np.testing.assert_allclose(one.picture, other.picture, atol=1e-3)
        assert (one.background_offset is None) == (other.background_offset is None)
        if one.background_offset is not None and other.background_offset is not None:
            np.testing.assert_allclose(one.background_offset, other.background_offset, atol=1e-3)
        assert score == pytest.approx(photometric.explained(other, canvas), abs=1e-5)


def test_more_groups_than_a_byte_numbers_are_joined(by_numpy: Callable[[], None]) -> None:
    round_craft = BoardModel.from_dict(msgspec.to_builtins(board_record(load_target("soyuz-ms"))))
    assert round_craft.faces is not None
    fine = replace(round_craft, faces=round_craft.faces.grouped(24))
    rng, scores, joined = np.random.default_rng(4), [], 0
    for k in range(8):
        faces, canvas, q, t, sun = scene(fine, rng, k)
        shading = photometric.photo_draw(q, t, faces, canvas, CAMERA, sun)
        assert shading.group.dtype == np.uint8
        scores.append((photometric.explained(shading, canvas), (q, t, faces, canvas, CAMERA, sun)))
    by_numpy()
    for score, case in scores:
        all_groups = photometric.photo_draw(*case)
        joined += len(np.unique(all_groups.group)) > 255
        assert score == pytest.approx(photometric.explained(all_groups, case[3]), abs=0.05)
    assert joined


def test_derivatives_and_steps_are_numpys(craft: BoardModel, by_numpy: Callable[[], None]) -> None:
    rng, cases, native = np.random.default_rng(2), [], []
    for k in range(12):
        faces, canvas, q, t, sun = scene(craft, rng, k, fine=2 + k // 10)
        shading = photometric.photo_draw(q, t, faces, canvas, CAMERA, sun)
        # the last reaches farther than any that is worked out by itself
        blur, joint = ((2.0, 16), (0.8, 40), (0.0, 62), (0.3, 0), (3.0, 16))[k % 5]
        moving = (shading, faces, canvas, CAMERA)
        fit = photometric.PoseFit(q, t)
        cases.append((moving, quat.matrix(q), t, fit, blur, joint))
        native.append(
            (
                motion.motion_images(*moving, quat.matrix(q), t),
                photometric.photo_step(fit, *moving, craft.radius_m, blur, joint=joint),
            )
        )
    by_numpy()
    for (images, one), (moving, R, t, fit, blur, joint) in zip(native, cases, strict=True):
        reference = motion.motion_images(*moving, R, t)
        np.testing.assert_allclose(images, reference, atol=1e-5 * np.abs(reference).max())
        other = photometric.photo_step(fit, *moving, craft.radius_m, blur, joint=joint)
        assert one is not None
        assert other is not None
        moved = np.abs(other.t - t).max() + craft.radius_m * quat.angle_rad(other.q, fit.q)
        assert np.abs(one.t - other.t).max() < 1e-3 * moved
        assert craft.radius_m * quat.angle_rad(one.q, other.q) < 1e-3 * moved
        np.testing.assert_allclose(
            np.sqrt(np.diag(one.covariance)), np.sqrt(np.diag(other.covariance)), rtol=1e-3
        )


def test_poses_and_pictures_that_are_none_harm_nothing(craft: BoardModel) -> None:
    faces, canvas, *_ = scene(craft, np.random.default_rng(3), 0)
    for shape in ((77, 101), (1, 40), (40, 1), (2, 2)):
        small = replace(
            canvas, gray=np.full(shape, np.nan, np.float32), background_level=np.zeros(shape, np.float32)
        )
        wild = np.arange(small.fine**2 * shape[0] * shape[1], dtype=np.int32).reshape(
            -1, small.fine * shape[1]
        )
        for seen in (wild % 90 - 50, np.zeros_like(wild), np.full_like(wild, 2**31 - 1)):
            shading = levels.shade(faces, seen, small, wild % 2 == 0)
            photometric.explained(shading, small)
            for place in ([np.nan] * 3, [0, 0, -5.0], [1e30, 0, 1.0], [0, 0, 0]):
                images = motion.motion_images(
                    shading, faces, small, CAMERA, np.eye(3), np.array(place, float)
                )
                assert images.shape == (6, *shape)
                moving = (shading, faces, small, CAMERA, np.eye(3), np.array(place, float))
                photometric._gram(*moving, (0.5, 2.0, 2.06), 1.0, 0.2, 16.0, 40)
