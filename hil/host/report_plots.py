"""Plots of a ledger: latency, jitter, outcomes, stages, pose errors."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from flyaround.hil.host.frame_record import ACCEPTED, DECLINED, DROPPED
from flyaround.simulator.reports.plots import DIM, INK, figure_with_axes, png

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from matplotlib.axes import Axes

    from flyaround.hil.host.frame_record import FrameRecord

HEIGHT_INCHES = 3.6  # inches
BLUE, GREEN, RED, ORANGE = "#2f6fb0", "#2f9e62", "#c8453b", "#e08a1e"
STAGES = (
    "#274c77",
    "#3f78a8",
    "#5fa8d3",
    "#8fcbe8",
    "#8ab17d",
    "#b5c99a",
    "#e9c46a",
    "#f4a261",
    "#e76f51",
    "#9d4edd",
)


WRONG = "accepted, wrong"

# Kinds of answers in the order of legends, with their markers.
MARKERS = {ACCEPTED: "o", WRONG: "X", DECLINED: "x"}


def outcome_colour(outcome: str) -> str:
    """Return green for accepted, orange for declined, red for accepted but wrong or dropped."""
    return {ACCEPTED: GREEN, DECLINED: ORANGE}.get(outcome, RED)


def kind_of(row: FrameRecord) -> str:
    """Return the row's outcome; an accepted pose that the truth contradicts is a separate kind."""
    return WRONG if row.outcome == ACCEPTED and row.wrong else row.outcome


def _title(ax: Axes, text: str) -> None:
    ax.set_title(text, loc="left", fontsize=11, color=INK, fontweight="bold")


