"""The methods by name, one way to make any of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Optional, Sequence

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.svd.base import Estimator
from flyaround.hil.board.svd.estimator import PoseEstimator
from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
from flyaround.hil.board.svd.model.target_model import BoardModel
from flyaround.hil.board.svd.published.published_estimator import PublishedEstimator
from flyaround.hil.board.svd.published.settings import SOLVERS, STEPS, STREAMS, SVD_2018, SVD_THESIS
from flyaround.hil.board.svd.tracking.tracking_estimator import TrackingEstimator

# Methods that compute with the compiled library.
WITH_LIBRARY = ("svd", "svd-track")

METHODS = ("svd", "svd-2018", "svd-thesis", "svd-track")

PUBLISHED = {"svd-2018": SVD_2018, "svd-thesis": SVD_THESIS}


def make_estimator(
    model: BoardModel,
    camera: CameraIntrinsics,
    method: str = "svd",
    solver: Optional[str] = None,
    streams: Optional[Sequence[str]] = None,
    steps: Sequence[str] = (),
) -> Estimator:
    """An estimator of one of ``METHODS``.

    Parameters
    ----------
    solver : pose solver of the published methods, one of ``SOLVERS``; None: the method's own.
    streams : feature streams of the published methods, of ``STREAMS``; None: the method's own.
    steps : of ``STEPS``, from a published method towards ``svd``.

    Raises
    ------
    BoardModelError
        If a name is not known, or the method has no such choice.
    """
    if method not in METHODS:
        raise BoardModelError(f"unknown method {method!r}: choose one of {', '.join(METHODS)}")
    config = PUBLISHED.get(method)
    if config is None:
        if solver is not None or streams is not None or steps:
            raise BoardModelError(
                f"method {method!r} has no choice of solver or streams: leave it out, or take {', '.join(PUBLISHED)}"
            )
        return TrackingEstimator(model, camera) if method == "svd-track" else PoseEstimator(model, camera)
    if solver is not None:
        if solver not in SOLVERS:
            raise BoardModelError(f"unknown solver {solver!r}: choose one of {', '.join(SOLVERS)}")
        config = replace(config, solver=solver)
    if streams is not None:
        unknown = [s for s in streams if s not in STREAMS]
        if unknown or not streams:
            raise BoardModelError(
                f"unknown stream {(unknown or [''])[0]!r}: choose from {', '.join(STREAMS)}"
            )
        config = replace(config, streams=tuple(streams))
    for step in steps:
        if step not in STEPS:
            raise BoardModelError(f"unknown step {step!r}: choose from {', '.join(STEPS)}")
        config = replace(config, **STEPS[step])
    return PublishedEstimator(model, camera, config)
