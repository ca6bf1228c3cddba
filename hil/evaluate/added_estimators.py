"""Estimators from plug-in packages, selected by name like the built-in ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics, Estimator, PoseResult
from flyaround.hil.board.methods import check_method_name, make_estimator
from flyaround.simulator.runtime.plugins import Plugin, plugins

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.board.estimation.record import StageRecord
    from flyaround.hil.evaluate.method_choice import MethodChoice


class AddedEstimator(Estimator):
    """Wrapper of a plug-in's estimator that rejects unusable images and never raises.

    Parameters
    ----------
    name : str
        Name of the method.
    inner : object
        Estimator with ``estimate(image)`` of an (H, W) image, which returns a
        `flyaround.hil.board.answering.Estimate`.
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.
    """

    def __init__(self, name: str, inner: Any, model: BoardModel, camera: CameraIntrinsics) -> None:  # noqa: ANN401 - the plug-in's
        super().__init__(model, camera)
        self.method, self._inner = name, inner

    def _estimate(self, frame: StageRecord) -> PoseResult:
        result = self._inner.estimate(frame.image)
        frame.mark(self.method)
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        accepted, reason = bool(result.accepted), str(result.reason)
        problem = _pose_problem(q, t, float(result.confidence))
        if problem and (accepted or q is not None or t is not None):
            q, t, accepted, reason = None, None, False, f"method {self.method} returned {problem}"
        return PoseResult(
            accepted,
            reason,
            None if q is None else np.asarray(q, float),
            None if t is None else np.asarray(t, float),
            0.0 if problem else float(result.confidence),
            frame.stages_ms,
            covariance=getattr(result, "covariance", None),
            method=self.method,
        )


def _pose_problem(q_wxyz: object, t_m: object, confidence: float) -> str:
    """Describe what is wrong with a pose, in words that follow "returned"; empty if it is one."""
    try:
        q, t = np.asarray(q_wxyz, float), np.asarray(t_m, float)
    except (TypeError, ValueError):
        return "a pose that is not made of numbers"
    if q.shape != (4,) or t.shape != (3,):
        return "no pose of four and three numbers"
    # the negated tests also refuse NaN
    if not (abs(float(np.linalg.norm(q)) - 1) < 1e-3 and np.isfinite(t).all()):
        return "a pose that is not finite, or not a unit quaternion"
    return "" if 0 <= confidence <= 1 else f"a confidence of {confidence:g}, allowed: 0 to 1"


def check_any_method(method: str) -> None:
    """Raise unless ``method`` names a built-in estimator or one of a plug-in package.

    Raises
    ------
    BoardModelError
        If it names neither; the message lists the methods.
    UserError
        If the package cannot be imported.
    """
    if method in plugins("estimator"):
        _function(plugins("estimator")[method])
    else:
        check_method_name(method)


def any_estimator(model: BoardModel, camera: CameraIntrinsics, choice: MethodChoice) -> Estimator:
    """Return the estimator of a choice, built-in or from a plug-in package.

    Returns
    -------
    Estimator
        A new estimator; one of a plug-in package is wrapped in an `AddedEstimator`.

    Raises
    ------
    BoardModelError
        If no method has this name, or its options do not fit.
    UserError
        If the package cannot be imported, or cannot make an estimator.
    """
    plugin = plugins("estimator").get(choice.method)
    if plugin is None:
        return make_estimator(model, camera, choice.method, choice.solver, choice.streams)
    make = _function(plugin)
    try:
        inner = make(model, camera)
    except Exception as error:
        raise plugin.wrong(f"cannot be made ({type(error).__name__}: {error})") from error
    if not callable(getattr(inner, "estimate", None)):
        raise plugin.wrong("has no method estimate")
    return AddedEstimator(choice.method, inner, model, camera)


def _function(plugin: Plugin) -> Callable[[BoardModel, CameraIntrinsics], Any]:
    make: Callable[[BoardModel, CameraIntrinsics], Any] = plugin.load()
    if not callable(make):
        raise plugin.wrong("cannot be called")
    return make
