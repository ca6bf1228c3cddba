"""Attitude prediction of the navigation filter in closed loops without images, for ``hil forecast``."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.host.closed_loop_run import fly_without_pictures
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
from flyaround.hil.navigation.prediction_error import ForecastError, forecast_errors
from flyaround.hil.navigation.relative_estimate import MotionModel
from flyaround.simulator.errors import UserError
from flyaround.simulator.reports.plots import BLUE, VERMILION, figure_with_axes, png
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.table_text import table_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from flyaround.hil.navigation.relative_estimate import RelativeEstimate
    from flyaround.simulator.scenario.plan import Plan

FORECAST_CSV, FORECAST_PNG = "forecast.csv", "forecast.png"
# Number of steps of the horizon, from zero to the longest.
STEPS = 12

# Age of the track at the first prediction [s], by which the filter has converged, and interval between predictions [s].
SETTLED_S, INTERVAL_S = 60.0, 10.0


@dataclass(frozen=True, kw_only=True)
class Forecasts:
    """Prediction errors against the horizon for two models of the target: free rigid body, and constant rate."""

    rigid_body: list[ForecastError]
    constant_rate: list[ForecastError]


def fly_forecasts(
    plan: Plan,
    *,
    runs: int,
    horizon_s: float,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Forecasts:
    """Fly a plan's closed loop on noisy poses several times, and predict the attitude from each track.

    Parameters
    ----------
    plan : Plan
        Scenario with its flight and target.
    runs : int
        Number of flights, with consecutive seeds from the plan's.
    horizon_s : float
        Longest prediction [s].
    progress : callable, optional
        Called with the number of finished flights and their total.

    Returns
    -------
    Forecasts
        Errors of predictions by rigid-body dynamics, and by a constant rate.

    Raises
    ------
    UserError
        If the flight has no path or thrusters or is too short, or if no run has a track.
    """
    if plan.flight.duration_s < SETTLED_S + horizon_s:
        raise UserError(
            f"scenario {plan.scenario_name} lasts {plan.flight.duration_s:g} s, too short for forecasts of "
            f"{horizon_s:g} s after {SETTLED_S:g} s of poses: choose a smaller --horizon"
        )
    estimates: list[RelativeEstimate] = []
    for k in range(runs):
        result = fly_without_pictures(plan, ClosedLoopConfig(seed=plan.seed + k), "noisy")
        next_s = SETTLED_S
        for step in result.steps:
            if step.estimate is not None and step.t_s >= next_s:
                estimates.append(step.estimate)
                next_s += INTERVAL_S
        progress(k + 1, runs)
    if not estimates:
        raise UserError(
            f"no flight of {plan.scenario_name} had a track for {SETTLED_S:g} s: nothing to predict"
        )
    inertia = np.asarray(plan.target.mass.inertia_kg_m2, float)
    horizons = np.linspace(0.0, horizon_s, STEPS + 1).tolist()
    rigid, constant = (
        forecast_errors(
            estimates,
            plan.flight.attitude,
            MotionModel(n_rad_s=plan.flight.n_rad_s, inertia_kg_m2=model_inertia),
            horizons,
            plan.flight.duration_s,
        )
        for model_inertia in (inertia, None)
    )
    return Forecasts(rigid_body=rigid, constant_rate=constant)


def write_forecasts(folder: Path, results: Forecasts, title: str) -> None:
    """Write ``forecast.csv`` and ``forecast.png`` into an existing folder.

    Raises
    ------
    UserError
        If the files cannot be written.
    """
    head = ["model", *(field.name for field in fields(ForecastError))]
    rows = (
        [model, *(f"{value:.6g}" for value in astuple(error))]
        for model in ("rigid_body", "constant_rate")
        for error in getattr(results, model)
    )
    write_atomic(folder / FORECAST_CSV, table_bytes(head, rows=rows))
    write_atomic(folder / FORECAST_PNG, png(forecast_figure([(title, results)])))


def forecast_figure(panels: Sequence[tuple[str, Forecasts]]) -> Figure:
    """Plot the attitude error against the horizon: RMS, 95th percentile, and the one sigma predicted by the filter.

    Parameters
    ----------
    panels : sequence of tuple
        Title and prediction errors of each panel.
    """
    figure, axes = figure_with_axes(1, len(panels), 3.6, width=6.2 * len(panels))
    errors = [e for _, forecasts in panels for e in (*forecasts.rigid_body, *forecasts.constant_rate)]
    # common to all panels, and wide enough for a labelled decade
    limits = min(e.rms_deg for e in errors) / 3, max(e.p95_deg for e in errors) * 3
    for ax, (title, forecasts) in zip(axes, panels, strict=True):
        for name, errors, colour in (
            ("constant rate", forecasts.constant_rate, VERMILION),
            ("rigid body", forecasts.rigid_body, BLUE),
        ):
            horizons_s = [e.horizon_s for e in errors]
            ax.plot(horizons_s, [e.rms_deg for e in errors], "o-", ms=3, color=colour, label=f"{name}, RMS")
            ax.plot(horizons_s, [e.p95_deg for e in errors], ":", color=colour, lw=1, label="95th percentile")
        ax.plot(
            horizons_s, [e.sigma_deg for e in errors], "--", color="black", lw=1, label="predicted one sigma"
        )
        ax.set(
            yscale="log",
            xlabel="prediction horizon [s]",
            ylabel="attitude error [deg]",
            ylim=limits,
            title=title,
        )
        ax.legend(frameon=False, fontsize=8)
    return figure
