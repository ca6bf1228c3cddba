"""Output of the keypoint network: its keypoints, and the bins of their distributions."""

from __future__ import annotations

import numpy as np

from flyaround.hil.board.estimation.target_model import BoardModel

Array = np.ndarray

# Keypoints of a target, and bins along each axis of the input.
KEYPOINTS, BINS = 24, 160

# Half width of the binned range [half sides of the input]: keypoints outside the crop are located as well.
HALF_RANGE = 1.25

# Width of a bin [half sides].
BIN_WIDTH = 2 * HALF_RANGE / BINS


def keypoints_m(model: BoardModel) -> Array:
    """Return the points of a target that the network locates.

    Returns
    -------
    (KEYPOINTS, 3) array
        Points in the target frame [m]: the model's keypoints in their order, then ends of wireframe edges by
        farthest-point sampling (Gonzalez 1985).
    """
    points = np.array(list(model.keypoints.values()), float).reshape(-1, 3)[:KEYPOINTS]
    if not len(points):
        points = model.ends_m[:1]
    while len(points) < KEYPOINTS:
        distance = np.linalg.norm(model.ends_m[:, None] - points[None], axis=-1).min(axis=1)
        points = np.vstack([points, model.ends_m[int(np.argmax(distance))]])
    return points
