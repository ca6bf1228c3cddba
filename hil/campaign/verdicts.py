"""Comparison of runs with requirements: result, margin, and reason."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from flyaround.hil.campaign.quantities import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flyaround.hil.campaign.case_run import RunResult
    from flyaround.hil.campaign.definitions import Campaign, Requirement
    from flyaround.hil.campaign.quantities import Value

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    "<": operator.lt,
    ">=": operator.ge,
    ">": operator.gt,
    "==": operator.eq,
    "!=": operator.ne,
}


@dataclass(frozen=True, eq=False)
class Verdict:
    """One requirement of one run.

    Parameters
    ----------
    requirement : Requirement
        The requirement.
    value : Value
        Value of the quantity; a missing value, None, fails.
    passed : bool
        True if the value meets the limit.
    margin : float or None
        Distance of a number from the limit, negative if it fails.
    """

    requirement: Requirement
    value: Value
    passed: bool
    margin: float | None

    @staticmethod
    def from_value(requirement: Requirement, value: Value) -> Verdict:
        """Judge a value against a requirement."""
        limit = requirement.limit
        if isinstance(value, float) and not math.isfinite(value):
            value = None
        passed = value is not None and COMPARISONS[requirement.comparison](value, limit)
        margin = None
        if isinstance(value, float) and isinstance(limit, int | float):
            sides = {
                "<": limit - value,
                ">": value - limit,
                "=": 0.0 - abs(value - limit),
                "!": abs(value - limit),
            }
            margin = sides[requirement.comparison[0]]
        return Verdict(requirement, value, passed, margin)

    @property
    def sentence(self) -> str:
        """Value next to the requirement."""
        r, quantity = self.requirement, QUANTITIES[self.requirement.quantity]
        unit = quantity.unit
        has = (
            f"has no value ({quantity.meaning})"
            if self.value is None
            else f"is {format_value(self.value, unit)}"
        )
        return f"{r.name}: {r.quantity} {has}, required {r.comparison} {format_value(r.limit, unit)}"


@dataclass(frozen=True, eq=False)
class RunVerdict:
    """One run against all requirements of its case.

    Parameters
    ----------
    case : str
        Name of the case.
    seed : int
        Seed of the run.
    failure : str
        Cause of a run without a result or with an abnormal end; every requirement then fails.
    verdicts : tuple of Verdict
        Result of each requirement on the case.
    """

    case: str
    seed: int
    failure: str
    verdicts: tuple[Verdict, ...]

    @property
    def passed(self) -> bool:
        """True if the run ended normally and meets all requirements."""
        return not self.failure and all(v.passed for v in self.verdicts)

    @property
    def reason(self) -> str:
        """Reason for a failure; empty if the run passed."""
        return self.failure or "; ".join(v.sentence for v in self.verdicts if not v.passed)

    @property
    def folder(self) -> str:
        """Folder of the run, relative to the campaign's."""
        return f"runs/{self.case}/seed-{self.seed}"


def judge(campaign: Campaign, case: str, seed: int, result: RunResult) -> RunVerdict:
    """Judge a run's result against the requirements of its case.

    A run whose board disconnected fails, unless a requirement states how it must end.
    """
    required = [r for r in campaign.requirement if r.is_about(case)]
    failure, ended = result.failure, result.values.get("ended")
    if not failure and ended != "completed" and all(r.quantity != "ended" for r in required):
        failure = f"the run ended: {str(ended).replace('_', ' ')}"
    values: list[Value] = [None if failure else result.values.get(r.quantity) for r in required]
    verdicts = tuple(Verdict.from_value(r, value) for r, value in zip(required, values, strict=True))
    return RunVerdict(case, seed, failure, verdicts)


def worst_verdict(verdicts: Sequence[Verdict]) -> Verdict:
    """Return the verdict without a value, else a failed one, else the one with the minimum margin."""
    return min(
        verdicts, key=lambda v: (v.value is not None, v.passed, v.margin if v.margin is not None else 0.0)
    )


def format_value(value: float | str, unit: str = "", *, digits: int = 4) -> str:
    """Format a number with its unit, large ones with all digits; return a word unchanged."""
    if isinstance(value, str):
        return value
    # from ten million on, the exponent reads better than the digits
    number = f"{value:.0f}" if 10**digits <= abs(value) < 1e7 else f"{value:.{digits}g}"
    return f"{number} {unit}".rstrip()
