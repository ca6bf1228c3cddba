"""The light regime of an image is decided once, and the search settings are those of that light."""

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
from flyaround.hil.board.hybrid.estimator import PoseEstimator, check, choose, propose_learned, rank
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
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
    """A picture of a craft: noise and pedestal [DN], what a file or a filter then does to it, and its regime."""

    regime: Regime
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
    "black sky": Picture(Regime.SUNLIGHT),
    "JPEG of quality 70": Picture(Regime.LAMPS, sigma=6.0, change=by_jpeg),
    "smoothed noise without an offset": Picture(Regime.LAMPS, change=smoothed),
    "pedestal of 9 at a noise of 5": Picture(Regime.LAMPS, sigma=5.0, pedestal=9.0),
    "pedestal of 30": Picture(Regime.LAMPS, pedestal=30.0),
    "smoothed noise on a pedestal of 30": Picture(Regime.LAMPS, pedestal=30.0, change=smoothed),
    "another craft, pedestal of 30": Picture(Regime.LAMPS, target="soyuz-ms", pedestal=30.0),
}
# All but the first, whose camera and file add nothing.
WITH_BLACK_LEVEL = [name for name in PICTURES if name != "black sky"]


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
def test_the_evidence_is_of_the_regime_of_the_image(estimators: dict[str, PoseEstimator], name: str) -> None:
    picture = PICTURES[name]
    estimator = estimators[picture.target]
    image = image_of(picture, estimator)
    prepared = prepare(estimator.setup, Observation(image))
    assert (prepared.frame.black > 0) == (name in WITH_BLACK_LEVEL)
    assert prepared.regime is picture.regime
    evidence = estimator.estimate(image).evidence
    assert isinstance(evidence, Evidence)
    assert evidence.regime is picture.regime


@pytest.mark.parametrize("name", ["JPEG of quality 70", "another craft, pedestal of 30"])
def test_the_search_asks_the_regime_and_not_the_black_level(
    estimators: dict[str, PoseEstimator], name: str
) -> None:
    picture = PICTURES[name]
    estimator = estimators[picture.target]
    image = image_of(picture, estimator)

    def judged(black: float | None) -> tuple[int, bytes]:
        prepared = prepare(estimator.setup, Observation(image))
        proposals = rank(propose_learned(prepared))
        if black is not None:
            prepared.frame.black = black
        best = check(choose(proposals)).selection.best
        return prepared.frame.counts["judged"], np.concatenate([best.q, best.t]).tobytes()

    # everything after the proposal is the same with any black level
    assert judged(None) == judged(0.0)


def test_a_target_without_a_network_is_in_sunlight() -> None:
    assert Regime.from_black_level(30.0, trained=True) is Regime.LAMPS
    assert Regime.from_black_level(30.0, trained=False) is Regime.SUNLIGHT
    assert Regime.from_black_level(0.0, trained=True) is Regime.SUNLIGHT
