"""Check of the roll angle of round targets: compares the pose with poses rotated about the symmetry axis.

The silhouette of a round target hardly changes with roll, so only windows and panels determine the roll.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.decide.selection import Selection, select
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.view_tables import curved
from flyaround.hil.board.hybrid.refine.final import SCORE_TOLERANCE, refine_to_end
from flyaround.hil.board.hybrid.refine.shadows import search_sun

Array = np.ndarray

# Iteratively reweighted least squares of the axis: iterations, and lower bound of the residuals [share of the radius].
IRLS_ITERATIONS, MIN_RESIDUAL = 10, 0.01

# Maximum number of rounds; each starts from the better pose found by the previous one.
ROUNDS = 3

# Rotations about the axis to evaluate [rad]. They are fine because refinement seldom corrects a roll error of 7 deg.
ROLLS_RAD = tuple(float(np.radians(way * a)) for a in (2.0, 4.0, 6.0, 8.0, 10.0, 13.0) for way in (1, -1))


def axis(model: BoardModel) -> Tuple[Array, Array]:
    """Estimate the symmetry axis of a round target from the normals of its curved surfaces.

    Returns
    -------
    along : (3,) array
        Unit vector along the axis, target frame.
    through : (3,) array
        Point on the axis, target frame [m].
    """
    assert model.outlines is not None  # noqa: S101 - it is round
    on_curved = curved(model)
    points, normals = model.outlines.points_m[on_curved], model.outlines.normals[on_curved]
    along = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    # the normals of a surface of revolution intersect the axis; residuals of fins and pods get little weight
    side = np.cross(along, normals)
    offset, weight = np.sum(side * points, axis=1), np.ones(len(points))
    for _ in range(IRLS_ITERATIONS):
        root = np.sqrt(weight)
        through = np.linalg.lstsq(side * root[:, None], offset * root, rcond=None)[0]
        weight = 1.0 / np.maximum(np.abs(side @ through - offset), MIN_RESIDUAL * model.radius_m)
    return along, through


def check_axial_symmetry(target: PreparedTarget, frame: Observation, selection: Selection) -> Selection:
    """Return the selection, or a better one whose pose is rotated about the symmetry axis.

    Windows and panels on a round wall cause local optima a few degrees of roll apart, too close to each other to count
    as ambiguous. The correct roll has a higher score even before refinement.
    """
    for _ in range(ROUNDS):
        other = _refine_rotation(target, frame, selection)
        if other is None:
            break
        selection = other
    return selection


def _refine_rotation(target: PreparedTarget, frame: Observation, selection: Selection) -> Optional[Selection]:
    """Refine the best of the rotated poses and return the new selection; None if its score is no better."""
    end, patch = selection.best, selection.close
    along, through = axis(target.model)
    middle = quat.matrix(end.q) @ through + end.t

    def score_at(angle_rad: float) -> Tuple[float, Array, Array]:
        q = quat.normalise(quat.multiply(end.q, quat.from_rotvec(angle_rad * along)))
        t = middle - quat.matrix(q) @ through
        return search_sun(target, patch, q, t, coarse=True).score, q, t

    initial_score = score_at(0.0)[0]
    score, q, t = max((score_at(a) for a in ROLLS_RAD), key=lambda r: r[0])
    frame.count("rolled", len(ROLLS_RAD) + 1)
    if not score > initial_score:
        return None
    start = Hypothesis(replace(end.pose, q=q, t=t), end.source, score, end.support)
    refined = refine_to_end(target, frame, patch, start)
    if not refined.score > end.score + SCORE_TOLERANCE:
        return None
    return select(target, patch, list(selection.ranked), [*selection.ends, refined])
