"""Prediction error of the filter: error of the target's predicted attitude against the horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.navigation.relative_estimate import A
from flyaround.simulator.world.frames.rotation import rotvec_between

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.hil.navigation.relative_estimate import MotionModel, RelativeEstimate
    from flyaround.simulator.world.attitude.rigid_body import AttitudeTrack


@dataclass(frozen=True, kw_only=True)
class ForecastError:
    """Error of the attitude predicted ``horizon_s`` ahead, over ``count`` predictions.

    Parameters
    ----------
    horizon_s : float
        Time from the last measurement to the predicted one.
    median_deg : float
        Median angle between predicted and true attitude.
    p95_deg : float
        95th percentile of the angle.
    rms_deg : float
        RMS of the angle.
    sigma_deg : float
        RMS angle predicted by the filter, one sigma about all three axes.
    count : int
        Number of predictions.
    """

    horizon_s: float
    median_deg: float
    p95_deg: float
    rms_deg: float
    sigma_deg: float
    count: int


def forecast_errors(
    estimates: Iterable[RelativeEstimate],
    truth: AttitudeTrack,
    motion: MotionModel,
    horizons_s: Sequence[float],
    end_s: float,
) -> list[ForecastError]:
    """Return the attitude errors at each estimate's time (horizon 0), and of predictions from there.

    Parameters
    ----------
    estimates : iterable of RelativeEstimate
        Estimates of one or more runs.
    truth : AttitudeTrack
        True attitude of the target.
    motion : MotionModel
        Motion model for the prediction.
    horizons_s : sequence of float
        Prediction horizons, increasing.
    end_s : float
        End of the truth; later predictions are omitted.

    Returns
    -------
    list of ForecastError
        Errors [deg] with their times and horizons [s].
    """
    samples: dict[float, list[tuple[float, float]]] = {horizon: [] for horizon in horizons_s}
    for estimate in estimates:
        predicted = estimate
        for horizon in horizons_s:
            at_s = estimate.t_s + horizon
            if at_s > end_s:
                break
            predicted = motion.propagated(predicted, at_s)
            error = rotvec_between(predicted.q_eci_from_target_wxyz, truth(at_s)[0])
            samples[horizon].append((float(error @ error), float(np.trace(predicted.covariance[A, A]))))
    results = []
    for horizon, pairs in samples.items():
        if not pairs:
            continue
        squares, variances = np.array(pairs).T
        angles = np.degrees(np.sqrt(squares))
        results.append(
            ForecastError(
                horizon_s=horizon,
                median_deg=float(np.median(angles)),
                p95_deg=float(np.percentile(angles, 95)),
                rms_deg=float(np.degrees(np.sqrt(np.mean(squares)))),
                sigma_deg=float(np.degrees(np.sqrt(np.mean(variances)))),
                count=len(pairs),
            )
        )
    return results
