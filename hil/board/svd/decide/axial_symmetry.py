"""An end of a round craft held against itself turned a little about its axis: windows and panels tell these apart."""

from __future__ import annotations

from typing import Optional, Tuple

import numpy as np

from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.image.observation import Observation
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.model.target_model import BoardModel
from hil.board.svd.model.view_tables import curved
from hil.board.svd.refine.final import NO_WORSE, Choice, conclude, finish
from hil.board.svd.refine.parallel import Ranked, faces_of
from hil.board.svd.refine.photometric import PhotoFit
from hil.board.svd.refine.shadows import shadowed

Array = np.ndarray

# The axis is found so many times with what lies beside it counting less, and what is no distance [share of radius].
REWEIGHTED, LITTLE = 10, 0.01

# So many times at most: one that led somewhere better is asked again from there.
ROUNDS = 3

# Turns about the axis that are drawn, each way [rad]: an alignment that starts 7 deg off mostly stays there.
ROLLS_RAD = tuple(float(np.radians(way * a)) for a in (2.0, 4.0, 6.0, 8.0, 10.0, 13.0) for way in (1, -1))


def axis(model: BoardModel) -> Tuple[Array, Array]:
    """Unit vector along the axis of a round craft, and a point on it [m]: what its curved surfaces' normals cross."""
    assert model.outlines is not None  # noqa: S101 - it is round
    some = curved(model)
    points, normals = model.outlines.points_m[some], model.outlines.normals[some]
    along = np.linalg.eigh(normals.T @ normals)[1][:, 0]
    # each normal's line meets it, so that the point lies in the plane of both; fins and pods have normals of their own
    side = np.cross(along, normals)
    beside, weight = np.sum(side * points, axis=1), np.ones(len(points))
    for _ in range(REWEIGHTED):
        root = np.sqrt(weight)
        through = np.linalg.lstsq(side * root[:, None], beside * root, rcond=None)[0]
        weight = 1.0 / np.maximum(np.abs(side @ through - beside), LITTLE * model.radius_m)
    return along, through


def check_rolled(craft: PreparedTarget, frame: Observation, choice: Choice) -> Choice:
    """A choice again beside its end turned about the craft's axis, where it is round.

    An alignment is held every few degrees by what is on the round wall: near minima that nothing else asked leads out
    of, and that are too near each other to be rivals. The right turn explains more even where it is not aligned: of
    Dragon's 81 accepted poses of 90 development frames (seed 8311) two were 7 deg about its axis; both come right.
    """
    if not craft.round:
        return choice
    for _ in range(ROUNDS):
        other = _better_turn(craft, frame, choice)
        if other is None:
            break
        choice = other
    return choice


def _better_turn(craft: PreparedTarget, frame: Observation, choice: Choice) -> Optional[Choice]:
    """The choice that another turn about the axis leads to, where it is a better one."""
    end, close, faces = choice.end, choice.close, faces_of(craft)
    along, through = axis(craft.model)
    middle = quat.matrix(end.fit.q) @ through + end.fit.t

    def turned(angle_rad: float) -> Tuple[float, Array, Array]:
        q = quat.normalise(quat.multiply(end.fit.q, quat.from_rotvec(angle_rad * along)))
        t = middle - quat.matrix(q) @ through
        return shadowed(craft, faces, close, q, t, coarse=True).score, q, t

    own = turned(0.0)[0]
    score, q, t = max((turned(a) for a in ROLLS_RAD), key=lambda r: r[0])
    frame.count("rolled", len(ROLLS_RAD) + 1)
    frame.mark("twins")
    if not score > own:
        return None
    there = PhotoFit(q, t, end.fit.cost, end.fit.covariance)
    led = finish(craft, frame, close, there)
    frame.mark("refine")
    if not led.score > end.score + NO_WORSE:
        return None
    c = choice.best
    start = Ranked(score, there, Candidate(q, t, c.support, c.field, c.region, c.likely))
    return conclude(craft, frame, close, choice.ranked, [*choice.starts, start], [*choice.ends, led])
