"""Tables of the studies in Markdown: shares with intervals, paired counts, mean errors in degrees and radians."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binomtest

from flyaround.hil.evaluate.metrics import bootstrap_intervals
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from flyaround.hil.evaluate.metrics import MethodMetrics
    from flyaround.hil.evaluate.pose_errors import FrameScore
    from flyaround.hil.evaluate.result_rows import EvaluatedFrame

# attitude error below which a pose is coarsely right
RIGHT_DEG = 10.0


def mcnemar(n_gained: int, n_lost: int) -> float:
    """Return the exact two-sided probability of an at least as uneven split of discordant frames.

    References
    ----------
    McNemar (1947), Psychometrika 12: under equal success rates, each discordant frame favours either method with 1/2.
    """
    return float(binomtest(n_gained, n_gained + n_lost).pvalue) if n_gained + n_lost else 1.0


def paired(rows: Sequence[EvaluatedFrame], first: str, second: str) -> tuple[int, int, float]:
    """Return the feasible frames that only ``second`` gets coarsely right, those that only ``first`` does, and the
    p-value of `mcnemar`.
    """
    right = {(r.method, r.frame): r.record.coarse for r in rows if r.record.feasible}
    common = [k for method, k in right if method == first and (second, k) in right]
    gained = sum(right[second, k] and not right[first, k] for k in common)
    lost = sum(right[first, k] and not right[second, k] for k in common)
    return gained, lost, mcnemar(gained, lost)


def table(rows: Sequence[tuple[str, MethodMetrics]], differ: Sequence[str] = ()) -> str:
    """Return the metrics of each row in Markdown; ``differ`` is the last column, by row."""
    head = (
        "| | coarse | fine | available | false of accepted | median E_R deg, E_T mm (all) | "
        "mean E_T mm accepted (all) | failures |"
    )
    lines = [head, "|---|---|---|---|---|---|---|---|"]
    for name, m in rows:
        wrong = round((m.false_accept or 0.0) * m.n_accepted)
        lines.append(
            f"| {name} | {_share(m.coarse_success, m.coarse_success_wilson)} | "
            f"{_share(m.fine_success, m.fine_success_wilson)} | {_share(m.availability, m.availability_wilson)} | "
            f"{wrong} of {m.n_accepted} | {_number(m.median_E_R_deg_all)}, {_number(m.median_E_T_m_all, 1e3)} | "
            f"{_number(m.mean_E_T_m, 1e3)} ({_number(m.mean_E_T_m_all, 1e3)}) | "
            f"{', '.join(f'{n} {k}' for k, n in m.failures.items()) or '-'} |"
        )
    if differ:
        lines = [
            a + b
            for a, b in zip(lines, [" gained, lost (p) |", "---|", *(f" {d} |" for d in differ)], strict=True)
        ]
    return "\n".join(lines)


def units_table(records: Sequence[tuple[str, Sequence[FrameScore]]]) -> str:
    """Return the mean position and attitude errors over several selections of frames, in degrees and in radians."""
    chosen: dict[str, Callable[[FrameScore], bool]] = {
        "every pose": lambda _: True,
        "accepted": lambda r: r.accepted,
        f"right within {RIGHT_DEG:g} deg": lambda r: r.E_R_deg is not None and r.E_R_deg < RIGHT_DEG,
    }
    lines = ["| frames | n | mean E_T, m | mean E_R, deg | median E_R, deg | mean E_R, rad |"]
    lines.append("|---|---|---|---|---|---|")
    for name, all_records in records:
        feasible = [r for r in all_records if r.feasible]
        for label, holds in chosen.items():
            errors = [
                (r.E_T_m, r.E_R_deg)
                for r in feasible
                if r.E_T_m is not None and r.E_R_deg is not None and holds(r)
            ]
            shift, turn = np.array(errors, float).reshape(-1, 2).T
            turned = "- | - | -"
            if len(turn):
                median, mean = float(np.median(turn)), float(np.mean(turn))
                turned = f"{_mean(turn)} | {_number(median)} | {np.radians(mean):.3f}"
            lines.append(
                f"| {name}, {label} | {len(errors)} of {len(feasible)} | {_mean(shift)} | {turned} |"
            )
    return "\n".join(lines)


def write_into_page(page: Path, part: str, name: str, text: str) -> None:
    """Write a table between ``<!-- study PART NAME -->`` and ``<!-- end -->`` of a page.

    Raises
    ------
    UserError
        If the page lacks these lines.
    """
    before = page.read_text(encoding="utf-8")
    pattern = re.compile(
        rf"(<!-- study {re.escape(part)} {re.escape(name)} -->\n).*?(<!-- end -->)", re.DOTALL
    )
    after, n_replaced = pattern.subn(lambda m: f"{m[1]}{text}\n{m[2]}", before)
    if not n_replaced:
        raise UserError(
            f"{page} has no place for this table: add the lines <!-- study {part} {name} --> and <!-- end -->"
        )
    page.write_text(after, encoding="utf-8")


def _share(value: float | None, interval: tuple[float, float] | None) -> str:
    if value is None or interval is None:
        return "-"
    return f"{100 * value:.0f} % ({100 * interval[0]:.0f}-{100 * interval[1]:.0f})"


def _number(value: float | None, factor: float = 1.0) -> str:
    if value is None:
        return "-"
    x = factor * value
    return f"{x:.0f}" if abs(x) >= 100 else f"{x:.3g}"


def _mean(values: np.ndarray) -> str:
    """Return the mean with its bootstrap interval."""
    if not len(values):
        return "-"
    _, interval = bootstrap_intervals(list(values))
    interval_text = "" if interval is None else f" ({interval[0]:.3g}-{interval[1]:.3g})"
    return f"{float(np.mean(values)):.3g}{interval_text}"
