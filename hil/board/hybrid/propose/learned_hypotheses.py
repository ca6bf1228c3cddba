"""Hypotheses of the learned proposal: at the places where it sees the target, and at many places and sizes about them.

The network takes what is lit for the target, which may be little of the whole. Of 41 frames before empty space whose
pose was lost (seed 9501) it had given 23 too small a size, by up to a half; shown the right place it proposed the right
attitude in all.
"""

from __future__ import annotations

from dataclasses import replace
from typing import List, Optional, Sequence, Tuple

import cv2
import numpy as np

from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.learned.learned_proposal import LearnedProposal, LearnedProposer
from flyaround.hil.board.hybrid.propose.learned.network_input import ImageCrop
from flyaround.hil.board.hybrid.propose.regions import REDUCTION

Array = np.ndarray

# Longest side of the edges that its poses are supported by [px], and the margin round them (share of the diagonal).
FIELD_PX, FIELD_MARGIN = 200, 0.05

# Least side of a place [px].
SMALLEST_PX = 24.0

# Where the target's sphere is looked for about the circle that holds all that is lit: its size, how far from the
# middle, and in how many directions; sizes and ways in diameters of the circle.
LIT_RINGS = (
    (1.12, 0.1, 5),
    (1.28, 0.06, 3),
    (1.28, 0.18, 7),
    (1.5, 0.08, 3),
    (1.5, 0.24, 8),
    (1.78, 0.12, 4),
)

# The same before a texture, about a place of the learned proposal, in diameters of its sphere: the size was 0.8 to 1.2
# of the true one in 22 of 27 lost frames (seed 9502), the middle off by 0.1 at most in 23.
TEXTURED_RINGS = ((0.87, 0.0, 1), (0.87, 0.09, 4), (1.0, 0.1, 5), (1.15, 0.0, 1), (1.15, 0.1, 5))

# Places that are looked at from four sides: of all, those that the network would correct least. Among 16 of 30 there
# was a right one in 70 of 72 frames before empty space, among 12 of 16 before a texture in 100 of 102 (seed 9702).
HELD, TEXTURED_HELD = 20, 13

# What is lit is not the target's alone where it is wider than a place of the learned proposal by this: of a target of
# which most lies in shadow the network sees a half.
ANOTHERS = 2.2

# A reduced pixel is lit from so many sigma above empty space.
LIT_SIGMA = 6.0


def learned_hypotheses(
    target: PreparedTarget, frame: Observation, proposal: LearnedProposal
) -> List[Hypothesis]:
    """Poses of one place, the likeliest first; their edges are not asked yet."""
    region = proposal.region(target.camera)
    h, w = frame.image.shape
    x0, y0, x1, y1 = region.grown(FIELD_MARGIN, w, h)
    if min(x1 - x0, y1 - y0) < SMALLEST_PX:
        return []
    field = edge_field(
        frame.image,
        (x0, y0, x1, y1),
        frame.noise,
        FIELD_PX,
        background=frame.background,
        likely=frame.likely,
    )
    return [
        Hypothesis(PoseFit(q, t), Source(region, field, float(likely - proposal.log_likely[0])))
        for q, t, likely in zip(proposal.q, proposal.t, proposal.log_likely)  # noqa: B905 - Python 3.9 has no strict=
    ]


def crops_about_lit(
    target: PreparedTarget, frame: Observation, reduced: Array, proposal: Optional[LearnedProposal] = None
) -> List[ImageCrop]:
    """Places and sizes at which the target's sphere holds all that is lit before empty space.

    Parameters
    ----------
    reduced : (h, w) the picture reduced by ``REDUCTION``. proposal : where light is the target's: what shines far from
        there, a limb in a corner, is another thing's.
    """
    lit = np.argwhere(reduced > frame.background + LIT_SIGMA * frame.noise / REDUCTION)[:, ::-1]
    if len(lit) < 3:
        return []
    (x, y), radius = cv2.minEnclosingCircle(lit.astype(np.float32))
    wide = radius if proposal is None else proposal.crop.diameter_px / REDUCTION
    if proposal is not None and 2 * radius > ANOTHERS * wide:
        u, v = target.camera.pixels(proposal.crop.direction) / REDUCTION
        near = lit[np.hypot(lit[:, 0] - u, lit[:, 1] - v) < wide]
        if len(near) >= 3:
            (x, y), radius = cv2.minEnclosingCircle(near.astype(np.float32))
    half = 0.5 * (REDUCTION - 1)
    middle = REDUCTION * x + half, REDUCTION * y + half
    return _rings(target, middle, REDUCTION * (2 * radius + 1), LIT_RINGS)


def crops_about(target: PreparedTarget, proposal: LearnedProposal) -> List[ImageCrop]:
    """Places and sizes about one of the learned proposal."""
    u, v = target.camera.pixels(proposal.crop.direction)
    return _rings(target, (float(u), float(v)), proposal.crop.diameter_px, TEXTURED_RINGS)


def _rings(
    target: PreparedTarget,
    middle: Tuple[float, float],
    size_px: float,
    rings: Sequence[Tuple[float, float, int]],
) -> List[ImageCrop]:
    out = []
    for k, (size, reach, number) in enumerate(rings):
        # every other ring is turned, so that their places do not lie in line
        for angle in 2 * np.pi * (np.arange(number) + 0.5 * (k % 2)) / number:
            x = middle[0] + reach * size_px * float(np.cos(angle))
            y = middle[1] + reach * size_px * float(np.sin(angle))
            out.append(ImageCrop.at(target.camera, x, y, size * size_px))
    return out


def hypotheses_of_places(
    target: PreparedTarget,
    frame: Observation,
    first: LearnedProposer,
    proposal: LearnedProposal,
    source: Source,
    reduced: Array,
) -> Tuple[List[Hypothesis], List[ImageCrop]]:
    """Hypotheses of the learned proposal at many places and sizes about what is seen, and the places.

    Parameters
    ----------
    proposal : of the surest place. source : whose edges and region the hypotheses are given.
    reduced : (h, w) the picture reduced by ``REDUCTION``.
    """
    empty = frame.background >= 0
    crops = crops_about_lit(target, frame, reduced, proposal) if empty else crops_about(target, proposal)
    if not crops:
        return [], []
    held = HELD if empty else TEXTURED_HELD
    found = [
        Hypothesis(PoseFit(q, t), replace(source, log_prior=0.0))
        for g in first.propose_at(
            frame.image, frame.noise, proposal.source, crops, held, reduced, frame.black
        )
        for q, t in zip(g.q, g.t)  # noqa: B905 - Python 3.9 has no strict=
    ]
    frame.count("sought", len(found))
    return found, crops
