"""Plot of a closed loop: trajectory, estimation errors with sigma, and holds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.reports.plots import BLUE, DIM, GREEN, ORANGE, VERMILION, figure_with_axes, png

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from flyaround.simulator.runtime.arrays import FloatArray

AXES = ("radial", "along_track", "cross_track")

# Colours of the phases that are marked on the time axis.
PHASES = {"hold": ORANGE, "abort": VERMILION}


def numbers(column: Sequence[str]) -> FloatArray:
    """Return a column as floats, with NaN for empty cells."""
    return np.array([float(cell) if cell else np.nan for cell in column])


def plot_errors(ax: Axes, t_s: FloatArray, error: FloatArray, sigma: FloatArray, label: str) -> None:
    """Plot an estimation error and the filter's largest sigma; ``label`` names the quantity and its unit."""
    ax.plot(t_s, error, color=BLUE, label="error")
    ax.plot(t_s, sigma, color=DIM, lw=1, label="sigma")
    ax.set(xlabel="time [s]", ylabel=label)
    if np.any(np.isfinite(error) & (error > 0)):
        ax.set_yscale("log")
        ax.legend(frameon=False, fontsize=8)


def position_error_m(steps: Mapping[str, Sequence[str]]) -> FloatArray:
    """Return the norm of the position error in each period; NaN without an estimate."""
    return np.sqrt(np.sum([numbers(steps[f"{axis}_error_m"]) ** 2 for axis in AXES], axis=0))


def plot_closed_loop(steps: Mapping[str, Sequence[str]]) -> bytes:
    """Return a PNG plot of ``closed_loop.csv``, given its columns by name."""
    figure, (path, position, attitude) = figure_with_axes(1, 3, 3.6, width=13, widths=(1.2, 1, 1))
    t_s = numbers(steps["t_s"])
    for axis, colour in zip(AXES, (BLUE, VERMILION, GREEN), strict=True):
        path.plot(t_s, numbers(steps[f"{axis}_m"]), color=colour, label=axis.replace("_", "-"))
    path.set(xlabel="time [s]", ylabel="chaser relative to target [m]")
    plot_errors(
        position,
        t_s,
        1e3 * position_error_m(steps),
        1e3 * numbers(steps["position_sigma_m"]),
        "position [mm]",
    )
    plot_errors(
        attitude,
        t_s,
        numbers(steps["attitude_error_deg"]),
        numbers(steps["attitude_sigma_deg"]),
        "attitude [deg]",
    )
    for phase, colour in PHASES.items():
        in_phase = np.array([name == phase for name in steps["phase"]])
        if in_phase.any():
            for ax in (path, position, attitude):
                # transparent behind the curves, with a single legend entry
                transform = ax.get_xaxis_transform()
                ax.fill_between(
                    t_s, 0, 1, where=in_phase, transform=transform, color=colour, alpha=0.2, lw=0, step="post",
                    label=phase if ax is path else None,
                )  # fmt: skip
    path.legend(frameon=False, fontsize=8)
    return png(figure)
