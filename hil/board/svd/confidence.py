"""Accept or decline: how far the best pose stands out, how much of it was seen, how tightly it is held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional

import numpy as np

# Confidence from which a pose is accepted.
ACCEPT_AT = 0.85

# Weights of picture_confidence, in the order of its terms.
PICTURE_BIAS = -5.59
PICTURE_WEIGHTS = (1.64, 0.43, 0.67, 3.05, -0.5, -0.48, 0.97, 0.6)

# Score of the picture below which a pose is a guess, whatever its margin: right ones have 0.34 and more.
LEAST_SCORE = 0.25

# Likeness of the drawn craft below which a pose is wrong: right ones have 0.86 and more.
LEAST_LIKENESS = 0.82

# From which likeness, share explained where the craft covers the picture, and margin a pose in front of a texture is
# accepted for what the craft itself looks like, and how sure that is. Wrong ones had 0.93 at most where they explained
# as much (64 development frames).
LIKE, LIKE_COVERED, LIKE_MARGIN, LIKE_CONFIDENCE = 0.94, 0.4, 0.025, 0.9

# Below this size a speck fits any pose [px].
SMALLEST_PX = 70.0


@dataclass(frozen=True)
class Evidence:
    """What the decision is made from.

    Parameters
    ----------
    drawn, explained, outside : of the best pose, see score.Support.
    margin : its total score less the best *distinct* pose's.
    found, tight : share of visible samples with a sub-pixel edge, and with one very near.
    rms_px : of their residuals.
    sigma_rad, sigma_share : predicted one-sigma attitude error, and position error over range.
    edges : number of edge samples used. size_px : diameter of the craft's sphere on the picture.
    empty : whether the background is empty space.
    score : how well the drawn craft explains the picture, see photometric.photo_score; None where
        it was not judged so. likeness, covered : see photometric.photo_likeness.
    """

    drawn: float
    explained: float
    outside: float
    margin: float
    found: float
    tight: float
    rms_px: float
    sigma_rad: float
    sigma_share: float
    edges: int
    size_px: float
    empty: bool
    score: Optional[float] = None
    likeness: Optional[float] = None
    covered: float = 0.0

    @property
    def alike(self) -> bool:
        """Whether the craft itself looks so much like the picture that the clutter beside it need not agree."""
        if self.empty or self.likeness is None:
            return False
        return self.likeness >= LIKE and self.covered >= LIKE_COVERED and self.margin >= LIKE_MARGIN

    @property
    def unlike(self) -> bool:
        """Whether the drawn craft does not look like the picture."""
        return self.likeness is not None and self.likeness < LEAST_LIKENESS


def confidence(e: Evidence) -> float:
    """Probability-like figure 0..1 that the pose is right to 5 degrees and 5 % of range.

    A logistic fit on 200 rendered frames against black space (docs/svd.md); what it does not weigh (drawn,
    explained) bounds the decision instead.
    """
    if e.score is not None:
        sure = picture_confidence(e, e.score)
        return max(sure, LIKE_CONFIDENCE) if e.alike else min(sure, 0.5) if e.unlike else sure
    z = -2.3 + 38.0 * min(e.margin, 0.15) + 6.8 * e.tight
    z -= 22.0 * min(e.sigma_rad, 1.0) + 95.0 * min(e.sigma_share, 1.0) + 84.0 * min(e.outside, 0.3)
    # few samples can agree by chance
    z -= 0.1 * max(0, 50 - e.edges)
    # the weights were found against empty space, where lit area outside the silhouette convicts
    z -= 0.0 if e.empty else 1.5
    return float(1.0 / (1.0 + np.exp(-np.clip(z, -30, 30))))


def picture_confidence(e: Evidence, score: float) -> float:
    """The same where poses were judged by the whole picture: a logistic fit on development frames (docs/svd.md)."""
    z = PICTURE_BIAS + float(
        np.dot(
            PICTURE_WEIGHTS,
            [
                min(e.margin, 0.3) / 0.1,
                3.0 * min(max(e.margin / max(score, 0.02), 0.0), 1.0),
                3.0 * min(score, 0.8),
                3.0 * e.drawn,
                3.0 * e.explained,
                10.0 * min(e.outside, 0.3),
                np.log(max(e.size_px, 20.0) / 200.0),
                float(e.empty),
            ],
        )
    )
    return float(1.0 / (1.0 + np.exp(-np.clip(z, -30, 30))))


def decide(e: Evidence, accept_at: float = ACCEPT_AT) -> str:
    """Empty when the pose is to be accepted, else the reason it is not."""
    if e.edges < 25:
        return "too few edges found"
    if e.size_px < SMALLEST_PX:
        return "target too small in the picture"
    if e.score is None and (e.drawn < (0.35 if e.empty else 0.5) or e.found < 0.3):
        return "too little of the model is supported by edges"
    if e.score is not None and e.score < LEAST_SCORE and not e.alike:
        return "too little of the picture is explained"
    if e.margin < 0.015:
        return "ambiguous: another pose explains the picture as well"
    if confidence(e) < accept_at:
        return "confidence too low"
    return ""
