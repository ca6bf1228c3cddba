"""The pose estimator: a picture in, a pose with its confidence out."""

from __future__ import annotations

from typing import List

import numpy as np

from hil.board.svd.base import Estimator
from hil.board.svd.confidence import ACCEPT_AT, confidence, decide
from hil.board.svd.edges import shrink
from hil.board.svd.finish import choose
from hil.board.svd.frame import Candidate, Craft, Frame, PoseResult
from hil.board.svd.gradient import eliminate_weak_gradients
from hil.board.svd.model import BoardModel, CameraIntrinsics
from hil.board.svd.noise import noise_sigma
from hil.board.svd.roi import REDUCTION, propose_regions
from hil.board.svd.search import search_region
from hil.board.svd.verify import choose_by_picture

Array = np.ndarray

# Share of the frame's tiles with edges above which the background is not empty space.
BUSY = 0.25

# Regions searched at most with a texture behind and with nothing, and the least diagonal of one [px].
REGIONS, EMPTY_REGIONS, SMALLEST_PX = 2, 3, 24.0


class PoseEstimator(Estimator):
    """Estimates the target's pose from single pictures; keeps nothing between them.

    Parameters
    ----------
    model : the target. camera : the intrinsics of every picture.
    accept_at : confidence at which a pose is accepted.
    """

    method = "svd"

    def __init__(self, model: BoardModel, camera: CameraIntrinsics, accept_at: float = ACCEPT_AT) -> None:
        super().__init__(model, camera)
        self.accept_at = accept_at
        self.craft = Craft.prepare(model, camera)

    def _estimate(self, frame: Frame) -> PoseResult:
        return self.initialise(frame)

    def initialise(self, frame: Frame) -> PoseResult:
        """The pose in one frame, without knowing any other."""
        image = frame.image
        # a 16-bit file may hold 10 or 12 bits: its own largest value is its scale
        full_scale = 255.0 if image.dtype == np.uint8 else float(image.max())
        frame.noise = max(noise_sigma(image, full_scale), 0.15 * full_scale / 255)
        small, _ = shrink(image, 0, 0, image.shape[1], image.shape[0], max(image.shape) // REDUCTION)
        frame.mark("prepare")
        wge = eliminate_weak_gradients(small)
        frame.keep("reduced", small)
        frame.keep("wge", wge)
        frame.mark("wge")
        regions, busy, frame.likely = propose_regions(small, wge, frame.noise / REDUCTION)
        if busy < BUSY:
            frame.background = float(np.median(small))
        frame.count("regions", len(regions))
        frame.keep("regions", regions)
        frame.mark("roi")
        found: List[Candidate] = []
        for region in regions[: REGIONS if frame.background < 0 else EMPTY_REGIONS]:
            if region.diagonal_px >= SMALLEST_PX:
                found += search_region(self.craft, frame, region)
        if not found:
            return PoseResult(
                False,
                "no target found",
                None,
                None,
                0.0,
                frame.stages_ms,
                frame.counts,
                method=self.method,
            )
        found.sort(key=lambda c: -c.support.total)
        frame.keep("found", found)
        decide_between = choose if self.model.faces is None else choose_by_picture
        best, fit, evidence, alternatives = decide_between(self.craft, frame, found)
        frame.count("edges", evidence.edges)
        frame.keep("field", best.field)
        reason = decide(evidence, self.accept_at)
        frame.mark("decide")
        return PoseResult(
            not reason,
            reason,
            fit.q,
            fit.t,
            confidence(evidence),
            frame.stages_ms,
            frame.counts,
            evidence,
            fit.covariance,
            alternatives,
            self.method,
        )
