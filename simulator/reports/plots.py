"""Plot style of this package's reports: one ink, one grid, axes without a box; light or dark."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, DIM, GRID = "#1f2933", "#7b8794", "#e4e7eb"
DARK_INK, DARK_GRID, DARK_PAPER = "#d7dde5", "#2b3440", "#12171e"

# Colours distinguishable by everybody (Okabe and Ito).
BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY = "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"


def figure_with_axes(
    rows: int,
    columns: int,
    height: float,
    *,
    width: float = 11,
    widths: tuple[float, ...] | None = None,
    dark: bool = False,
) -> tuple[Figure, list[Axes]]:
    """Create a figure with a grid of axes in the style of the reports.

    ``width`` and ``height`` are in inches, ``widths`` are the relative ones of the columns.

    Returns
    -------
    figure : Figure
        Figure outside pyplot, which need not be closed.
    axes : list of Axes
        ``rows`` times ``columns`` axes, row by row.
    """
    ink, frame, grid, paper = (
        (DARK_INK, DARK_GRID, DARK_GRID, DARK_PAPER) if dark else (INK, DIM, GRID, "white")
    )
    figure = Figure(figsize=(width, height), layout="constrained", facecolor=paper)
    axes = list(figure.subplots(rows, columns, squeeze=False, width_ratios=widths).ravel())
    for ax in axes:
        ax.set_facecolor(paper)
        ax.grid(color=grid, lw=0.8)
        ax.set_axisbelow(True)
        ax.tick_params(colors=ink, labelsize=9)
        ax.xaxis.label.set_color(ink)
        ax.yaxis.label.set_color(ink)
        for side in ("top", "right"):
            ax.spines[side].set_visible(False)
        for side in ("left", "bottom"):
            ax.spines[side].set_color(frame)
    return figure, axes


def png(figure: Figure, dpi: int = 110) -> bytes:
    """Encode a figure as PNG.

    Returns
    -------
    bytes
        Contents of a PNG file.
    """
    data = BytesIO()
    figure.savefig(data, dpi=dpi)
    return data.getvalue()
