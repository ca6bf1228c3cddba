"""The evidence says whether an image has a black level, as images of a laboratory have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from lamp_lit import lamp_lit

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.decide.confidence import Evidence
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.prepare import prepare
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable

CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
SUN = np.array([0.3, -0.2, -0.93])
Q = quat.normalise(np.array([0.2, 0.3, 0.8, -0.4]))

pytestmark = pytest.mark.usefixtures("one_thread")


@dataclass(frozen=True)
class Picture:
    """A picture of a craft: noise and pedestal [DN], what a file or a filter then does to it, and its light."""

    lamps: bool
    target: str = "tango"
    sigma: float = 3.0
    pedestal: float = 0.0
    change: Callable[[np.ndarray], np.ndarray] = np.copy


def by_jpeg(image: np.ndarray) -> np.ndarray:
    coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 70])[1]
    return np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))


def smoothed(image: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(image, (0, 0), 0.8)


PICTURES = {
    "black sky": Picture(lamps=False),
    "JPEG of quality 70": Picture(lamps=True, sigma=6.0, change=by_jpeg),
    "smoothed noise without an offset": Picture(lamps=True, change=smoothed),
    "pedestal of 9 at a noise of 5": Picture(lamps=True, sigma=5.0, pedestal=9.0),
    "pedestal of 30": Picture(lamps=True, pedestal=30.0),
    "smoothed noise on a pedestal of 30": Picture(lamps=True, pedestal=30.0, change=smoothed),
    "another craft, pedestal of 30": Picture(lamps=True, target="soyuz-ms", pedestal=30.0),
}


@pytest.fixture(scope="module")
def estimators() -> dict[str, PoseEstimator]:
    return {name: PoseEstimator(board_model(load_target(name)), CAMERA) for name in ("tango", "soyuz-ms")}


def image_of(picture: Picture, estimator: PoseEstimator) -> np.ndarray:
    craft = estimator.target
    t = np.array([0.05, -0.05, 5.0 * craft.radius_m])
    return picture.change(
        lamp_lit(craft, CAMERA, Q, t, SUN, sigma=picture.sigma, pedestal=picture.pedestal).image
    )


@pytest.mark.parametrize("name", PICTURES)
def test_the_evidence_is_of_the_light_of_the_image(estimators: dict[str, PoseEstimator], name: str) -> None:
    picture = PICTURES[name]
    estimator = estimators[picture.target]
    image = image_of(picture, estimator)
    assert (prepare(estimator.setup, Observation(image)).frame.black > 0) is picture.lamps
    evidence = estimator.estimate(image).evidence
    assert isinstance(evidence, Evidence)
    assert evidence.lamps is picture.lamps
