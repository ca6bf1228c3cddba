"""When two poses are two answers, and the answers beside the best one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np

from hil.board.svd.geometry import quaternion as quat

Array = np.ndarray

# Poses that differ by more are distinct: a choice between them is an ambiguity [rad, share of range].
DISTINCT_RAD = float(np.radians(12.0))
DISTINCT_SHARE = 0.08


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
