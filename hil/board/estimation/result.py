"""Result of an estimator for one image, and the distinct alternatives to the best pose."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat

Array = np.ndarray

# Poses that differ by more than either are distinct: rotation [rad], and translation as a share of range. More than
# the limits of coarse success (5 degrees, 5 % of range: hil/evaluate/pose_errors.py), so that two poses near one
# solution are not reported as two. Larger values merge solutions of a nearly symmetric craft.
DISTINCT_RAD = float(np.radians(12.0))
DISTINCT_SHARE = 0.08

# Number of alternatives that a result lists.
MAX_ALTERNATIVES = 3


@dataclass(frozen=True, eq=False)
class Alternative:
    """A distinct pose that was considered and rejected.

    Parameters
    ----------
    q_camera_from_target_wxyz : (4,) array
        Attitude, camera from target, scalar first.
    t_camera_from_target_m : (3,) array
        Target position in the camera frame [m].
    score : float
        Ranking score, larger is better; comparable within one result only.
    """

    q_camera_from_target_wxyz: Array
    t_camera_from_target_m: Array
    score: float


@dataclass(frozen=True, eq=False)
class PoseResult:
    """Result of an estimator for one image.

    Parameters
    ----------
    accepted : bool
        True if the pose may be used.
    reason : str
        Reason for a decline, else empty.
    q_camera_from_target_wxyz : (4,) array or None
        Attitude of the best pose, ``x_camera = R(q) x_target + t``; None without a pose. A declined result still
        carries its best pose.
    t_camera_from_target_m : (3,) array or None
        Target position of the best pose in the camera frame [m].
    confidence : float
        Confidence, 0 to 1.
    stages_ms : dict of str to float, optional
        Duration of each stage, in order [ms].
    counts : dict of str to int, optional
        Number of results of each stage.
    evidence : object, optional
        Evidence for the decision, of a type defined by the method.
    covariance : (6, 6) array, optional
        Covariance of the rotation [rad] and translation [m] errors, camera axes.
    alternatives : tuple of Alternative, optional
        Distinct poses, best first.
    method : str, optional
        Name of the method.
    """

    accepted: bool
    reason: str
    q_camera_from_target_wxyz: Optional[Array]
    t_camera_from_target_m: Optional[Array]
    confidence: float
    stages_ms: Dict[str, float] = field(default_factory=dict)
    counts: Dict[str, int] = field(default_factory=dict)
    evidence: Optional[object] = None
    covariance: Optional[Array] = None
    alternatives: Tuple[Alternative, ...] = ()
    method: str = ""


def differs(q: Array, t: Array, q2: Array, t2: Array) -> bool:
    """Return True if two poses are distinct (see ``DISTINCT_RAD``)."""
    far = np.linalg.norm(t - t2) > DISTINCT_SHARE * np.linalg.norm(t2)
    return bool(far or quat.angle_rad(q, q2) > DISTINCT_RAD)


def alternatives(poses: List[Tuple[Array, Array, float]], q: Array, t: Array) -> Tuple[Alternative, ...]:
    """Return the best of the scored poses (q, t, score) that are distinct from ``q``, ``t`` and from each other."""
    out: List[Alternative] = []
    for rq, rt, score in sorted(poses, key=lambda p: -p[2]):
        distinct = [(q, t)] + [(a.q_camera_from_target_wxyz, a.t_camera_from_target_m) for a in out]
        if all(differs(rq, rt, other_q, other_t) for other_q, other_t in distinct):
            out.append(Alternative(rq, rt, score))
        if len(out) == MAX_ALTERNATIVES:
            break
    return tuple(out)
