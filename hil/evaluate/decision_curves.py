"""Curves of an estimator's decision: availability against false accepts, and reliability of the confidence."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.evaluate.metrics import wilson_interval

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from flyaround.hil.evaluate.result_rows import EvaluatedFrame

# Edges of the bins in which confidence is compared with the share of correct poses.
BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.85, 0.95, 0.98, 1.0)


@dataclass(frozen=True, eq=False)
class TradeOff:
    """Availability and false accepts as functions of the confidence threshold, strictest first.

    Parameters
    ----------
    threshold : (N,) array
        Confidence thresholds.
    availability : (N,) array
        Share of the feasible frames that are accepted.
    false_accept : (N,) array
        Share of wrong poses among the accepted ones, infeasible frames included.
    """

    threshold: NDArray[np.float64]
    availability: NDArray[np.float64]
    false_accept: NDArray[np.float64]


@dataclass(frozen=True)
class Reliability:
    """One bin of a reliability diagram.

    Parameters
    ----------
    confidence : float
        Mean confidence.
    right : float
        Share of coarsely correct poses.
    low : float
        Lower end of Wilson's 95 % interval of ``right``.
    high : float
        Upper end.
    n : int
        Number of frames.
    """

    confidence: float
    right: float
    low: float
    high: float
    n: int


def trade_off(rows: Sequence[EvaluatedFrame]) -> TradeOff:
    """Return availability and false accepts at every threshold; other reasons to decline are ignored."""
    confidence = np.array([r.confidence for r in rows])
    order = np.argsort(-confidence, kind="stable")
    feasible = np.array([r.record.feasible for r in rows], bool)[order]
    wrong = ~np.array([r.record.coarse for r in rows], bool)[order]
    accepted = np.arange(1, len(rows) + 1)
    # frames of equal confidence are accepted together
    last = np.append(np.diff(confidence[order]) != 0, True)
    return TradeOff(
        confidence[order][last],
        (np.cumsum(feasible) / max(int(feasible.sum()), 1))[last],
        (np.cumsum(wrong) / accepted)[last],
    )


def reliability(rows: Sequence[EvaluatedFrame]) -> list[Reliability]:
    """Return the share of correct poses in each bin of confidence; empty bins are omitted."""
    confidence = np.array([r.confidence for r in rows])
    right = np.array([r.record.coarse for r in rows], bool)
    out = []
    for low, high in pairwise(BINS):
        inside = (confidence >= low) & ((confidence < high) | (high == BINS[-1]))
        n, k = int(inside.sum()), int(right[inside].sum())
        interval = wilson_interval(k, n)
        if interval is not None:
            out.append(Reliability(float(confidence[inside].mean()), k / n, *interval, n))
    return out
