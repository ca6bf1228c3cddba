"""The filter as a prophet: error of the foretold attitude of the target over how far ahead it looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hil.navigation.measurement import rotvec_between

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from hil.navigation.relative_estimate import MotionModel, RelativeEstimate
    from simulator.world.attitude.rigid_body import AttitudeTrack


@dataclass(frozen=True, kw_only=True)
class ForecastError:
    """Error of the attitude foretold ``horizon_s`` ahead: median and 95th percentile [deg], of so many forecasts."""

    horizon_s: float
    median_deg: float
    p95_deg: float
    count: int


def forecast_errors(
    estimates: Iterable[RelativeEstimate],
    truth: AttitudeTrack,
    motion: MotionModel,
    horizons_s: Sequence[float],
    end_s: float,
) -> list[ForecastError]:
    """Errors of the estimated attitude at each estimate's time (horizon 0) and foretold from there.

    Parameters
    ----------
    estimates : of a run or of several. truth : the target's attitude. motion : foretells.
    horizons_s : rising. end_s : of the truth; forecasts past it are left out.
    """
    found: dict[float, list[float]] = {horizon: [] for horizon in horizons_s}
    for estimate in estimates:
        q, w, at = estimate.q_eci_from_target_wxyz, estimate.omega_target_rad_s, 0.0
        for horizon in horizons_s:
            if estimate.t_s + horizon > end_s:
                break
            q, w = motion.turned(q, w, horizon - at)
            at = horizon
            true_q, _ = truth(estimate.t_s + horizon)
            found[horizon].append(float(np.degrees(np.linalg.norm(rotvec_between(q, true_q)))))
    return [
        ForecastError(
            horizon_s=horizon,
            median_deg=float(np.median(errors)),
            p95_deg=float(np.percentile(errors, 95)),
            count=len(errors),
        )
        for horizon, errors in found.items()
        if errors
    ]
