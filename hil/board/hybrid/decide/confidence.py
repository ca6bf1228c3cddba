"""Accept or decline: how far the best pose stands out, how much of it was seen, how tightly it is held."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.result import Alternative, PoseResult
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime

Array = np.ndarray

# Confidence from which a pose is accepted.
ACCEPT_AT = 0.93

# Bias and weights of ``terms``: a ridge logistic fit on development frames of Tango in orbit and in a laboratory and of
# five other craft (tools/studies/confidence_fit.py).
BIAS = -17.24
WEIGHTS = (1.0, -0.91, 5.48, 11.32, 1.65, -0.275, -1.64, -2.42, -23.0, 0.336, -0.08)

# Share of the craft that may be burnt out.
BURNT = 0.3

# Largest deficit of the network's log-likelihood that counts, and logit of a craft that is sure.
NETWORK_DEFICIT, NETWORK_SURE = 12.0, 10.0

# Margins of which one cannot say that they are any: by edges, and by the picture.
LEAST_MARGIN, LEAST_PICTURE_MARGIN = 0.015, 0.005

# Craft whose near-symmetries are told apart by the score alone; of others the margin must be this share of the score:
# half turns of round bodies differ by 4 % of it. The logit must be that much higher for them, and for a craft without a
# network.
TRIED, UNTRIED_MARGIN, UNTRIED, UNLOOKED = ("tango", "tango-mockup"), 0.1, 3.0, 2.0

# An accepted pose is held against its near minima where confidence is below this. A small margin alone is a twin's,
# which was followed to its end: of 57 frames of seeds 9701 and 9702 checked for that one came out elsewhere.
SURE = 0.97

# A share explained of what the craft covers below which that is what is wrong with a pose.
LITTLE = 0.3

# Factor on the covariance for a craft of so many pixels, and the power by which it grows with the size: what is not
# drawn is the same share of a craft of any size, and noise is less of a large one.
ERRORS, ERRORS_AT_PX, ERRORS_POWER = 0.32, 400.0, 1.2

# Standard deviations that the light of lamps adds, for the craft is not quite the model: rotation [rad], and position
# over range (tools/studies/confidence_fit.py).
LAMPS_SIGMA_RAD, LAMPS_SIGMA_SHARE = 0.014, 0.010

# The same of craft whose confidence was not fitted, for their surfaces and turns about their axes are held less well.
UNTRIED_SIGMA_RAD, UNTRIED_SIGMA_SHARE = 0.010, 0.005

# Fewer edge samples decide nothing; the least support by edges that a decision by edges alone takes: share of the
# model's length drawn before empty space and before a texture, and share of the samples found.
LEAST_EDGES, LEAST_DRAWN, LEAST_DRAWN_TEXTURED, LEAST_FOUND = 25, 0.35, 0.5, 0.3

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
    score : how well the drawn craft explains the picture, see photometric.explained; None where
        it was not judged so. likeness, covered : see photometric.likeness.
    tried : whether confidences were fitted on pictures of this craft. looked : whether it has a learned proposal.
    burnt : share of what the craft covers that is at the end of the scale.
    regime : the light of the image.
    network : log-likelihood of the pose by the network over that of its best. craft : its logit of a craft there.
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
    tried: bool = True
    looked: bool = True
    burnt: float = 0.0
    regime: Regime = Regime.SUNLIGHT
    network: float = 0.0
    craft: float = 0.0


def confidence(e: Evidence) -> float:
    """Probability-like figure 0..1 that the pose is right to 5 degrees and 5 % of range.

    A logistic fit on 200 rendered frames against black space (docs/lab/2026-11-estimator.md); what it does not
    weigh (drawn, explained) bounds the decision instead.
    """
    if e.score is not None:
        return picture_confidence(e, e.score)
    z = -2.3 + 38.0 * min(e.margin, 0.15) + 6.8 * e.tight
    z -= 22.0 * min(e.sigma_rad, 1.0) + 95.0 * min(e.sigma_share, 1.0) + 84.0 * min(e.outside, 0.3)
    # few samples can agree by chance
    z -= 0.1 * max(0, 50 - e.edges)
    # the weights were found against empty space, where lit area outside the silhouette convicts
    z -= 0.0 if e.empty else 1.5
    return float(1.0 / (1.0 + np.exp(-np.clip(z, -30, 30))))


def picture_confidence(e: Evidence, score: float) -> float:
    """Return the confidence in a pose that was judged by the whole image, 0 to 1."""
    z = BIAS + float(np.dot(WEIGHTS, terms(e, score)))
    z -= (0.0 if e.tried else UNTRIED) + (0.0 if e.looked else UNLOOKED)
    return float(1.0 / (1.0 + np.exp(-np.clip(z, -30, 30))))


def terms(e: Evidence, score: float) -> Array:
    """Return the terms that the weights are for; none has a unit of the image.

    Neither the scale of the image, nor the size of the craft, nor the noise but by what they do to the predicted error.
    """
    unlike = 1.0 - (0.0 if e.likeness is None else e.likeness)
    return np.array(
        [
            # share of the score by which the best other attitude is behind
            min(max(e.margin / max(score, 0.02), 0.0), 1.0),
            # likeness of the craft's interior, and the share explained of what it covers
            np.log(min(max(unlike, 0.003), 1.0)),
            e.covered,
            # edges
            e.drawn,
            e.explained,
            # predicted errors
            np.log(max(e.sigma_rad, 1e-4)),
            np.log(max(e.sigma_share, 1e-5)),
            # before empty space more is explained by any pose
            float(e.empty),
            # a craft that is burnt out shows nothing inside
            max(e.burnt - BURNT, 0.0),
            # the network
            max(e.network, -NETWORK_DEFICIT),
            min(e.craft, NETWORK_SURE),
        ]
    )


def scaled_covariance(e: Evidence, pose: PoseFit) -> Array:
    """Return the (6, 6) covariance of a pose that was judged by the whole image: rotation [rad], position [m]."""
    scale = ERRORS * (max(e.size_px, SMALLEST_PX) / ERRORS_AT_PX) ** ERRORS_POWER
    covariance = scale * pose.covariance
    range_m = float(np.linalg.norm(pose.t))
    for applies, turn, share in (
        (e.regime is Regime.LAMPS, LAMPS_SIGMA_RAD, LAMPS_SIGMA_SHARE),
        (not e.tried, UNTRIED_SIGMA_RAD, UNTRIED_SIGMA_SHARE),
    ):
        if applies:
            covariance = covariance + np.diag([turn**2] * 3 + [(share * range_m) ** 2] * 3)
    return np.asarray(covariance)


def doubtful(e: Evidence) -> bool:
    """Return True if a pose that may be accepted is to be held against its near minima first."""
    return confidence(e) < SURE


def least_margin(e: Evidence) -> float:
    """Margin below which another pose explains the picture as well."""
    if e.score is None:
        return LEAST_MARGIN
    return LEAST_PICTURE_MARGIN if e.tried else max(LEAST_PICTURE_MARGIN, UNTRIED_MARGIN * e.score)


def decide(e: Evidence, accept_at: float = ACCEPT_AT) -> str:
    """Return the reason a pose is declined; empty if it is accepted."""
    if e.edges < LEAST_EDGES:
        return "too few edges found"
    if e.size_px < SMALLEST_PX:
        return "target too small in the picture"
    if e.score is None and (
        e.drawn < (LEAST_DRAWN if e.empty else LEAST_DRAWN_TEXTURED) or e.found < LEAST_FOUND
    ):
        return "too little of the model is supported by edges"
    if e.margin < least_margin(e):
        return "ambiguous: another pose explains the picture as well"
    if confidence(e) < accept_at:
        little = e.score is not None and e.covered < LITTLE
        return "too little of the picture is explained" if little else "confidence too low"
    return ""


def decided(
    frame: Observation,
    pose: PoseFit,
    evidence: Evidence,
    alternatives: Tuple[Alternative, ...],
    accept_at: float = ACCEPT_AT,
) -> PoseResult:
    """Return a pose with its confidence, accepted if its evidence allows it."""
    reason = decide(evidence, accept_at)
    frame.mark("decision")
    return PoseResult(
        not reason,
        reason,
        pose.q,
        pose.t,
        confidence(evidence),
        frame.stages_ms,
        frame.counts,
        evidence,
        pose.covariance,
        alternatives,
    )
