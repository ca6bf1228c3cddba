"""Check of axial symmetry: a round target against itself turned a little about its axis; windows and panels decide."""

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
from flyaround.hil.board.hybrid.refine.final import NO_WORSE, refine_to_end
from flyaround.hil.board.hybrid.refine.shadows import search_sun

Array = np.ndarray

# Iteratively reweighted least squares of the axis: iterations, and least residual [share of the radius].
REWEIGHTED, LITTLE = 10, 0.01

# Most repetitions: a better turn is the start of another check.
ROUNDS = 3

# Turns about the axis that are drawn [rad]: an alignment that starts 7 deg off mostly stays there.
ROLLS_RAD = tuple(float(np.radians(way * a)) for a in (2.0, 4.0, 6.0, 8.0, 10.0, 13.0) for way in (1, -1))


def axis(model: BoardModel) -> Tuple[Array, Array]:
    """Return a unit vector along a round target's axis, and a point on it [m], from its curved surfaces' normals."""
    assert model.outlines is not None  # noqa: S101 - it is round
    gentle = curved(model)
    points, normals = model.outlines.points_m[gentle], model.outlines.normals[gentle]
    along = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    # each normal's line meets the axis; those of fins and pods do not, and are down-weighted
    side = np.cross(along, normals)
    beside, weight = np.sum(side * points, axis=1), np.ones(len(points))
    for _ in range(REWEIGHTED):
        root = np.sqrt(weight)
        through = np.linalg.lstsq(side * root[:, None], beside * root, rcond=None)[0]
        weight = 1.0 / np.maximum(np.abs(side @ through - beside), LITTLE * model.radius_m)
    return along, through


def check_axial_symmetry(target: PreparedTarget, frame: Observation, selection: Selection) -> Selection:
    """Compare a selection with its pose turned about the axis of a round target, and return the better one.

    Windows and panels on a round wall make local minima every few degrees about the axis, too near each other to count
    as rivals. The right turn explains more of the image even before it is aligned.
    """
    for _ in range(ROUNDS):
        other = _better_turn(target, frame, selection)
        if other is None:
            break
        selection = other
    return selection


def _better_turn(target: PreparedTarget, frame: Observation, selection: Selection) -> Optional[Selection]:
    """Return the selection that the best turn about the axis leads to, or None if it is not better."""
    end, patch = selection.best, selection.close
    along, through = axis(target.model)
    middle = quat.matrix(end.q) @ through + end.t

    def turned(angle_rad: float) -> Tuple[float, Array, Array]:
        q = quat.normalise(quat.multiply(end.q, quat.from_rotvec(angle_rad * along)))
        t = middle - quat.matrix(q) @ through
        return search_sun(target, patch, q, t, coarse=True).score, q, t

    own = turned(0.0)[0]
    score, q, t = max((turned(a) for a in ROLLS_RAD), key=lambda r: r[0])
    frame.count("rolled", len(ROLLS_RAD) + 1)
    if not score > own:
        return None
    start = Hypothesis(replace(end.pose, q=q, t=t), end.source, score, end.support)
    led = refine_to_end(target, frame, patch, start)
    if not led.score > end.score + NO_WORSE:
        return None
    return select(target, patch, list(selection.ranked), [*selection.ends, led])
