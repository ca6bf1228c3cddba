"""Hypotheses about another one: its near-symmetries and half turns, its neighbours, and its tilts."""

from __future__ import annotations

from dataclasses import replace
from typing import List

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget, faces_of
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.native.library import library

Array = np.ndarray

# Turns [deg, camera axes] and scales of the range at which an alignment by edges is started again.
NEIGHBOURS = (
    ((10.0, 0.0, 0.0), 1.0),
    ((-10.0, 0.0, 0.0), 1.0),
    ((0.0, 10.0, 0.0), 1.0),
    ((0.0, -10.0, 0.0), 1.0),
    ((0.0, 0.0, 0.0), 1.07),
    ((0.0, 0.0, 0.0), 0.93),
)

# Half turns about the model's x and y: a box upside down is a box.
HALF_TURNS = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

# Tilts about a pose, and how far: near minima of what is nearly flat lie 5 to 17 deg apart (docs/svd_results.md) [rad].
TILTS, TILT_RAD = 6, float(np.radians(12.0))


def neighbours(target: PreparedTarget, best: List[Hypothesis], share: float = 1.0) -> List[Hypothesis]:
    """Starts around good poses: edges lie in pairs, and an alignment may have locked on the wrong one."""
    out = []
    for h in best:
        centre = quat.matrix(h.q) @ target.centre_m + h.t
        for turn, scale in NEIGHBOURS:
            q = quat.normalise(quat.multiply(quat.from_rotvec(share * np.radians(turn)), h.q))
            out.append(h.at(q, centre * (1 + share * (scale - 1)) - quat.matrix(q) @ target.centre_m))
    return out


def near_symmetries(target: PreparedTarget, best: List[Hypothesis]) -> List[Hypothesis]:
    """The poses a target could be mistaken for: its near-symmetries, half turns, and the half turn of the image."""
    out = []
    for h in best:
        centre = quat.matrix(h.q) @ target.centre_m + h.t
        sight = np.concatenate([[0.0], centre / np.linalg.norm(centre)])
        others = [quat.multiply(h.q, s) for s in (*target.model.symmetry_wxyz, *HALF_TURNS)]
        for other in (*others, quat.multiply(sight, h.q)):
            q = quat.normalise(other)
            # the centre stays where it was seen
            out.append(h.at(q, centre - quat.matrix(q) @ target.centre_m))
    return out


def tilts(target: PreparedTarget, h: Hypothesis, lean_rad: float = TILT_RAD) -> List[Hypothesis]:
    """Poses tilted against one to every side, about axes across the line of sight; the centre stays in its place."""
    centre = quat.matrix(h.q) @ target.centre_m + h.t
    sight = centre / np.linalg.norm(centre)
    across = np.cross(sight, np.eye(3)[int(np.argmin(np.abs(sight)))])
    across /= np.linalg.norm(across)
    out = []
    for angle in 2 * np.pi * np.arange(TILTS) / TILTS:
        axis = np.cos(angle) * across + np.sin(angle) * np.cross(sight, across)
        q = quat.normalise(quat.multiply(quat.from_rotvec(lean_rad * axis), h.q))
        out.append(h.at(q, centre - quat.matrix(q) @ target.centre_m))
    return out


def over_its_image(
    target: PreparedTarget, patch: ImagePatch, variants: List[Hypothesis], held: Hypothesis
) -> List[Hypothesis]:
    """Poses moved across the line of sight until the middle of what they cover is where that of ``held`` is.

    A pose turned about the centre of the target's sphere lies beside the image where an antenna or a panel moves that
    centre off the middle of what is seen: by 27 px of 200 for a half turn of Tango, which then was never found.
    """
    middle = _middle(target, patch, held)
    out = []
    for h in variants:
        shift = middle - _middle(target, patch, h)
        depth = float((quat.matrix(h.q) @ target.centre_m + h.t)[2])
        across = np.array([shift[0] / target.camera.fx_px, shift[1] / target.camera.fy_px, 0.0]) * depth
        out.append(replace(h, pose=replace(h.pose, t=h.t + across)) if np.isfinite(across).all() else h)
    return out


def _middle(target: PreparedTarget, patch: ImagePatch, h: Hypothesis) -> Array:
    """(2,) middle of what a pose covers of the patch [image px]; NaN where that is nothing."""
    faces, R = faces_of(target), quat.matrix(h.q)
    seen = draw_faces(faces, order_faces(faces, -R.T @ h.t), target.camera.pinhole, R, h.t, patch)
    return np.asarray(_mean_pixel(seen) / patch.scale)


def _mean_pixel(seen: Array) -> Array:
    """(2,) mean column and row of the pixels that show the target; NaN where none does."""
    out = np.empty(2)
    return out if library().fly_mean_pixel(seen, *seen.shape, out) else np.full(2, np.nan)
