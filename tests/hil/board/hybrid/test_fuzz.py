"""Pictures no estimator should believe: every method declines with a reason, raises nothing, accepts nothing wrong."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from drawn_craft import Craft

from flyaround.hil.board.estimation import CameraIntrinsics, Estimator, PoseResult
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.method_names import METHODS
from flyaround.hil.board.methods import make_estimator

# small, so that every method sees every picture
CAMERA = CameraIntrinsics(256, 192, 420.0, 420.0, 127.5, 95.5)
SHAPE = (CAMERA.height_px, CAMERA.width_px)


@pytest.fixture(scope="module", params=METHODS)
def estimator(request: pytest.FixtureRequest) -> Estimator:
    cv2.setNumThreads(1)
    return make_estimator(Craft().model(), CAMERA, request.param)


@pytest.fixture(scope="module", params=[m for m in METHODS if m != "hybrid-track"])
def single(request: pytest.FixtureRequest) -> Estimator:
    """Every method that answers for itself: tracking begins with one of them."""
    cv2.setNumThreads(1)
    return make_estimator(Craft().model(), CAMERA, request.param)


UNUSABLE: dict[str, Any] = {
    "none": None,
    "a list": [[1, 2], [3, 4]],
    "a string": "picture",
    "bytes": b"\x00" * 256,
    "empty": np.zeros((0, 0), np.uint8),
    "no rows": np.zeros((0, 256), np.uint8),
    "one number": np.uint8(3),
    "a vector": np.zeros(256 * 192, np.uint8),
    "colour": np.zeros((*SHAPE, 3), np.uint8),
    "one channel more": np.zeros((*SHAPE, 1), np.uint8),
    "float": np.zeros(SHAPE, np.float32),
    "NaN": np.full(SHAPE, np.nan),
    "infinite": np.full(SHAPE, np.inf, np.float32),
    "signed": np.zeros(SHAPE, np.int16),
    "wide": np.zeros(SHAPE, np.uint32),
    "bool": np.ones(SHAPE, bool),
    "objects": np.full(SHAPE, None),
    "big-endian": np.full(SHAPE, 7, ">u2"),
    "complex": np.zeros(SHAPE, complex),
    "text": np.full(SHAPE, "x"),
    "turned": np.zeros(SHAPE[::-1], np.uint8),
    "another camera's": np.zeros((1200, 1920), np.uint8),
    "black": np.zeros(SHAPE, np.uint8),
    "white": np.full(SHAPE, 255, np.uint8),
    "white 16": np.full(SHAPE, 65535, np.uint16),
}


@pytest.mark.parametrize("name", UNUSABLE)
def test_what_is_no_picture_is_declined_at_once(estimator: Estimator, name: str) -> None:
    result = estimator.estimate(UNUSABLE[name])
    assert not result.accepted
    assert result.reason
    assert not result.reason.startswith("internal")
    assert result.q_camera_from_target_wxyz is None
    assert result.confidence == 0.0


def strange(name: str, rng: np.random.Generator) -> np.ndarray:
    """Usable pictures without the craft."""
    h, w = SHAPE
    y, x = np.mgrid[:h, :w]
    image = {
        "half_saturated": np.where(x < w // 2, 255.0, 0.0),
        "nearly_saturated": 255.0 - (rng.uniform(size=SHAPE) < 0.001),
        "one_pixel": 255.0 * ((x == 100) & (y == 80)),
        "salt": 255.0 * (rng.uniform(size=SHAPE) < 0.05),
        "noise": rng.uniform(0, 255, SHAPE),
        "ramp": x * (255.0 / w),
        "stripes": 200.0 * ((x // 9) % 2),
        "rows_lost": np.where((y // 8) % 3 == 0, 0.0, rng.normal(90, 30, SHAPE)),
        "stars": rng.normal(8, 6, SHAPE) + 255.0 * (rng.uniform(size=SHAPE) < 0.001),
        "clouds": 110.0
        + sum(
            s * cv2.resize(rng.normal(0, 1, (h // s, w // s)), (w, h), interpolation=cv2.INTER_CUBIC)
            for s in (4, 15, 60)
        ),
        "limb": np.where(np.hypot(x - 80, y - 550) < 450, 140.0, 0.0) + rng.normal(0, 12, SHAPE),
        "disc": 180.0 * (np.hypot(x - 120, y - 90) < 60) + rng.normal(10, 5, SHAPE),
        "lines": sum(
            200.0 * (np.abs((x - 128) * np.cos(a) + (y - 96) * np.sin(a) - 20) < 1.2) for a in range(5)
        ),
    }[name]
    return np.clip(image, 0, 255).astype(np.uint8)


EVERY = ("half_saturated", "nearly_saturated", "one_pixel", "salt", "noise", "ramp", "stripes", "rows_lost")
STRANGE = (
    "lines",
    "limb",
    *(pytest.param(name, marks=pytest.mark.slow) for name in (*EVERY, "disc", "stars", "clouds")),
)


@pytest.mark.parametrize("name", STRANGE)
def test_what_shows_no_craft_is_not_accepted(single: Estimator, name: str) -> None:
    image = strange(name, np.random.default_rng(60))
    for picture in (image, image.astype(np.uint16) * 257):
        result = single.estimate(picture)
        assert not result.accepted
        assert result.reason
        assert not result.reason.startswith("internal")
        well_formed(result)


@pytest.mark.slow
def test_a_craft_partly_or_wholly_out_of_the_frame_is_not_mistaken(single: Estimator) -> None:
    craft, rng = Craft(), np.random.default_rng(61)
    for x, y, z in ((0.9, 0.2, 3.0), (-1.1, -0.5, 3.2), (2.5, 0.0, 4.0), (0.0, 0.0, 60.0), (0.0, 0.1, 0.9)):
        q, t = quat.normalise(rng.normal(size=4)), np.array([x, y, z])
        big = craft.picture(q, t, np.array([0.2, 0.1, -0.97]), rng)
        image = np.ascontiguousarray(cv2.resize(big, SHAPE[::-1], interpolation=cv2.INTER_AREA))
        result = single.estimate(image)
        assert not result.reason.startswith("internal")
        well_formed(result)
        if result.accepted:
            assert result.t_camera_from_target_m is not None
            assert np.linalg.norm(result.t_camera_from_target_m - t) < 0.1 * z


@pytest.mark.slow
def test_views_of_other_memory_are_read_alike(single: Estimator) -> None:
    image = strange("ramp", np.random.default_rng(62))
    wide = np.zeros((SHAPE[0], 2 * SHAPE[1]), np.uint8)
    wide[:, ::2] = image
    frozen = image.copy()
    frozen.setflags(write=False)
    for picture in (wide[:, ::2], frozen, np.asfortranarray(image)):
        assert not single.estimate(picture).reason.startswith("internal")


def well_formed(result: PoseResult) -> None:
    """A pose that is given is finite, of unit length, in front of the camera."""
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    assert 0.0 <= result.confidence <= 1.0
    assert (q is None) == (t is None)
    if q is not None and t is not None:
        assert np.isfinite(q).all()
        assert np.isfinite(t).all()
        assert np.linalg.norm(q) == pytest.approx(1.0)
        assert t[2] > 0
