"""Criteria for equivalent poses, and selection of distinct ones."""

from __future__ import annotations

from typing import Callable, List, Optional, Sequence

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit

Array = np.ndarray

# Poses closer than this to a better one converge to it [rad, share of range]; hand-tuned.
SAME_RAD, SAME_SHARE = float(np.radians(1.0)), 0.03

# Minimum attitude difference between hypotheses that are compared [rad]; hand-tuned.
SPREAD_RAD = float(np.radians(6.0))

# Maximum deficit of a pose's log-likelihood by the network. Correct poses have far smaller deficits
# (docs/lab/2026-11-keypoint-network.md).
MAX_NETWORK_DEFICIT = 5.0

# Log-likelihoods (N,) of attitudes q (N, 4) at positions t (N, 3) by the network, see LearnedProposer.log_likelihood.
Prior = Callable[[Array, Array], Array]


def converges_elsewhere(pose: PoseFit, better: PoseFit, apart_rad: float) -> bool:
    """Return True if ``pose`` differs from ``better`` so much that it will not converge to it."""
    offset = pose.t - better.t
    elsewhere = offset.dot(offset) > SAME_SHARE**2 * better.t.dot(better.t)
    return bool(elsewhere or quat.angle_rad(pose.q, better.q) > apart_rad)


def without_duplicates(hypotheses: List[Hypothesis]) -> List[Hypothesis]:
    """Return the hypotheses without near-duplicates of an earlier one."""
    out: List[Hypothesis] = []
    for h in hypotheses:
        if all(converges_elsewhere(h.pose, o.pose, SAME_RAD) for o in out):
            out.append(h)
    return out


def without_unlikely(hypotheses: List[Hypothesis], prior: Optional[Prior]) -> List[Hypothesis]:
    """Return the hypotheses except those that the keypoint network considers far less likely than another.

    Under lamps a view of the wrong side explains an image nearly as well as a view of the right side.
    """
    if prior is None or len(hypotheses) < 2:
        return hypotheses
    log_likelihood = prior(np.array([h.q for h in hypotheses]), np.array([h.t for h in hypotheses]))
    least = log_likelihood.max() - MAX_NETWORK_DEFICIT
    return [hypotheses[k] for k in np.flatnonzero(log_likelihood >= least)]


def spread_in_attitude(hypotheses: Sequence[Hypothesis], keep: int, spread_rad: float) -> List[Hypothesis]:
    """Return the first ``keep`` hypotheses that differ in attitude from each other by ``spread_rad``."""
    out: List[Hypothesis] = []
    for h in hypotheses:
        if len(out) >= keep:
            break
        if all(quat.angle_rad(h.q, o.q) > spread_rad for o in out):
            out.append(h)
    return out


def largest_sigma(covariance: Array) -> float:
    """Return the one-sigma error along the least determined direction of a covariance block (3, 3)."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
