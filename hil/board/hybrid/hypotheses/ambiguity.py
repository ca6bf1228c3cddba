"""When two poses are two answers, and the answers beside the best one."""

from __future__ import annotations

from typing import List, Sequence

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.result import differs
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit

Array = np.ndarray

# Ends farther apart than this are two [rad].
OTHER_END_RAD = float(np.radians(5.0))

# Poses nearer than this to a better one end where it does: 30 of 30 pairs within 0.4 deg, 20 mm [rad, share of range].
SAME_RAD, SAME_SHARE = float(np.radians(1.0)), 0.03

# How far apart in attitude hypotheses are that are compared [rad].
SPREAD_RAD = float(np.radians(6.0))


def same_end(a: PoseFit, b: PoseFit) -> bool:
    """Whether two hypotheses refined to the end are one answer: the same attitude at the same place."""
    return bool(quat.angle_rad(a.q, b.q) <= OTHER_END_RAD) and not differs(a.q, a.t, b.q, b.t)


def converges_elsewhere(pose: PoseFit, better: PoseFit, apart_rad: float) -> bool:
    """Whether a pose will not converge to a better one: it is turned by more, or elsewhere."""
    away = pose.t - better.t
    elsewhere = away.dot(away) > SAME_SHARE**2 * better.t.dot(better.t)
    return bool(elsewhere or quat.angle_rad(pose.q, better.q) > apart_rad)


def without_duplicates(hypotheses: List[Hypothesis]) -> List[Hypothesis]:
    """Hypotheses without those that nearly are one that comes before."""
    out: List[Hypothesis] = []
    for h in hypotheses:
        if all(converges_elsewhere(h.pose, o.pose, SAME_RAD) for o in out):
            out.append(h)
    return out


def was_refined(h: Hypothesis, ends: Sequence[Hypothesis]) -> bool:
    """Whether a hypothesis nearly is one that was refined to its end: it ends where that does."""
    return any(not converges_elsewhere(h.pose, e.origin.pose, SAME_RAD) for e in ends)


def spread_in_attitude(hypotheses: Sequence[Hypothesis], keep: int) -> List[Hypothesis]:
    """The first ``keep`` that differ in attitude from each other."""
    out: List[Hypothesis] = []
    for h in hypotheses:
        if len(out) >= keep:
            break
        if all(quat.angle_rad(h.q, o.q) > SPREAD_RAD for o in out):
            out.append(h)
    return out


def largest_sigma(covariance: Array) -> float:
    """One-sigma error along the worst held direction of a block (3, 3) of a pose's covariance."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
