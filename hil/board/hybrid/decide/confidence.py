"""Confidence in a pose, its covariance, and the decision to accept it.

The confidence is a logistic function of the evidence. Thresholds without a source are hand-tuned on development frames
(docs/lab/2026-11-estimator.md, Decision).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.result import Alternative, PoseResult
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.propose.keypoints.calibration import Calibration

Array = np.ndarray

# Confidence from which a pose is accepted. Of 600 held-out frames, 0.9 accepted one wrong pose and 0.93 none
# (docs/lab/2026-11-estimator.md).
ACCEPT_AT = 0.93

# Bias and weights of ``terms``: a ridge logistic fit on development frames of Tango in orbit and in a laboratory and of
# five other craft (tools/studies/confidence_fit.py). The weight of the saturated share was fitted again on overexposed
# flights and frames in orbit, with the others fixed (docs/lab/2026-12-confidence.md).
BIAS = -17.24
WEIGHTS = (1.0, -0.91, 5.48, 11.32, 1.65, -0.275, -1.64, -2.42, -15.0, 0.336, -0.08)

# Saturated share of the craft above which the confidence falls, because a saturated surface shows no detail.
MAX_SATURATED_SHARE = 0.3

# Limits of the network's terms: maximum deficit of its log-likelihood, and maximum logit of the presence score.
MAX_NETWORK_TERM_DEFICIT, MAX_NETWORK_LOGIT = 12.0, 10.0

# Minimum score margin over the best distinct pose: by edges only, and by the whole image.
MIN_MARGIN, MIN_IMAGE_MARGIN = 0.015, 0.005

# Craft on which the confidence was fitted. Others are accepted more strictly: their margin must be at least
# UNFITTED_MARGIN of the score, because half turns of round bodies differ by 4 % of it.
FITTED_CRAFT = ("tango", "tango-mockup")
UNFITTED_MARGIN = 0.1

# Calibration of the craft on which the confidence was fitted, of others whose network's file has none, and of those
# without a network.
FITTED = Calibration((BIAS, *WEIGHTS))
UNCALIBRATED, WITHOUT_NETWORK = Calibration((BIAS - 2.0, *WEIGHTS)), Calibration((BIAS - 5.0, *WEIGHTS))

# The logit of a calibrated confidence is at most that by the common weights minus this number
# (docs/lab/2026-11-keypoint-network.md, Calibration).
BOUND_OFFSET = 1.0

# Explained share of the craft's area below which the reason of a declined pose is the unexplained image.
MIN_EXPLAINED_AREA = 0.3

# Factor of the covariance at a reference size, and the power by which the factor grows with the size [px]. Model errors
# are a fixed share of the craft's size, so for a large craft they exceed the effect of noise.
COVARIANCE_FACTOR, COVARIANCE_SIZE_PX, COVARIANCE_POWER = 0.32, 400.0, 1.2

# Standard deviations added under lamps, because a mock-up differs from its model: rotation [rad], and position over
# range (tools/studies/confidence_fit.py).
LAMPS_SIGMA_RAD, LAMPS_SIGMA_SHARE = 0.014, 0.010

# Standard deviations added for craft other than FITTED_CRAFT, whose surfaces and roll angles are less well determined.
UNFITTED_SIGMA_RAD, UNFITTED_SIGMA_SHARE = 0.010, 0.005

# Minimum number of edge samples of any decision. For a decision by edges only: minimum share of the model's length with
# an edge, in front of empty space and of a texture, and minimum share of samples with an edge.
MIN_EDGES, MIN_DRAWN, MIN_DRAWN_TEXTURED, MIN_MATCHED = 25, 0.35, 0.5, 0.3

# Minimum diameter of the target's bounding sphere [px]: a smaller image fits any pose.
MIN_SIZE_PX = 70.0


@dataclass(frozen=True)
class Evidence:
    """Evidence for the decision on a pose.

    Parameters
    ----------
    drawn : float
        Share of the visible model edges, by length, with an image edge nearby.
    explained : float
        Share of the image edges that the model explains.
    outside : float
        Share of the lit pixels outside the model's silhouette.
    margin : float
        Score of the pose minus that of the best distinct pose.
    matched_share : float
        Share of the visible samples with a sub-pixel edge.
    tight : float
        Share of the visible samples whose sub-pixel edge is very close.
    rms_px : float
        RMS residual of the samples with a sub-pixel edge [px].
    sigma_rad : float
        Predicted one-sigma error of the attitude [rad].
    sigma_share : float
        Predicted one-sigma error of the position over range.
    edges : int
        Number of edge samples.
    size_px : float
        Diameter of the target's bounding sphere in the image [px].
    empty : bool
        True if the background is empty space.
    score : float, optional
        Share of the image explained by the rendered target (``photometric.explained``); None for a decision by edges
        only.
    likeness : float, optional
        Correlation of the rendered target with the image, -1..1 (``photometric.likeness``).
    covered : float
        Score restricted to the target's own pixels (``photometric.likeness``).
    fitted : bool
        True if the confidence was fitted on this target.
    calibration : Calibration
        Calibration of the target.
    saturated : float
        Saturated share of the target's pixels.
    lamps : bool
        True if the image has a black level, as cameras in a laboratory have and smoothed images seem to have.
    network : float
        Log-likelihood of the pose by the network, relative to the maximum over poses.
    craft : float
        Logit of the network's presence score.
    """

    drawn: float
    explained: float
    outside: float
    margin: float
    matched_share: float
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
    fitted: bool = True
    calibration: Calibration = FITTED
    saturated: float = 0.0
    lamps: bool = False
    network: float = 0.0
    craft: float = 0.0


def confidence(e: Evidence) -> float:
    """Return the estimated probability that a pose is right within 5 degrees and 5 % of the range.

    For a target without faces it is a logistic fit on rendered frames in front of empty space
    (docs/lab/2026-11-estimator.md). Terms without a weight (drawn, explained) have thresholds in `decide` instead.
    """
    if e.score is not None:
        regressors = np.concatenate([[1.0], terms(e, e.score)])
        z = float(np.dot(e.calibration.weights, regressors))
        if e.calibration.frames:
            # weights of few frames extrapolate boldly
            z = min(z, float(np.dot(FITTED.weights, regressors)) - BOUND_OFFSET)
    else:
        z = -2.3 + 38.0 * min(e.margin, 0.15) + 6.8 * e.tight
        z -= 22.0 * min(e.sigma_rad, 1.0) + 95.0 * min(e.sigma_share, 1.0) + 84.0 * min(e.outside, 0.3)
        # few samples can agree by chance
        z -= 0.1 * max(0, 50 - e.edges)
        # the weights were fitted in front of empty space, where lit pixels outside the silhouette contradict a pose
        z -= 0.0 if e.empty else 1.5
    return float(1.0 / (1.0 + np.exp(-np.clip(z, -30, 30))))


def terms(e: Evidence, score: float) -> Array:
    """Return the regressors of the confidence.

    They do not depend on image scale, target size or noise, except through the predicted errors.

    Returns
    -------
    (11,) array
        Regressors in the order of ``WEIGHTS``.
    """
    unlike = 1.0 - (0.0 if e.likeness is None else e.likeness)
    return np.array(
        [
            # margin over the best distinct pose relative to the score
            min(max(e.margin / max(score, 0.02), 0.0), 1.0),
            # likeness, and explained share of the target's area
            np.log(min(max(unlike, 0.003), 1.0)),
            e.covered,
            # edges
            e.drawn,
            e.explained,
            # predicted errors
            np.log(max(e.sigma_rad, 1e-4)),
            np.log(max(e.sigma_share, 1e-5)),
            # in front of empty space any pose explains more
            float(e.empty),
            # a saturated surface shows no detail
            max(e.saturated - MAX_SATURATED_SHARE, 0.0),
            # the network
            max(e.network, -MAX_NETWORK_TERM_DEFICIT),
            min(e.craft, MAX_NETWORK_LOGIT),
        ]
    )


def scaled_covariance(e: Evidence, pose: PoseFit) -> Array:
    """Return the (6, 6) covariance of a pose scored by the whole image: rotation [rad], position [m]."""
    scale = COVARIANCE_FACTOR * (max(e.size_px, MIN_SIZE_PX) / COVARIANCE_SIZE_PX) ** COVARIANCE_POWER
    covariance = scale * pose.covariance
    range_m = float(np.linalg.norm(pose.t))
    for applies, turn, share in (
        (e.lamps, LAMPS_SIGMA_RAD, LAMPS_SIGMA_SHARE),
        (not e.fitted, UNFITTED_SIGMA_RAD, UNFITTED_SIGMA_SHARE),
    ):
        if applies:
            covariance = covariance + np.diag([turn**2] * 3 + [(share * range_m) ** 2] * 3)
    return np.asarray(e.calibration.covariance_factor * covariance)


def min_margin(e: Evidence) -> float:
    """Return the margin below which another pose explains the image equally well."""
    if e.score is None:
        return MIN_MARGIN
    return MIN_IMAGE_MARGIN if e.fitted else max(MIN_IMAGE_MARGIN, UNFITTED_MARGIN * e.score)


def decide(e: Evidence) -> str:
    """Decide on a pose.

    Returns
    -------
    str
        Reason why the pose is declined; empty if it is accepted.
    """
    if e.edges < MIN_EDGES:
        return "too few edges found"
    if e.size_px < MIN_SIZE_PX:
        return "target too small in the picture"
    if e.score is None and (
        e.drawn < (MIN_DRAWN if e.empty else MIN_DRAWN_TEXTURED) or e.matched_share < MIN_MATCHED
    ):
        return "too little of the model is supported by edges"
    if e.margin < min_margin(e):
        return "ambiguous: another pose explains the picture as well"
    if confidence(e) < ACCEPT_AT:
        unexplained = e.score is not None and e.covered < MIN_EXPLAINED_AREA
        return "too little of the picture is explained" if unexplained else "confidence too low"
    return ""


def decided(
    frame: Observation, pose: PoseFit, evidence: Evidence, alternatives: Tuple[Alternative, ...]
) -> PoseResult:
    """Return the estimator's result for a pose, accepted if its evidence is sufficient."""
    reason = decide(evidence)
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
