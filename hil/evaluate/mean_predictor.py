"""Mean predictor, a baseline that answers every frame with the mean of the truths."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.evaluate.pose_errors import frame_errors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


class MeanPredictor(msgspec.Struct, frozen=True, kw_only=True):
    """Errors of the mean pose as the answer to every frame, a baseline for estimators.

    Parameters
    ----------
    n : int
        Number of frames.
    t_m : tuple of float
        Mean position [m].
    q_wxyz : tuple of float
        Mean attitude (Markley et al. 2007).
    mean_E_T_m : float
        Mean position error.
    median_E_T_m : float
        Median position error.
    mean_E_R_deg : float
        Mean attitude error.
    median_E_R_deg : float
        Median attitude error.
    """

    n: int
    t_m: tuple[float, float, float]
    q_wxyz: tuple[float, float, float, float]
    mean_E_T_m: float
    median_E_T_m: float
    mean_E_R_deg: float
    median_E_R_deg: float


def mean_predictor(q_wxyz: ArrayLike, t_m: ArrayLike) -> MeanPredictor:
    """Compute the mean pose of the truths (N, 4), (N, 3) and its errors on them.

    It is fitted to its own test data, so it is the best constant predictor.

    Returns
    -------
    MeanPredictor
        Mean pose, its quaternion with a scalar part that is not negative, with its errors [m, deg].

    References
    ----------
    Markley et al. (2007), Averaging quaternions, J. Guidance 30(4), 1193.
    """
    q, t = np.asarray(q_wxyz, float).reshape(-1, 4), np.asarray(t_m, float).reshape(-1, 3)
    # minimises the mean squared sine of half the angles to all attitudes
    mean_q = np.linalg.eigh(q.T @ q)[1][:, -1]
    mean_q = -mean_q if mean_q[0] < 0 else mean_q
    mean_position = t.mean(axis=0)
    errors = np.array([frame_errors(a, b, mean_q, mean_position) for a, b in zip(q, t, strict=True)])
    return MeanPredictor(
        n=len(q),
        t_m=(float(mean_position[0]), float(mean_position[1]), float(mean_position[2])),
        q_wxyz=(float(mean_q[0]), float(mean_q[1]), float(mean_q[2]), float(mean_q[3])),
        mean_E_T_m=float(errors[:, 0].mean()),
        median_E_T_m=float(np.median(errors[:, 0])),
        mean_E_R_deg=float(errors[:, 2].mean()),
        median_E_R_deg=float(np.median(errors[:, 2])),
    )
