"""Report page of a delay map: a heat map for each loss rate, the 50 % line and the verified cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps

from flyaround.hil.campaign.map_flights import WITHIN_DEG, WITHIN_M
from flyaround.simulator.reports.page import Page, key_figures, link, note, plot, table
from flyaround.simulator.reports.plots import INK, figure_with_axes, png
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes

    from flyaround.hil.campaign.map_results import CellResult, CheckedCell, DelayMapOutcome

PAGE, PICTURE = "index.html", "delay_map.png"
ERRORS = "No images were rendered: poses are the truth with the measured errors of the estimator hybrid."


CHECK_COLUMNS: dict[str, Callable[[CheckedCell], str]] = {
    "latency": lambda c: f"{c.drawn.latency_s:g} s",
    "jitter": lambda c: f"{c.drawn.jitter_s:g} s",
    "lost": lambda c: f"{c.drawn.drops:.0%}",
    "without images": lambda c: _share(c.without_pictures),
    "rendered, with a board": lambda c: _share(c.drawn),
    "intervals overlap": lambda c: "yes" if c.agree else "NO",
}


def write_delay_map_page(folder: Path, outcome: DelayMapOutcome) -> None:
    """Write the image and the page that shows it."""
    picture = draw_delay_map(outcome)
    write_atomic(folder / PICTURE, picture)
    s, first = outcome.settings, outcome.half[0]
    page = Page("Flyaround: delay map", f"Success over the link's delays: {s.scenario}", width_px=1240)
    interval_text = "once per control period" if s.every_s is None else f"every {s.every_s:g} s"
    page.add(
        note(
            f"{len(outcome.cells)} cells of {s.flights} approaches, seeds from {s.first_seed} on in each; a picture"
            f" {interval_text}. {ERRORS}"
        )
    )
    page.add(
        key_figures(
            [
                (first.words, f"half fail, jitter {first.jitter_s:g} s, {first.drops:.0%} lost"),
                (sum(c.flights for c in (*outcome.cells, *outcome.refined)), "approaches"),
                (sum(c.flights - c.successes for c in outcome.cells), "failed"),
            ]
        )
    )
    page.add(
        plot(
            picture,
            f"A successful approach arrives within {WITHIN_M:g} m and {WITHIN_DEG:g} deg and never enters the sphere "
            "outside its corridor; "
            "the line marks 50 % success. Latency: from mid-exposure to the pose in the filter; jitter: additional, "
            "uniform from 0; lost: share of poses. " + ERRORS,
            alt="delay map",
        )
    )
    page.section(
        "Latency of 50 % success",
        note(
            "Interpolated between the two neighbouring latencies; in brackets the nearest latencies whose success is "
            "above, and below, one half by Wilson's 95 % interval."
        ),
        table(
            ("jitter", *(f"{d:.0%} lost" for d in s.drops)),
            [
                (f"{jitter:g} s", *(h.words for h in outcome.half if h.jitter_s == jitter))
                for jitter in s.jitters_s
            ],
        ),
    )
    if outcome.extended:
        levels = ", ".join(f"{x:g}" for x in outcome.extended)
        page.add(note(f"Latencies added because more than half still succeeded: {levels} s."))
    if outcome.checked:
        page.section(
            "Cells verified with rendered frames and a board's poses",
            note("Wilson's 95 % intervals. Delays and losses act on the flight's clock, in lockstep."),
            table(
                tuple(CHECK_COLUMNS),
                [[value(c) for value in CHECK_COLUMNS.values()] for c in outcome.checked],
            ),
        )
    files = ("cells.csv", "flights.csv", "delay_map.json", PICTURE)
    page.add(note("Files: ", [(link(name), " ") for name in files]))
    page.write(folder / PAGE)


def _share(result: CellResult) -> str:
    return f"{result.successes} of {result.flights} ({result.low:.0%} to {result.high:.0%})"


def draw_delay_map(outcome: DelayMapOutcome) -> bytes:
    """Return the PNG of heat maps of jitter over latency for each loss rate."""
    s = outcome.settings
    latencies = (*s.latencies_s, *outcome.extended)
    figure, axes = figure_with_axes(1, len(s.drops), 0.62 * len(s.jitters_s) + 1.7, width=13.5)
    by_cell = {(c.drops, c.jitter_s, c.latency_s): c for c in outcome.cells}
    image, colours = None, colormaps["RdYlBu"]
    for ax, drops in zip(axes, s.drops, strict=True):
        cells = [[by_cell[drops, jitter, latency] for latency in latencies] for jitter in s.jitters_s]
        image = ax.imshow(
            [[c.share for c in row] for row in cells],
            cmap=colours, vmin=0, vmax=1, origin="lower", aspect="auto",
        )  # fmt: skip
        for y, row in enumerate(cells):
            for x, c in enumerate(row):
                # white on the dark ends of the colours
                ink = INK if 0.15 < c.share < 0.85 else "white"
                # on top of the 50 % line, on a patch in the cell's colour
                patch = {"boxstyle": "round,pad=0.15", "fc": colours(c.share), "ec": "none"}
                ax.text(
                    x,
                    y,
                    f"{c.successes}",
                    ha="center",
                    va="center",
                    fontsize=9,
                    color=ink,
                    bbox=patch,
                    zorder=3,
                )
        ax.grid(visible=False)
        ax.set_xticks(range(len(latencies)), [f"{x:g}" for x in latencies])
        ax.set_yticks(range(len(s.jitters_s)), [f"{x:g}" for x in s.jitters_s])
        ax.set_xlabel("latency [s]")
        ax.set_title(f"{drops:.0%} of the poses lost", loc="left", fontsize=11, color=INK, fontweight="bold")
        _mark_halves(ax, outcome, drops, latencies)
    axes[0].set_ylabel("jitter, up to [s]")
    if image is not None:
        bar = figure.colorbar(image, ax=axes, fraction=0.025, pad=0.01)
        bar.set_label(f"success of {s.flights} approaches")
    figure.suptitle(f"{s.scenario}. {ERRORS}", fontsize=9, color=INK, x=0.01, ha="left")
    return png(figure)


def _mark_halves(ax: Axes, outcome: DelayMapOutcome, drops: float, latencies: Sequence[float]) -> None:
    """Draw the 50 % line in each row that has one."""
    places, rows = [], []
    for y, jitter in enumerate(outcome.settings.jitters_s):
        half = next(h for h in outcome.half if (h.jitter_s, h.drops) == (jitter, drops))
        if half.latency_s is not None:
            x = float(np.interp(half.latency_s, latencies, range(len(latencies))))
            places += [x, x, np.nan]
            rows += [y - 0.5, y + 0.5, np.nan]
    ax.plot(places, rows, color=INK, lw=2)
