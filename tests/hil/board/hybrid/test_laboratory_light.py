"""Pictures of laboratories: smoothed noise, a black level, lamps instead of the Sun, faces burnt out."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from lamp_lit import MOCK_UP

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.hybrid.decide.confidence import Evidence, confidence
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.image.noise import black_level, coarse_noise, has_flat_floor, noise_sigma
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.prepare import prepare
from flyaround.hil.board.hybrid.search_states import PreparedImage
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
SIGMA, PEDESTAL = 8.0, 32.0


@pytest.fixture(scope="module")
def tango() -> BoardModel:
    return board_model(load_target("tango"))


@pytest.fixture(scope="module")
def estimator(tango: BoardModel) -> PoseEstimator:
    return PoseEstimator(tango, CAMERA)


def noise(shape: tuple[int, int], *, smooth: bool, seed: int = 1) -> np.ndarray:
    """Noise whose means over many pixels are those of white noise of ``SIGMA``."""
    white = np.random.default_rng(seed).normal(0, SIGMA, shape).astype(np.float32)
    return cv2.GaussianBlur(white, (0, 0), 0.8) if smooth else white


def reduced_of(image: np.ndarray) -> np.ndarray:
    return cv2.resize(image, (image.shape[1] // 4, image.shape[0] // 4), interpolation=cv2.INTER_AREA)


def picture(*, pedestal: float, smooth: bool = False) -> np.ndarray:
    """A bright plate before darkness."""
    light = np.zeros((300, 480), np.float32)
    light[90:200, 160:300] = 150.0
    return np.clip(np.rint(light + pedestal + noise(light.shape, smooth=smooth)), 0, 255).astype(np.uint8)


def test_means_over_many_pixels_show_noise_that_a_filter_has_smoothed() -> None:
    coarse, fine = {}, {}
    for smooth in (False, True):
        image = PEDESTAL + noise((600, 960), smooth=smooth)
        coarse[smooth] = coarse_noise(reduced_of(image.astype(np.float32)), 4)
        # what the mask of three pixels sees of it
        fine[smooth] = noise_sigma(np.clip(image, 0, 255).astype(np.uint8), 255.0)
    assert coarse[False] == pytest.approx(SIGMA, rel=0.15)
    assert fine[False] == pytest.approx(SIGMA, rel=0.1)
    assert coarse[True] > 0.5 * SIGMA
    assert fine[True] < 0.5 * coarse[True]


def test_the_black_level_is_that_of_the_darkest_parts() -> None:
    dark = PEDESTAL + noise((600, 960), smooth=False)
    dark[100:400, 200:500] += 120.0
    assert black_level(reduced_of(dark.astype(np.float32)), SIGMA / 4) == pytest.approx(PEDESTAL, abs=1.5)


def prepared(estimator: PoseEstimator, image: np.ndarray) -> PreparedImage:
    return prepare(estimator.setup, Observation(image))


def test_a_camera_with_a_black_level_is_one_of_a_laboratory(estimator: PoseEstimator) -> None:
    lit = prepared(estimator, picture(pedestal=PEDESTAL))
    assert lit.frame.black == pytest.approx(PEDESTAL, abs=2.0)
    smoothed = prepared(estimator, picture(pedestal=PEDESTAL, smooth=True))
    assert 0.5 * SIGMA < smoothed.frame.noise < 1.1 * SIGMA
    # the estimator itself is as it was: the next picture may be of another camera
    assert prepared(estimator, picture(pedestal=0.0)).frame.black == 0


def evidence(**changes: float | None) -> Evidence:
    """What was seen of a mock-up at the right pose."""
    return replace(MOCK_UP, **changes)


def test_what_burns_out_and_what_the_network_doubts_counts_against_a_pose() -> None:
    assert confidence(evidence(saturated=0.3)) == confidence(evidence())
    assert confidence(evidence(saturated=0.7)) <= confidence(evidence())
    assert confidence(evidence(network=-10.0)) < confidence(evidence())
    assert confidence(evidence(drawn=0.1, likeness=0.8)) < confidence(evidence())
    assert confidence(evidence(margin=0.0)) < confidence(evidence())


def test_the_earth_in_the_whole_frame_is_no_black_level() -> None:
    rng = np.random.default_rng(4)
    land = cv2.GaussianBlur(rng.normal(0, 1, (75, 120)).astype(np.float32), (0, 0), 6.0)
    land = 90.0 + 25.0 * land / land.std()
    fine = rng.normal(0, SIGMA / 4, land.shape).astype(np.float32)
    assert not has_flat_floor(land + fine, SIGMA / 4)
    land[50:] = PEDESTAL
    assert has_flat_floor(land + fine, SIGMA / 4)
