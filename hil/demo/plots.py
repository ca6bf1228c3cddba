"""Plots of the demo page: trajectory, pose errors and latency, in dark colours."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from flyaround.hil.evaluate.pose_errors import COARSE_DEG
from flyaround.simulator.reports.plots import (
    DARK_GRID,
    DARK_INK,
    GREEN,
    ORANGE,
    SKY,
    VERMILION,
    figure_with_axes,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.scenario.plan import Plan

WIDTH_INCHES = 13  # inches

# Points of the plotted path: a smooth curve at the plot's size.
PATH_POINTS = 181

# Least error on the logarithmic axis [m, deg], below that of any estimator: a perfect pose has no logarithm.
MIN_ERROR = 1e-4


def plot_trajectory(plan: Plan) -> Figure:
    """Plot the chaser's LVLH trajectory in side and top view, and the range."""
    times = np.linspace(0, plan.scenario.duration_s, PATH_POINTS)
    states = [plan.flight.state(float(t)) for t in times]
    p = np.array([s.position_lvlh_m for s in states])
    positions = np.array([plan.flight.state(t).position_lvlh_m for t in plan.times_s])
    figure, axes = figure_with_axes(1, 3, 4.2, width=WIDTH_INCHES, dark=True)
    views = (
        (1, 0, "along-track [m]", "radial, outward [m]"),
        (1, 2, "along-track [m]", "cross-track [m]"),
    )
    for ax, (i, j, x, y) in zip(axes, views, strict=False):
        ax.plot(p[:, i], p[:, j], color=SKY, lw=2)
        ax.plot(positions[:, i], positions[:, j], ".", color=ORANGE, ms=8, label="image taken")
        ax.plot(0, 0, "s", color=DARK_INK, ms=8, label="target")
        ax.plot(p[0, i], p[0, j], "o", mfc="none", mec=DARK_INK, ms=9, label="start")
        ax.set(xlabel=x, ylabel=y, aspect="equal")
        ax.margins(0.15)
    _legend(axes[0], loc="best")
    axes[2].plot(times, [s.range_m for s in states], color=SKY, lw=2)
    axes[2].set(xlabel="time [s]", ylabel="range [m]")
    axes[2].set_ylim(bottom=0)
    return figure


def plot_errors(rows: Sequence[FrameRecord]) -> Figure:
    """Plot rotation and translation error of every answered frame, distinguishing accepted and declined ones."""
    figure, axes = figure_with_axes(1, 2, 3.8, width=WIDTH_INCHES, dark=True)
    for ax, field, label, limit in (
        (axes[0], "E_R_deg", "rotation error [deg]", COARSE_DEG),
        (axes[1], "E_T_m", "translation error [m]", None),
    ):
        for outcome, colour, marker in (("accepted", GREEN, "o"), ("declined", VERMILION, "x")):
            points = [
                (r.t_s, getattr(r, field))
                for r in rows
                if r.outcome == outcome and getattr(r, field) is not None
            ]
            if points:
                t, e = np.array(points).T
                ax.semilogy(
                    t, np.maximum(e, MIN_ERROR), marker, color=colour, label=f"{outcome} ({len(points)})"
                )
        if limit is not None:
            ax.axhline(limit, color=ORANGE, lw=1, ls="--", label=f"coarse success: {limit:g} deg")
        ax.set(xlabel="simulated time [s]", ylabel=label)
        _legend(ax)
    return figure


def plot_latency(rows: Sequence[FrameRecord]) -> Figure:
    """Plot the time of each frame's stages and the distribution of the end-to-end latency."""
    answered = [r for r in rows if r.e2e_ms is not None]
    figure, axes = figure_with_axes(1, 2, 3.8, width=WIDTH_INCHES, widths=(2, 1), dark=True)
    bottom = np.zeros(len(answered))
    names = list(dict.fromkeys(name for r in answered for name in r.stages_ms))
    ids = [r.frame_id for r in answered]
    colours = mpl.colormaps["viridis"](np.linspace(0.15, 0.95, max(len(names), 1)))
    for name, colour in zip(names, colours, strict=False):
        height = np.array([r.stages_ms.get(name, 0.0) for r in answered])
        axes[0].bar(ids, height, bottom=bottom, color=colour, width=0.8, label=name)
        bottom += height
    e2e = np.array([r.e2e_ms for r in answered], float)
    axes[0].bar(
        ids, np.maximum(e2e - bottom, 0), bottom=bottom, color=DARK_GRID, width=0.8, label="link and waiting"
    )
    axes[0].set(xlabel="frame", ylabel="end-to-end [ms]")
    # below the plot, because a dozen stages would cover the bars
    _legend(axes[0], fontsize=8, ncols=5, loc="upper center", bbox_to_anchor=(0.5, -0.16))
    if len(e2e):
        ordered = np.sort(e2e)
        axes[1].step(ordered, np.arange(1, len(ordered) + 1) / len(ordered), color=SKY, lw=2, where="post")
        for q, colour in ((50, GREEN), (99, ORANGE)):
            value = float(np.percentile(e2e, q))
            axes[1].axvline(value, color=colour, ls="--", lw=1, label=f"p{q}: {value:.0f} ms")
        _legend(axes[1], loc="lower right")
    axes[1].set(xlabel="end-to-end [ms]", ylabel="share of frames")
    return figure


def _legend(ax: Axes, **options: Any) -> None:  # noqa: ANN401 - matplotlib's own
    if ax.get_legend_handles_labels()[0]:
        ax.legend(**{"fontsize": 9, "loc": "best", **options}, frameon=False, labelcolor=DARK_INK)
