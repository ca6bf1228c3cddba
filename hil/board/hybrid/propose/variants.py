"""Variants of a hypothesis: near-symmetries, half turns, and neighbours."""

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

# Rotations [deg, camera axes] and range factors at which edge alignment restarts; hand-tuned.
NEIGHBOURS = (
    ((10.0, 0.0, 0.0), 1.0),
    ((-10.0, 0.0, 0.0), 1.0),
    ((0.0, 10.0, 0.0), 1.0),
    ((0.0, -10.0, 0.0), 1.0),
    ((0.0, 0.0, 0.0), 1.07),
    ((0.0, 0.0, 0.0), 0.93),
)

# Half turns about the model's x and y axes, near-symmetries of a box.
HALF_TURNS = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def neighbours(target: PreparedTarget, best: List[Hypothesis], share: float = 1.0) -> List[Hypothesis]:
    """Return poses around good ones. Edges come in pairs, and alignment may have locked on the wrong edge of a pair.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    best : list of Hypothesis
        Aligned poses.
    share : float
        Factor on the rotations and range changes of ``NEIGHBOURS``.
    """
    out = []
    for h in best:
        centre = quat.matrix(h.q) @ target.centre_m + h.t
        for turn, scale in NEIGHBOURS:
            q = quat.normalise(quat.multiply(quat.from_rotvec(share * np.radians(turn)), h.q))
            out.append(h.at(q, centre * (1 + share * (scale - 1)) - quat.matrix(q) @ target.centre_m))
    return out


def near_symmetries(target: PreparedTarget, best: List[Hypothesis]) -> List[Hypothesis]:
    """Return near-symmetries of good poses, half turns, and half turns about the line of sight."""
    out = []
    for h in best:
        centre = quat.matrix(h.q) @ target.centre_m + h.t
        sight = np.concatenate([[0.0], centre / np.linalg.norm(centre)])
        attitudes = [quat.multiply(h.q, s) for s in (*target.model.symmetry_wxyz, *HALF_TURNS)]
        for other in (*attitudes, quat.multiply(sight, h.q)):
            q = quat.normalise(other)
            # keep the centre in place
            out.append(h.at(q, centre - quat.matrix(q) @ target.centre_m))
    return out


def align_centroids(
    target: PreparedTarget, patch: ImagePatch, variants: List[Hypothesis], reference: Hypothesis
) -> List[Hypothesis]:
    """Return poses shifted across the line of sight until their silhouettes' centroids match that of ``reference``.

    A rotation about the centre of the bounding sphere displaces the silhouette if an antenna or a panel is on one side.
    """
    middle = _silhouette_centroid(target, patch, reference)
    out = []
    for h in variants:
        shift = middle - _silhouette_centroid(target, patch, h)
        depth = float((quat.matrix(h.q) @ target.centre_m + h.t)[2])
        across = np.array([shift[0] / target.camera.fx_px, shift[1] / target.camera.fy_px, 0.0]) * depth
        out.append(replace(h, pose=replace(h.pose, t=h.t + across)) if np.isfinite(across).all() else h)
    return out


def _silhouette_centroid(target: PreparedTarget, patch: ImagePatch, h: Hypothesis) -> Array:
    """Return the centroid (2,) of the silhouette on the patch [image px]; NaN if it is empty."""
    faces, R = faces_of(target), quat.matrix(h.q)
    faces_seen = draw_faces(faces, order_faces(faces, -R.T @ h.t), target.camera.pinhole, R, h.t, patch)
    return np.asarray(_mean_pixel(faces_seen) / patch.scale)


def _mean_pixel(pixels: Array) -> Array:
    """Return the mean column and row (2,) of the pixels that show the target; NaN if none does."""
    out = np.empty(2)
    return out if library().fly_mean_pixel(pixels, *pixels.shape, out) else np.full(2, np.nan)
