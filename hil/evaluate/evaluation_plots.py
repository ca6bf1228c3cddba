"""Plots of an evaluation: errors against range and along the camera's axes, histograms, stages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from flyaround.hil.evaluate.decision_curves import reliability, trade_off
from flyaround.simulator.reports.plots import (
    BLUE,
    DIM,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    figure_with_axes,
    png,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from flyaround.hil.evaluate.result_rows import EvaluatedFrame

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
PALETTE = (*COLOURS, "#274c77", "#8ab17d", "#9d4edd", "#7b8794", "#b56576", "#6d597a", "#355070", "#bc6c25")
# White outline that keeps a line visible among dots of its own colour.
HALO = [withStroke(linewidth=4, foreground="white")]

AXES = ("x, right", "y, down", "z, forward")

# Bins of range, and frames that a bin needs for its percentiles: with fewer, a line follows single frames.
RANGE_BINS, MIN_IN_BIN = 12, 3

# Least error on logarithmic axes [m, deg], below that of any estimator: a perfect pose has no logarithm.
MIN_ERROR = 1e-4

# Share of the longest bar below which a stage's name does not fit into its own bar.
LABELLED_SHARE = 0.06

# Mean errors printed in the Milan thesis, on its own images.
THESIS_E_T_M, THESIS_E_R_DEG = 0.2506, 0.0528

CAPTIONS = {
    "range": "Best pose of every feasible frame. Filled: accepted; hollow: declined. Lines: medians in bins of range. "
    "Frames without a pose are omitted from these figures.",
    "axes": "Estimate minus truth, accepted frames, along the camera's axes; median and central 90 % in bins of range; "
    "triangles: beyond the axis.",
    "histograms": "Feasible frames with a pose, in logarithmic bins; the dark part is accepted. Values beyond the "
    "scale are in the first or last bin.",
    "decision": "Left: every threshold of the confidence, all frames; mark: the accepted frames; a method with more "
    "than 10 % wrong poses at any threshold lies beyond the axis. Right: share of correct poses in each bin of "
    "confidence (Wilson 95 %); on the dashed line the confidence is a calibrated probability.",
    "stages": "Median time of each stage in order, one frame, this machine.",
}


def draw_plots(rows: Sequence[EvaluatedFrame], labels: Sequence[str]) -> dict[str, bytes]:
    """Return a PNG of every plot that has data, by its name, a key of ``CAPTIONS``."""
    by_method = {label: [r for r in rows if r.method == label] for label in labels}
    figures = {
        "range": _against_range(by_method),
        "axes": _along_axes(by_method),
        "histograms": _histograms(by_method),
        "decision": decision_figure(by_method),
        "stages": _stages(by_method),
    }
    return {name: png(figure) for name, figure in figures.items() if figure is not None}


def _with_pose(rows: Sequence[EvaluatedFrame]) -> list[EvaluatedFrame]:
    return [r for r in rows if r.record.feasible and r.record.E_T_m is not None]


def _against_range(by_method: dict[str, list[EvaluatedFrame]]) -> Figure | None:
    if not any(_with_pose(rows) for rows in by_method.values()):
        return None
    figure, axes = figure_with_axes(1, 2, 4.6)
    quantities = (("E_T_m", "translation error [m]"), ("E_R_deg", "rotation error [deg]"))
    size = _dot(max(len(_with_pose(rows)) for rows in by_method.values()))
    for ax, (field, label) in zip(axes, quantities, strict=True):
        for k, (method, rows) in enumerate(by_method.items()):
            posed = _with_pose(rows)
            x = np.array([r.record.range_m for r in posed])
            y = np.maximum([getattr(r.record, field) for r in posed], MIN_ERROR)
            accepted = np.array([r.record.accepted for r in posed], bool)
            colour = COLOURS[k % len(COLOURS)]
            ax.scatter(x[accepted], y[accepted], s=size, color=colour, lw=0, alpha=0.6)
            ax.scatter(x[~accepted], y[~accepted], s=size, facecolors="none", edgecolors=colour, lw=0.7)
            mids, (medians,) = _binned_percentiles(x, y, (50,))
            ax.plot(mids, medians, color=colour, lw=2, path_effects=HALO, zorder=4, label=method)
        ax.set(xlabel="range [m]", ylabel=label, yscale="log")
    printed = f"{THESIS_E_R_DEG} deg, mean printed in the Milan thesis"
    read = f"{np.degrees(THESIS_E_R_DEG):.2f} deg, the same, interpreted as radians"
    _mark(axes[0], THESIS_E_T_M, f"{THESIS_E_T_M} m, mean printed in the Milan thesis", "--")
    _mark(axes[1], THESIS_E_R_DEG, printed, "--")
    _mark(axes[1], float(np.degrees(THESIS_E_R_DEG)), read, ":")
    # above the axes, so that it covers no data
    axes[0].legend(frameon=False, fontsize=9, loc="lower left", bbox_to_anchor=(0, 1), ncols=4, borderpad=0)
    return figure


def _dot(n: int) -> float:
    """Return the dot area for ``n`` frames that keeps the dots distinguishable [pt^2]."""
    return float(np.clip(6000.0 / max(n, 1), 5.0, 22.0))


def _mark(ax: Axes, value: float, text: str, style: str) -> None:
    """Draw a labelled horizontal line."""
    ax.axhline(value, color=INK, ls=style, lw=1, zorder=3)
    ax.annotate(
        text,
        (0.99, value),
        (0, 3),
        xycoords=ax.get_yaxis_transform(),
        textcoords="offset points",
        ha="right",
        fontsize=8,
        color=INK,
        path_effects=HALO,
        zorder=5,
    )


def _binned_percentiles(
    x: np.ndarray, y: np.ndarray, percent: Sequence[float]
) -> tuple[list[float], np.ndarray]:
    """Return the median x of each bin with enough frames, and the percentiles (P, bins) of y in it."""
    mids, values = [], []
    edges = np.linspace(x.min(), x.max(), RANGE_BINS + 1) if len(x) else np.zeros(1)
    number = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, RANGE_BINS - 1)
    for k in range(RANGE_BINS):
        part = number == k
        if part.sum() >= MIN_IN_BIN:
            mids.append(float(np.median(x[part])))
            values.append(np.percentile(y[part], percent))
    return mids, np.array(values).reshape(-1, len(percent)).T


def _along_axes(by_method: dict[str, list[EvaluatedFrame]]) -> Figure | None:
    accepted = {m: [r.record for r in rows if r.record.accepted] for m, rows in by_method.items()}
    if not any(accepted.values()):
        return None
    all_records = [r for records in accepted.values() for r in records]
    right = [r for r in all_records if r.coarse] or all_records
    figure, axes = figure_with_axes(2, 3, 5.6)
    size = _dot(max(map(len, accepted.values())))
    for k, (method, records) in enumerate(accepted.items()):
        if not records:
            continue
        x = np.array([r.range_m for r in records])
        for a in range(3):
            for ax, field, factor in (
                (axes[a], "shift_camera_m", 1e3),
                (axes[3 + a], "turn_camera_deg", 1.0),
            ):
                values = factor * np.array([getattr(r, field)[a] for r in records])
                top = _half_height([factor * (getattr(r, field) or (0.0,) * 3)[a] for r in right])
                colour = COLOURS[k % len(COLOURS)]
                inside = np.abs(values) <= top
                ax.scatter(x[inside], values[inside], s=size, color=colour, lw=0, alpha=0.45)
                # values outside are drawn at the edge
                for is_outside, marker in ((values > top, "^"), (values < -top, "v")):
                    edge = np.full(int(is_outside.sum()), top if marker == "^" else -top)
                    ax.scatter(x[is_outside], edge, s=1.5 * size, color=colour, marker=marker, lw=0)
                mids, (low, middle, high) = _binned_percentiles(x, np.clip(values, -top, top), (5, 50, 95))
                ax.plot(mids, middle, color=colour, lw=2, path_effects=HALO, zorder=4, label=method)
                for side in (low, high):
                    ax.plot(mids, side, color=colour, lw=1.2, ls="--", path_effects=HALO, zorder=4)
                ax.set_ylim(-1.08 * top, 1.08 * top)
    for a, name in enumerate(AXES):
        axes[a].set_title(name, loc="left", fontsize=11, color=INK, fontweight="bold")
        axes[a].set_ylabel("position error [mm]" if a == 0 else "")
        axes[3 + a].set(xlabel="range [m]", ylabel="attitude error [deg]" if a == 0 else "")
        for ax in (axes[a], axes[3 + a]):
            ax.axhline(0, color=DIM, lw=0.8)
    if len(accepted) > 1:
        axes[2].legend(frameon=False, fontsize=9, loc="lower right", bbox_to_anchor=(1, 1), borderpad=0)
    return figure


def _half_height(values: Sequence[float]) -> float:
    """Return the half height of an axis that shows nearly all errors of correct poses."""
    return max(1.15 * float(np.percentile(np.abs(values), 98)), 1e-3) if values else 1.0


def _histograms(by_method: dict[str, list[EvaluatedFrame]]) -> Figure | None:
    methods = {m: _with_pose(rows) for m, rows in by_method.items() if _with_pose(rows)}
    if not methods:
        return None
    figure, axes = figure_with_axes(len(methods), 2, 1.0 + 2.4 * len(methods))
    # a logarithmic scale common to all methods, whose errors differ by factors of a hundred
    quantities = (
        ("E_T_m", "translation error [m]", "m", np.geomspace(1e-3, 1e2, 51), THESIS_E_T_M),
        ("E_R_deg", "rotation error [deg]", "deg", np.geomspace(1e-2, 180.0, 51), THESIS_E_R_DEG),
    )
    for row, (method, posed) in enumerate(methods.items()):
        for column, (field, label, unit, bins, thesis) in enumerate(quantities):
            ax = axes[2 * row + column]
            values = np.array([getattr(r.record, field) for r in posed])
            accepted = np.array([r.record.accepted for r in posed], bool)
            clipped = np.clip(values, 1.0001 * bins[0], 0.9999 * bins[-1])
            colour = COLOURS[row % len(COLOURS)]
            ax.hist(clipped, bins.tolist(), color=colour, alpha=0.3, label="declined")
            ax.hist(clipped[accepted], bins.tolist(), color=colour, label="accepted")
            ax.locator_params(axis="y", integer=True, nbins=6)
            ax.axvline(thesis, color=INK, ls="--", lw=1, label="mean printed in the Milan thesis")
            ax.set(
                xlabel=label if row == len(methods) - 1 else "",
                ylabel="frames" if column == 0 else "",
                xscale="log",
            )
            median, mean = f"median {np.median(values):.3g} {unit}", f"mean {values.mean():.3g} {unit}"
            ax.set_title(
                f"{method}, {len(values)} frames: {median}, {mean}", loc="left", fontsize=10, color=INK
            )
    axes[1].legend(frameon=False, fontsize=9, loc="upper right")
    return figure


def decision_figure(by_method: dict[str, list[EvaluatedFrame]]) -> Figure | None:
    """Plot availability against false accepts, and reliability; None if no method has more than one confidence."""
    methods = {m: rows for m, rows in by_method.items() if len({r.confidence for r in rows}) > 1}
    if not methods:
        return None
    figure, (left, right) = figure_with_axes(1, 2, 4.2)
    for k, (method, rows) in enumerate(methods.items()):
        colour = COLOURS[k % len(COLOURS)]
        curve = trade_off(rows)
        left.plot(100 * curve.false_accept, 100 * curve.availability, color=colour, lw=1.5, label=method)
        accepted = [r.record for r in rows if r.record.accepted]
        feasible = max(sum(r.record.feasible for r in rows), 1)
        wrong = sum(not r.coarse for r in accepted) / max(len(accepted), 1)
        left.plot(100 * wrong, 100 * sum(r.feasible for r in accepted) / feasible, "o", color=colour)
        bins = reliability(rows)
        x, y = (np.array([getattr(b, name) for b in bins]) for name in ("confidence", "right"))
        error_bars = np.array([[b.right - b.low, b.high - b.right] for b in bins]).T
        right.errorbar(x, y, np.maximum(error_bars, 0), fmt="o", color=colour, lw=1.2, capsize=2)
    left.set(xlabel="wrong, of accepted [%]", ylabel="accepted, of feasible [%]", xlim=(0, 10), ylim=(0, 101))
    left.legend(frameon=False, fontsize=9)
    right.plot((0, 1), (0, 1), "--", color=DIM, lw=1)
    right.set(xlabel="confidence", ylabel="share that is coarse", ylim=(-0.02, 1.02))
    return figure


def _stages(by_method: dict[str, list[EvaluatedFrame]]) -> Figure | None:
    methods = {m: rows for m, rows in by_method.items() if any(r.stages_ms for r in rows)}
    if not methods:
        return None
    figure, axes = figure_with_axes(1, 1, 1.4 + 0.75 * len(methods))
    ax = axes[0]
    medians = []
    for rows in methods.values():
        names = list(dict.fromkeys(n for r in rows for n in r.stages_ms))
        medians.append({n: float(np.median([r.stages_ms.get(n, 0.0) for r in rows])) for n in names})
    widest = max(1e-6, *(sum(m.values()) for m in medians))
    order = list(dict.fromkeys(n for m in medians for n in m))
    colours = {n: PALETTE[k % len(PALETTE)] for k, n in enumerate(order)}
    for row, stages in enumerate(medians):
        left = 0.0
        for name, ms in stages.items():
            ax.barh(row, ms, left=left, color=colours[name], height=0.6, lw=0)
            if ms > LABELLED_SHARE * widest:
                ax.text(
                    left + ms / 2,
                    row,
                    f"{name}\n{ms:.0f}",
                    ha="center",
                    va="center",
                    fontsize=8,
                    color="white",
                )
            left += ms
        ax.text(left + 0.01 * widest, row, f"{left:.0f} ms", va="center", fontsize=9, color=INK)
    ax.set_yticks(range(len(methods)), list(methods))
    ax.set_xlim(0, 1.1 * widest)
    ax.invert_yaxis()
    ax.set_xlabel("median time [ms], stages in order, short ones unlabelled")
    return figure
