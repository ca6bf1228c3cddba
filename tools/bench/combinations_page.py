"""The times of all combinations as a page of Markdown tables: one a camera, one of the variants, one of the goals."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

from tools.bench.combinations import BASE, PINHOLE, goals_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.simulator.bench.scenes import BenchMachine
    from tools.bench.combinations import CombinationCost


def combinations_page(machine: BenchMachine, costs: Sequence[CombinationCost], made_by: str) -> str:
    """The page.

    Parameters
    ----------
    made_by : the command line that measured it.
    """
    lines = [
        "# Every scenario through every camera",
        "",
        f"`{made_by}`; {machine.gl_renderer}, {machine.threads} threads. Wall time in milliseconds, medians of five",
        "neighbouring frames in the middle of the flight; the first two, with the starts, are left out. *Frame*:",
        "render, read-back and sensor. *Labels*: what truth, mask and all layers add. *Captured*: a frame with truth",
        "and mask, checked and written by one process. *Reference*: the reference pass at this size, in turns",
        f"with the frames. *Beside*: the frame over that of `{BASE}` through `{PINHOLE}` in one band.",
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
    base = next(
        (c for c in costs if (c.scenario, c.camera, c.bands, c.variant) == (BASE, PINHOLE, "mono", "")), None
    )
    base_ms = base.frame_ms if base is not None else float("nan")
    plain = sorted((c for c in costs if not c.variant), key=lambda c: (c.camera, c.scenario, c.bands))
    for camera, of_camera in groupby(plain, key=lambda c: c.camera):
        rows = list(of_camera)
        lines += ["", f"## `{camera}`, {rows[0].width_px} x {rows[0].height_px}", ""]
        lines += _table(
            ("scenario", "frame", "RGB", "sensor", "labels", "captured", "RGB", "reference", "beside"),
            (_row(list(pair), base_ms) for _, pair in groupby(rows, key=lambda c: c.scenario)),
        )
    variants = [c for c in costs if c.variant]
    if variants:
        lines += ["", f"## Other sensors and craft: `{BASE}` through `{PINHOLE}`", ""]
        lines += _table(
            ("variant", "frame", "sensor", "labels", "captured", "beside"),
            (
                (
                    c.variant,
                    *(f"{ms:.0f}" for ms in (c.frame_ms, c.sensor_ms, c.labels_ms, c.capture_ms)),
                    f"{c.frame_ms / base_ms:.2f}",
                )
                for c in variants
            ),
        )
    return "\n".join(lines) + "\n"


def _row(pair: list[CombinationCost], base_ms: float) -> tuple[str, ...]:
    mono = next((c for c in pair if c.bands == "mono"), pair[0])
    rgb = next((c for c in pair if c.bands == "rgb"), pair[-1])
    times = (
        mono.frame_ms,
        rgb.frame_ms,
        mono.sensor_ms,
        mono.labels_ms,
        mono.capture_ms,
        rgb.capture_ms,
        mono.reference_ms,
    )
    return (f"`{mono.scenario}`", *(f"{ms:.0f}" for ms in times), f"{mono.frame_ms / base_ms:.2f}")


def _met(met: bool) -> str:  # noqa: FBT001 - a yes or no for people
    return "met" if met else "**missed**"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    return [_line(head), "|---" * len(head) + "|", *(_line(row) for row in rows)]


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |"
