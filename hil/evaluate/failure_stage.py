"""Cause of a missed pose: the first stage of the estimator that lost it, according to the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.hil.board.hybrid.hypotheses.edge_support import support
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.model.visibility import visible_samples
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE, frame_errors
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_multiply,
    quat_normalize,
    rotation_angle_rad,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from flyaround.hil.board.estimation import PoseResult
    from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
    from flyaround.hil.board.svd.region_of_interest import Region

# Stages in order.
KINDS = ("region", "edges", "ambiguity", "correspondence")

# Minimum share of the true box that a useful region contains (the published one cuts off 2.5 % on each side by
# definition, and the tips of antennas), and its largest area [true boxes].
MIN_BOX_SHARE, MAX_BOX_RATIO = 0.5, 8.0

# Minimum share of the visible model edges with an image edge at the true pose. With fewer, the image lacks the edges; a
# higher share blames the image for faults of the search.
MIN_EDGE_SHARE = 0.35

# Margin of the edge field around the box: a constant [px] for the gradient's filters, and a share of the box's width
# plus height for edges beside the mask.
MARGIN_PX, MARGIN_SHARE = 8.0, 0.1

# Smallest side of the edge field [px], the width of the gradient's filters, and samples of the model's edges below
# which a share says nothing.
MIN_FIELD_PX, MIN_SAMPLES = 16, 8

# Longest side of the edge field [px], that of the estimator's fine field.
EDGE_FIELD_PX = 360


def failure_kind(
    image: NDArray[Any],
    box_px: tuple[float, float, float, float] | None,
    q_true: Sequence[float],
    t_true: Sequence[float],
    result: PoseResult,
    regions: Sequence[Region],
    craft: PreparedTarget,
    noise: float,
) -> str:
    """Return the element of ``KINDS`` for a frame whose best pose is not coarse.

    Parameters
    ----------
    image : (H, W) array
        Image.
    box_px : tuple of float or None
        Bounding box of the visible mask: x0, y0, x1, y1.
    q_true : sequence of float
        True attitude quaternion, camera from target.
    t_true : sequence of float
        True target position, camera frame [m].
    result : PoseResult
        Result of the estimator.
    regions : sequence of Region
        Regions of the estimator; if empty, the stage is not considered.
    craft : PreparedTarget
        Target with its precomputed tables.
    noise : float
        Standard deviation of the image noise.

    Notes
    -----
    region: no region contains the target. edges: too few model edges have an image edge at the true pose. ambiguity:
    the correct pose is among the alternatives, or the answer is a near-symmetry. correspondence: image edges are
    present, but no hypothesis led to them.
    """
    if regions and box_px is not None and not any(_is_useful(r, box_px) for r in regions):
        return "region"
    q, t = quat_normalize(q_true), np.asarray(t_true, float)
    if box_px is not None and _edge_share(image, box_px, q, t, craft, noise) < MIN_EDGE_SHARE:
        return "edges"
    for a in result.alternatives:
        if _is_coarse(q, t, a.q_camera_from_target_wxyz, a.t_camera_from_target_m):
            return "ambiguity"
    if result.q_camera_from_target_wxyz is not None and result.t_camera_from_target_m is not None:
        for s in craft.model.symmetry_wxyz:
            twin = quat_multiply(result.q_camera_from_target_wxyz, s)
            angle_deg = np.degrees(rotation_angle_rad(twin, q))
            shift = np.linalg.norm(result.t_camera_from_target_m - t) / np.linalg.norm(t)
            if angle_deg < 2 * COARSE_DEG and shift < 2 * COARSE_SHARE:
                return "ambiguity"
    return "correspondence"


def _is_useful(region: Region, box: tuple[float, float, float, float]) -> bool:
    w = max(0.0, min(region.x1, box[2]) - max(region.x0, box[0]))
    h = max(0.0, min(region.y1, box[3]) - max(region.y0, box[1]))
    true = max((box[2] - box[0]) * (box[3] - box[1]), 1.0)
    area = max((region.x1 - region.x0) * (region.y1 - region.y0), 1.0)
    return w * h / true >= MIN_BOX_SHARE and area / true <= MAX_BOX_RATIO


def _edge_share(
    image: NDArray[Any],
    box: tuple[float, float, float, float],
    q: NDArray[np.float64],
    t: NDArray[np.float64],
    craft: PreparedTarget,
    noise: float,
) -> float:
    """Return the share of the visible model edges with an image edge at the true pose."""
    h, w = image.shape
    m = MARGIN_PX + MARGIN_SHARE * (box[2] - box[0] + box[3] - box[1])
    x0, y0 = max(0, int(box[0] - m)), max(0, int(box[1] - m))
    x1, y1 = min(w, int(box[2] + m)), min(h, int(box[3] + m))
    if min(x1 - x0, y1 - y0) < MIN_FIELD_PX:
        return 0.0
    R = matrix_from_quat(q)
    if visible_samples(craft.samples, craft.occ, -R.T @ t)[0].sum() < MIN_SAMPLES:
        return 0.0
    field = edge_field(image, (x0, y0, x1, y1), noise, EDGE_FIELD_PX)
    return support(craft, q, t, field).drawn


def _is_coarse(q: NDArray[np.float64], t: NDArray[np.float64], q2: Any, t2: Any) -> bool:  # noqa: ANN401 - arrays
    _, e_t, E_R = frame_errors(q, t, q2, t2)
    return E_R <= COARSE_DEG and e_t <= COARSE_SHARE
