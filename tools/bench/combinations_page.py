"""Page of the times of all combinations in Markdown: a table per camera, the variants and the goals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tools.bench.combinations import BASE, PINHOLE, goals_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.simulator.bench.scenes import BenchMachine
    from tools.bench.combinations import CombinationCost


def combinations_page(machine: BenchMachine, costs: Sequence[CombinationCost], made_by: str) -> str:
    """Return the page in Markdown.

    Parameters
    ----------
    machine : BenchMachine
        Machine of the measurements.
    costs : sequence of CombinationCost
        Times of all combinations.
    made_by : str
        Command line that made the measurement.
    """
    lines = [
        "# Every scenario through every camera",
        "",
        f"`{made_by}`; {machine.gl_renderer}, {machine.threads} threads. Wall time in milliseconds, medians of five",
        "consecutive frames in the middle of the flight, after two to warm up. *Frame*: render, read-back and sensor.",
        "*Captured*: a frame with truth and mask, checked and written by one process.",
        "",
        "## Goals",
        "",
        *_table(
            ("goal", "worst", "limit", "measured", ""),
            (
                (
                    g.name,
                    f"`{g.worst}`" if g.worst else "",
                    f"{g.limit:g} {g.unit}",
                    f"{g.measured:.2f}",
                    _met(g.met),
                )
                for g in goals_of(tuple(costs))
            ),
        ),
    ]
    plain = [c for c in costs if not c.variant]
    cameras = sorted({c.camera for c in plain})
    for title, field in (("Frame", "frame_ms"), ("Captured", "capture_ms")):
        lines += ["", f"## {title}: one band / three bands", ""]
        times = {(c.scenario, c.camera, c.bands): f"{getattr(c, field):.0f}" for c in plain}
        lines += _table(
            ("scenario", *(f"`{camera}`" for camera in cameras)),
            (
                (
                    f"`{s}`",
                    *(f"{times.get((s, c, 'mono'), '-')} / {times.get((s, c, 'rgb'), '-')}" for c in cameras),
                )
                for s in sorted({c.scenario for c in plain})
            ),
        )
    variants = [c for c in costs if c.variant]
    if variants:
        lines += ["", f"## Other sensors and craft: `{BASE}` through `{PINHOLE}`", ""]
        lines += _table(
            ("variant", "frame", "sensor", "labels", "captured"),
            (
                (c.variant, *(f"{ms:.0f}" for ms in (c.frame_ms, c.sensor_ms, c.labels_ms, c.capture_ms)))
                for c in variants
            ),
        )
    return "\n".join(lines) + "\n"


def _met(met: bool) -> str:  # noqa: FBT001 - a yes or no for people
    return "met" if met else "**missed**"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [_line(head), "|---" * len(head) + "|", *(_line(row) for row in rows)]


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |"
