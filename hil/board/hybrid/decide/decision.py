"""The answer of ``hybrid``: a pose, its confidence, and whether its evidence makes it acceptable."""

from __future__ import annotations

from dataclasses import replace
from typing import Tuple

from flyaround.hil.board.estimation.result import Alternative, PoseResult
from flyaround.hil.board.hybrid.decide.confidence import ACCEPT_AT, Evidence, confidence, decide
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.observation import Observation


def decided(
    frame: Observation,
    pose: PoseFit,
    evidence: Evidence,
    alternatives: Tuple[Alternative, ...],
    accept_at: float = ACCEPT_AT,
    method: str = "",
) -> PoseResult:
    """A pose, and whether its evidence makes it to be accepted."""
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
        method,
    )


def reconsidered(result: PoseResult, evidence: Evidence, accept_at: float = ACCEPT_AT) -> PoseResult:
    """The same pose decided anew, by more evidence."""
    reason, sure = decide(evidence, accept_at), confidence(evidence)
    return replace(result, accepted=not reason, reason=reason, confidence=sure, evidence=evidence)
