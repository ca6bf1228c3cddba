"""Plots of the demo page: trajectory, pose errors, latency. Dark, one style."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from hil.host.ledger.frames_csv import LedgerRow
    from simulator.scenario.plan import Plan

INK, GRID, PAPER = "#d7dde5", "#2b3440", "#12171e"
BLUE, ORANGE, GREEN, RED = "#56b4e9", "#e69f00", "#009e73", "#d55e00"
STYLE: dict[Any, Any] = {  # rcParams, whose keys matplotlib types one by one
    "figure.facecolor": PAPER,
    "axes.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": GRID,
    "axes.grid": True,
    "grid.color": GRID,
    "xtick.color": INK,
    "ytick.color": INK,
    "font.size": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


def plot_trajectory(plan: Plan, path: Path) -> None:
    """The chaser about the target in LVLH, seen along cross-track and from above, and the range."""
    times = np.linspace(0, plan.scenario.duration_s, 181)
    states = [plan.flight.state(float(t)) for t in times]
    p = np.array([s.position_lvlh_m for s in states])
    taken = np.array([plan.flight.state(t).position_lvlh_m for t in plan.times_s])
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 3, figsize=(13, 4.2), layout="constrained")
        views = (
            (1, 0, "along-track [m]", "radial, outward [m]"),
            (1, 2, "along-track [m]", "cross-track [m]"),
        )
        for ax, (i, j, x, y) in zip(axes, views, strict=False):
            ax.plot(p[:, i], p[:, j], color=BLUE, lw=2)
            ax.plot(taken[:, i], taken[:, j], ".", color=ORANGE, ms=8, label="image taken")
            ax.plot(0, 0, "s", color=INK, ms=8, label="target")
            ax.plot(p[0, i], p[0, j], "o", mfc="none", mec=INK, ms=9, label="start")
            ax.set(xlabel=x, ylabel=y, aspect="equal")
            ax.margins(0.15)
        axes[0].legend(loc="best", fontsize=9)
        axes[2].plot(times, [s.range_m for s in states], color=BLUE, lw=2)
        axes[2].set(xlabel="time [s]", ylabel="range [m]")
        axes[2].set_ylim(bottom=0)
        figure.savefig(path, dpi=110)
        plt.close(figure)


def plot_errors(rows: Sequence[LedgerRow], path: Path) -> None:
    """Rotation and translation error of every answered frame, accepted and declined apart."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(1, 2, figsize=(13, 3.8), layout="constrained")
        for ax, field, label, limit in (
            (axes[0], "E_R_deg", "rotation error [deg]", 5.0),
            (axes[1], "E_T_m", "translation error [m]", None),
        ):
            for outcome, colour, marker in (("accepted", GREEN, "o"), ("declined", RED, "x")):
                points = [
                    (r.t_s, getattr(r, field))
                    for r in rows
                    if r.outcome == outcome and getattr(r, field) is not None
                ]
                if points:
                    t, e = np.array(points).T
                    ax.semilogy(
                        t, np.maximum(e, 1e-4), marker, color=colour, label=f"{outcome} ({len(points)})"
                    )
            if limit is not None:
                ax.axhline(limit, color=ORANGE, lw=1, ls="--", label="coarse success: 5 deg")
            ax.set(xlabel="simulated time [s]", ylabel=label)
            ax.legend(fontsize=9)
        figure.savefig(path, dpi=110)
        plt.close(figure)


def plot_latency(rows: Sequence[LedgerRow], path: Path) -> None:
    """Where each frame's time went, and how end-to-end latency is distributed."""
    answered = [r for r in rows if r.e2e_ms is not None]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(
            1, 2, figsize=(13, 3.8), layout="constrained", gridspec_kw={"width_ratios": (2, 1)}
        )
        bottom = np.zeros(len(answered))
        names = list(dict.fromkeys(name for r in answered for name in r.stages_ms))
        ids = [r.frame_id for r in answered]
        colours = plt.get_cmap("viridis")(np.linspace(0.15, 0.95, max(len(names), 1)))
        for name, colour in zip(names, colours, strict=False):
            height = np.array([r.stages_ms.get(name, 0.0) for r in answered])
            axes[0].bar(ids, height, bottom=bottom, color=colour, width=0.8, label=name)
            bottom += height
        e2e = np.array([r.e2e_ms for r in answered], float)
        axes[0].bar(
            ids, np.maximum(e2e - bottom, 0), bottom=bottom, color=GRID, width=0.8, label="link and waiting"
        )
        axes[0].set(xlabel="frame", ylabel="end-to-end [ms]")
        axes[0].legend(fontsize=8, ncol=2, loc="upper right")
        if len(e2e):
            ordered = np.sort(e2e)
            axes[1].step(
                ordered, np.arange(1, len(ordered) + 1) / len(ordered), color=BLUE, lw=2, where="post"
            )
            for q, colour in ((50, GREEN), (99, ORANGE)):
                value = float(np.percentile(e2e, q))
                axes[1].axvline(value, color=colour, ls="--", lw=1, label=f"p{q}: {value:.0f} ms")
            axes[1].legend(fontsize=9, loc="lower right")
        axes[1].set(xlabel="end-to-end [ms]", ylabel="share of frames")
        figure.savefig(path, dpi=110)
        plt.close(figure)
