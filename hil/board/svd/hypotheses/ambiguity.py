"""When two poses are two answers, and the answers beside the best one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Sequence, Tuple

import numpy as np

from flyaround.hil.board.svd.geometry import quaternion as quat
from flyaround.hil.board.svd.hypotheses.hypothesis import Hypothesis, PoseFit

Array = np.ndarray

# Poses that differ by more are distinct: a choice between them is an ambiguity [rad, share of range].
DISTINCT_RAD = float(np.radians(12.0))
DISTINCT_SHARE = 0.08

# Ends farther apart than this are two [rad].
OTHER_END_RAD = float(np.radians(5.0))

# Poses nearer than this to a better one end where it does: 30 of 30 pairs within 0.4 deg, 20 mm [rad, share of range].
SAME_RAD, SAME_SHARE = float(np.radians(1.0)), 0.03

# How far apart in attitude hypotheses are that are compared [rad].
SPREAD_RAD = float(np.radians(6.0))


@dataclass(frozen=True, eq=False)
class Alternative:
    """A distinct pose that was considered.

    Parameters
    ----------
    q_camera_from_target_wxyz, t_camera_from_target_m : the pose.
    score : what poses were ranked by, larger is better; only differences within one result mean anything.
    """

    q_camera_from_target_wxyz: Array
    t_camera_from_target_m: Array
    score: float


def differs(q: Array, t: Array, q2: Array, t2: Array) -> bool:
    """Whether two poses are distinct answers rather than one answer twice."""
    far = np.linalg.norm(t - t2) > DISTINCT_SHARE * np.linalg.norm(t2)
    return bool(far or quat.angle_rad(q, q2) > DISTINCT_RAD)


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


def alternatives(
    poses: List[Tuple[Array, Array, float]], q: Array, t: Array, keep: int = 3
) -> Tuple[Alternative, ...]:
    """The best poses (q, t, score) distinct from ``q``, ``t`` and from each other."""
    out: List[Alternative] = []
    for rq, rt, score in sorted(poses, key=lambda p: -p[2]):
        taken = [(q, t)] + [(a.q_camera_from_target_wxyz, a.t_camera_from_target_m) for a in out]
        if all(differs(rq, rt, aq, at) for aq, at in taken):
            out.append(Alternative(rq, rt, score))
        if len(out) >= keep:
            break
    return tuple(out)


def largest_sigma(covariance: Array) -> float:
    """One-sigma error along the worst held direction of a block (3, 3) of a pose's covariance."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
