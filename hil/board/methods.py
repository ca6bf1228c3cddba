"""Every estimator of a board by the name that ``--method`` takes: the built-in ones, and a network's file."""

from __future__ import annotations

from typing import Optional, Sequence

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.net.network_estimator import NetworkEstimator
from flyaround.hil.board.net.network_file import NetworkFile
from flyaround.hil.board.svd import METHODS, BoardModel, CameraIntrinsics, Estimator, make_estimator

NETWORK = "net:"

ALL_METHODS = (*METHODS, f"{NETWORK}FILE")
"""What there is, as a help page has it."""


def check_method_name(method: str) -> None:
    """Refuse a name that no estimator has; of a network, a file that is none.

    Raises
    ------
    BoardModelError
        With the methods there are.
    """
    if method.startswith(NETWORK):
        NetworkFile.read(method[len(NETWORK) :])
    elif method not in METHODS:
        raise BoardModelError(f"unknown method {method!r}: choose one of {', '.join(ALL_METHODS)}")


def estimator_by_name(
    model: BoardModel,
    camera: CameraIntrinsics,
    method: str = "svd",
    solver: Optional[str] = None,
    streams: Optional[Sequence[str]] = None,
    steps: Sequence[str] = (),
) -> Estimator:
    """An estimator of one of ``METHODS``, or of a network's file.

    Parameters
    ----------
    solver, streams, steps : of the published methods, as of ``make_estimator``.

    Raises
    ------
    BoardModelError
        If there is no such method, or it has no such choice.
    """
    if not method.startswith(NETWORK):
        check_method_name(method)
        return make_estimator(model, camera, method, solver, streams, steps)
    if solver is not None or streams is not None or steps:
        raise BoardModelError(f"method {method!r} has no choice of solver or streams: leave it out")
    return NetworkEstimator(NetworkFile.read(method[len(NETWORK) :]), model, camera)