def plot_latency(rows: Sequence[FrameRecord], deadline_ms: float | None) -> Figure | None:
    """Plot histogram and cumulative distribution of the end-to-end latency."""
    e2e = np.sort([row.e2e_ms for row in rows if row.e2e_ms is not None])
    if not len(e2e):
        return None
    figure, (left, right) = figure_with_axes(1, 2, HEIGHT_INCHES)
    # bins over the bulk; the title states the outliers
    top = float(np.percentile(e2e, 99.5)) if len(e2e) > 40 else float(e2e[-1])
    n_above = int(np.sum(e2e > top))
    left.hist(e2e[e2e <= top], bins=min(40, max(8, len(e2e) // 4)), color=BLUE, edgecolor="white", lw=0.4)
    left.set(xlabel="end-to-end [ms]", ylabel="frames")
    left.yaxis.set_major_locator(MaxNLocator(integer=True))
    _title(left, "Latency" + (f" ({n_above} beyond, up to {e2e[-1]:.3g} ms)" if n_above else ""))
    right.step(e2e, np.arange(1, len(e2e) + 1) / len(e2e), where="post", color=BLUE, lw=2)
    right.set(xlabel="end-to-end [ms]", ylabel="share of answered frames", ylim=(0, 1.02))
    if e2e[-1] > 20 * e2e[0]:  # a linear axis would squeeze the median into the first twentieth
        right.set_xscale("log")
    for q, colour in ((50, GREEN), (95, ORANGE), (99, RED)):
        value = float(np.percentile(e2e, q))
        right.axvline(value, color=colour, ls="--", lw=1.2, label=f"p{q}  {value:.4g} ms")
    if deadline_ms is not None:
        right.axvline(deadline_ms, color=INK, lw=1.2, label=f"deadline  {deadline_ms:.3g} ms")
    right.legend(fontsize=9, loc="lower right", frameon=False)
    _title(right, "Cumulative")
    return figure


def plot_timeline(rows: Sequence[FrameRecord], deadline_ms: float | None) -> Figure | None:
    """Plot the latency frame by frame, with drops marked."""
    answered = [row for row in rows if row.e2e_ms is not None]
    dropped = [row for row in rows if row.e2e_ms is None]
    if not answered and not all(row.outcome.startswith(DROPPED) for row in rows):
        # no times were recorded
        return None
    if not rows:
        return None
    figure, (ax,) = figure_with_axes(1, 1, 3.2)
    for kind in MARKERS:
        of_kind = [row for row in answered if kind_of(row) == kind]
        if of_kind:
            ax.plot(
                [row.frame_id for row in of_kind],
                [row.e2e_ms or 0.0 for row in of_kind],
                "o",
                ms=3.5,
                color=outcome_colour(kind),
                label=kind,
            )
    for k, row in enumerate(dropped):
        ax.axvline(row.frame_id, color=RED, lw=1, alpha=0.5, label="dropped" if k == 0 else None)
    if deadline_ms is not None:
        ax.axhline(deadline_ms, color=INK, lw=1.2, ls="--", label=f"deadline {deadline_ms:.3g} ms")
    ax.set(xlabel="frame", ylabel="end-to-end [ms]")
    ax.set_ylim(bottom=0)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.legend(fontsize=9, frameon=False, ncols=4, loc="lower right", bbox_to_anchor=(1, 1), borderaxespad=0.1)
    _title(ax, "Timeline")
    return figure


def plot_jitter(rows: Sequence[FrameRecord], _deadline_ms: float | None) -> Figure | None:
    """Plot the change of latency from frame to frame, and the delay of sending."""
    e2e = np.array([row.e2e_ms for row in rows if row.e2e_ms is not None])
    lag = np.array([row.send_lag_ms for row in rows if row.send_lag_ms is not None])
    if len(e2e) < 2:
        return None
    figure, axes = figure_with_axes(1, 2 if len(lag) else 1, 3.2)
    change = np.diff(e2e)
    span = max(float(np.percentile(np.abs(change), 99)), 1e-3)
    axes[0].hist(change.clip(-span, span), bins=41, color=BLUE, edgecolor="white", lw=0.4)
    axes[0].set(xlabel="change of latency from one answer to the next [ms]", ylabel="answers")
    axes[0].yaxis.set_major_locator(MaxNLocator(integer=True))
    _title(axes[0], f"Jitter: rms {np.sqrt(np.mean(change**2)):.3g} ms")
    if len(lag):
        axes[1].plot(np.sort(lag), np.arange(1, len(lag) + 1) / len(lag), color=BLUE, lw=2)
        axes[1].set(xlabel="delay of sending [ms]", ylabel="share of sent frames", ylim=(0, 1.02))
        axes[1].set_xscale("symlog", linthresh=0.01)
        axes[1].set_xlim(left=0)
        _title(axes[1], f"Pacing: p50 {np.percentile(lag, 50):.3g}, p99 {np.percentile(lag, 99):.3g} ms")
    return figure


def plot_outcomes(rows: Sequence[FrameRecord], _deadline_ms: float | None) -> Figure | None:
    """Plot the number of frames by outcome and cause."""
    if not rows:
        return None
    counts = Counter(kind_of(row) for row in rows)
    names = sorted(counts, key=lambda name: (name not in MARKERS, name))
    figure, (ax,) = figure_with_axes(1, 1, 0.9 + 0.42 * len(names))
    values = [counts[name] for name in names]
    ax.barh(names, values, color=[outcome_colour(name) for name in names], height=0.62)
    for k, value in enumerate(values):
        ax.text(value, k, f"  {value}  ({value / len(rows):.1%})", va="center", fontsize=9, color=INK)
    ax.invert_yaxis()
    ax.set_xlim(0, 1.15 * max(values))
    ax.set_xlabel("frames")
    ax.grid(visible=False, axis="y")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    _title(ax, "Outcomes")
    return figure


def plot_stages(rows: Sequence[FrameRecord], _deadline_ms: float | None) -> Figure | None:
    """Plot the stages of an answered frame: uplink, waiting, each board stage, downlink."""
    answered = [row for row in rows if row.e2e_ms is not None]
    names = list(dict.fromkeys(name for row in answered for name in row.stages_ms))
    parts: list[tuple[str, list[float]]] = [
        ("link out", [max(0.0, row.uplink_ms) for row in answered if row.uplink_ms is not None]),
        ("board waits", [row.board_wait_ms for row in answered if row.board_wait_ms is not None]),
        *((name, [row.stages_ms.get(name, 0.0) for row in answered]) for name in names),
        ("link back", [max(0.0, row.downlink_ms) for row in answered if row.downlink_ms is not None]),
    ]
    parts = [(name, values) for name, values in parts if values]
    if not parts:
        return None
    figure, (ax,) = figure_with_axes(1, 1, 1.0 + 0.34 * len(parts))
    for k, (name, values) in enumerate(parts):
        p50, p99 = np.percentile(values, [50, 99])
        colour = DIM if name in ("link out", "board waits", "link back") else STAGES[k % len(STAGES)]
        ax.barh(k, p50, color=colour, height=0.62)
        ax.plot([p50, p99], [k, k], color=INK, lw=1)
        ax.plot(p99, k, "|", color=INK, ms=9)
        ax.text(p99, k, f"  {p50:.3g} / {p99:.3g}", va="center", fontsize=9, color=INK)
    ax.set_yticks(range(len(parts)), [name for name, _ in parts])
    ax.invert_yaxis()
    ax.grid(visible=False, axis="y")
    ax.set_xlim(0, 1.18 * max(float(np.percentile(values, 99)) for _, values in parts))
    ax.set_xlabel("p50 (bar) and p99 (tick) [ms]")
    _title(ax, "Time per stage")
    return figure


def plot_errors(rows: Sequence[FrameRecord], _deadline_ms: float | None) -> Figure | None:
    """Plot pose errors over simulated time, distinguishing accepted, accepted but wrong, and declined."""
    posed = [row for row in rows if row.E_T_m is not None and row.E_R_deg is not None]
    if not posed:
        return None
    figure, axes = figure_with_axes(1, 2, HEIGHT_INCHES)
    for ax, name, unit in ((axes[0], "E_T_m", "m"), (axes[1], "E_R_deg", "deg")):
        floor = 1e-4 if name == "E_T_m" else 1e-3
        for kind, marker in MARKERS.items():
            of_kind = [row for row in posed if kind_of(row) == kind]
            if of_kind:
                ax.semilogy(
                    [row.t_s for row in of_kind],
                    [max(getattr(row, name), floor) for row in of_kind],
                    marker,
                    ms=4.5,
                    color=outcome_colour(kind),
                    label=f"{kind} ({len(of_kind)})",
                )
        ax.set(xlabel="simulated time [s]", ylabel=f"{name[:3]} [{unit}]")
        accepted = [getattr(row, name) for row in posed if row.outcome == ACCEPTED]
        _title(
            ax, f"Median of accepted: {np.median(accepted):.3g} {unit}" if accepted else "No pose accepted"
        )
    # below the axes: wrong poses are at the top, where a legend would hide them
    figure.legend(
        *axes[0].get_legend_handles_labels(), fontsize=9, frameon=False, ncols=3, loc="outside lower center"
    )
    return figure


def plot_camera(rows: Sequence[FrameRecord], _deadline_ms: float | None) -> Figure | None:
    """Plot the age of frames when used, over the flight, and the error of the camera's latency."""
    stale = [(row.t_s, row.staleness_ms, kind_of(row)) for row in rows if row.staleness_ms is not None]
    errors = np.array([abs(row.handover_error_ms) for row in rows if row.handover_error_ms is not None])
    if not stale:
        return None
    figure, axes = figure_with_axes(1, 2 if len(errors) else 1, 3.2)
    for kind in MARKERS:
        of_kind = [(t_s, ms) for t_s, ms, kind_of_frame in stale if kind_of_frame == kind]
        if of_kind:
            axes[0].plot(*zip(*of_kind, strict=True), "o", ms=3.5, color=outcome_colour(kind), label=kind)
    axes[0].set(xlabel="simulated time [s]", ylabel="staleness [ms]")
    axes[0].set_ylim(0, 1.08 * max(1e-3, *(ms for _, ms, _ in stale)))
    axes[0].legend(fontsize=9, frameon=False, loc="best")
    _title(axes[0], f"Age when used: p50 {np.percentile([ms for _, ms, _ in stale], 50):.4g} ms")
    if len(errors):
        low = max(1e-4, float(errors[errors > 0].min(initial=1e-3)))
        bins = np.geomspace(low, max(float(errors.max()), 10 * low) * 1.01, 41)
        axes[1].hist(
            errors.clip(low), bins=[float(edge) for edge in bins], color=BLUE, edgecolor="white", lw=0.4
        )
        axes[1].set(xlabel="handed over - (end of exposure + latency) [ms]", ylabel="frames", xscale="log")
        axes[1].set_yscale("symlog", linthresh=1)
        p99, worst = np.percentile(errors, 99), errors.max()
        _title(axes[1], f"Error of the camera's latency: p99 {p99:.3g}, max {worst:.3g} ms")
    return figure


def plot_drops(rows: Sequence[FrameRecord], _deadline_ms: float | None) -> Figure | None:
    """Plot the times of drops by cause, and of deliberate faults."""
    causes = sorted({row.outcome for row in rows if row.outcome.startswith(DROPPED)})
    faults = sorted({name for row in rows for name in row.faults})
    if not causes and not faults:
        return None
    lines = [
        *((name, RED, [r.t_s for r in rows if r.outcome == name]) for name in causes),
        *((f"fault: {name}", ORANGE, [r.t_s for r in rows if name in r.faults]) for name in faults),
    ]
    figure, (ax,) = figure_with_axes(1, 1, 1.0 + 0.32 * len(lines))
    for k, (_, colour, times) in enumerate(lines):
        ax.plot(times, [k] * len(times), "|", ms=11, color=colour)
    ax.set_yticks(range(len(lines)), [f"{name} ({len(times)})" for name, _, times in lines])
    ax.set_ylim(len(lines) - 0.4, -0.6)
    first, last = rows[0].t_s, rows[-1].t_s
    ax.set_xlim(first - 0.02 * (last - first) - 1e-3, last + 0.02 * (last - first) + 1e-3)
    ax.grid(visible=False, axis="y")
    ax.set_xlabel("simulated time [s]")
    _title(ax, "Drops and faults over the flight")
    return figure


PLOTS: dict[str, Callable[[Sequence[FrameRecord], float | None], Figure | None]] = {
    "latency": plot_latency,
    "timeline": plot_timeline,
    "jitter": plot_jitter,
    "camera": plot_camera,
    "outcomes": plot_outcomes,
    "drops": plot_drops,
    "stages": plot_stages,
    "errors": plot_errors,
}


def draw_plots(rows: Sequence[FrameRecord], deadline_ms: float | None) -> dict[str, bytes]:
    """Return a PNG of each plot that has data, by name, in the order of the report."""
    figures = {name: plot(rows, deadline_ms) for name, plot in PLOTS.items()}
    return {name: png(figure, dpi=130) for name, figure in figures.items() if figure is not None}
