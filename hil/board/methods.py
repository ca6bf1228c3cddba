"""Factory of the estimators by method name: built-in ones, and network files."""

from __future__ import annotations

from dataclasses import replace
from typing import Optional, Sequence

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics, Estimator
from flyaround.hil.board.method_names import (
    ALL_METHODS,
    HYBRID,
    HYBRID_TRACK,
    METHODS,
    NETWORK,
    refuse_former_name,
)
from flyaround.hil.board.svd.settings import SOLVERS, STREAMS, SVD_2018, SVD_THESIS, PublishedConfig

PUBLISHED = {config.name: config for config in (SVD_2018, SVD_THESIS)}


def check_method_name(method: str) -> None:
    """Raise if ``method`` names no estimator, or a network file that is not valid.

    Raises
    ------
    BoardModelError
        If so; the message lists the methods.
    """
    refuse_former_name(method)
    if method.startswith(NETWORK):
        from flyaround.hil.board.net.network_file import NetworkFile  # noqa: PLC0415 - imported only for networks

        NetworkFile.read(method[len(NETWORK) :])
    elif method not in METHODS:
        raise BoardModelError(f"unknown method {method!r}: choose one of {', '.join(ALL_METHODS)}")


def make_estimator(
    model: BoardModel,
    camera: CameraIntrinsics,
    method: str = HYBRID,
    solver: Optional[str] = None,
    streams: Optional[Sequence[str]] = None,
) -> Estimator:
    """Return the estimator called ``method``. Other methods are not imported.

    Parameters
    ----------
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.
    method : str
        One of ``METHODS``, or ``net:FILE``.
    solver : str, optional
        Pose solver of a published method, one of ``SOLVERS``; default: the method's own.
    streams : sequence of str, optional
        Feature streams of a published method, of ``STREAMS``; default: the method's own.

    Returns
    -------
    Estimator
        Estimator of one camera.

    Raises
    ------
    BoardModelError
        If the method does not exist, or has no such option.
    """
    check_method_name(method)
    if method in PUBLISHED:
        from flyaround.hil.board.svd.pipeline import PublishedEstimator  # noqa: PLC0415 - imported on demand

        return PublishedEstimator(model, camera, _with_choices(PUBLISHED[method], solver, streams))
    if solver is not None or streams is not None:
        raise BoardModelError(
            f"method {method!r} has no choice of solver or streams: leave it out, or take {', '.join(PUBLISHED)}"
        )
    if method == HYBRID:
        from flyaround.hil.board.hybrid.estimator import PoseEstimator  # noqa: PLC0415 - imported on demand

        return PoseEstimator(model, camera)
    if method == HYBRID_TRACK:
        from flyaround.hil.board.hybrid.tracking.tracking_estimator import TrackingEstimator  # noqa: PLC0415

        return TrackingEstimator(model, camera)
    from flyaround.hil.board.net.network_estimator import NetworkEstimator  # noqa: PLC0415 - imported on demand
    from flyaround.hil.board.net.network_file import NetworkFile  # noqa: PLC0415 - imported on demand

    return NetworkEstimator(NetworkFile.read(method[len(NETWORK) :]), model, camera)


def _with_choices(
    config: PublishedConfig, solver: Optional[str], streams: Optional[Sequence[str]]
) -> PublishedConfig:
    """Return the settings of a published method with another solver or other streams."""
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
    return config
