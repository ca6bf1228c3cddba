"""How this package's reports plot: one ink, one grid, axes without a box."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, DIM, GRID = "#1f2933", "#7b8794", "#e4e7eb"


def figure_with_axes(rows: int, columns: int, height: float) -> tuple[Figure, list[Axes]]:
    """A figure 11 inches wide and its axes, row by row; height in inches."""
    figure = Figure(figsize=(11, height), layout="constrained", facecolor="white")
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for ax in axes:
        ax.grid(color=GRID, lw=0.8)
        ax.set_axisbelow(True)
        ax.tick_params(colors=INK, labelsize=9)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
        for side in ("left", "bottom"):
            ax.spines[side].set_color(DIM)
    return figure, axes
