"""Hypotheses of the keypoint network: its proposed poses, with the image edges of their region."""

from __future__ import annotations

from typing import List

from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.keypoints.keypoint_proposal import LearnedProposal

# Longest side of the edge field [px], and margin around the crop [share of the diagonal]; chosen by eye.
FIELD_PX, FIELD_MARGIN = 200, 0.05

# Minimum side of a region [px]: the estimator declines smaller targets anyway.
MIN_SIDE_PX = 24.0


def learned_hypotheses(
    target: PreparedTarget, frame: Observation, proposal: LearnedProposal
) -> List[Hypothesis]:
    """Return the hypotheses of one proposal, most likely first, without edge support."""
    region = proposal.region(target.camera)
    h, w = frame.image.shape
    x0, y0, x1, y1 = region.grown(FIELD_MARGIN, w, h)
    if min(x1 - x0, y1 - y0) < MIN_SIDE_PX:
        return []
    field = edge_field(
        frame.image,
        (x0, y0, x1, y1),
        frame.noise,
        FIELD_PX,
        background=frame.background,
        craft_probability=frame.craft_probability,
    )
    return [
        Hypothesis(PoseFit(q, t), Source(region, field, float(likely - proposal.log_likelihood[0])))
        for q, t, likely in zip(proposal.q, proposal.t, proposal.log_likelihood)  # noqa: B905 - Python 3.9 has no strict=
    ]
