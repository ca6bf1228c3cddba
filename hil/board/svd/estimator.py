"""The pose estimator: a picture in, a pose with its confidence out."""

from __future__ import annotations

from typing import Any, List

import cv2
import numpy as np

from hil.board.svd.confidence import ACCEPT_AT, confidence, decide
from hil.board.svd.edges import shrink
from hil.board.svd.finish import choose
from hil.board.svd.frame import Candidate, Craft, Frame, PoseResult
from hil.board.svd.gradient import eliminate_weak_gradients
from hil.board.svd.model import BoardModel, BoardModelError, CameraIntrinsics
from hil.board.svd.noise import noise_sigma
from hil.board.svd.roi import REDUCTION, propose_regions
from hil.board.svd.search import search_region

Array = np.ndarray

METHODS = ("svd",)

# Share of the frame's tiles with edges above which the background is not empty space.
BUSY = 0.25

# Regions searched at most, and the least diagonal of one [px].
REGIONS, SMALLEST_PX = 3, 24.0


class PoseEstimator:
    """Estimates the target's pose from single pictures; keeps nothing between them.

    Parameters
    ----------
    model : the target. camera : the intrinsics of every picture. method : one of ``METHODS``.
    accept_at : confidence at which a pose is accepted.

    Raises
    ------
    BoardModelError
        If the method is not known.
    """

    def __init__(
        self, model: BoardModel, camera: CameraIntrinsics, method: str = "svd", accept_at: float = ACCEPT_AT
    ) -> None:
        if method not in METHODS:
            raise BoardModelError(f"unknown method {method!r}: choose one of {', '.join(METHODS)}")
        self.model, self.camera, self.method, self.accept_at = model, camera, method, accept_at
        self.craft = Craft.prepare(model, camera)

    def estimate(self, image: Any) -> PoseResult:  # noqa: ANN401 - whatever a broken link may hand over
        """The pose in ``image``, or a decline with its reason; never raises on a bad picture.

        Parameters
        ----------
        image : (H, W) uint8 or uint16, the camera's size.
        """
        reason = self._unusable(image)
        if reason:
            return PoseResult(False, reason, None, None, 0.0)
        frame = Frame(image)
        try:
            return self._estimate(frame)
        except (cv2.error, np.linalg.LinAlgError, ValueError, IndexError, FloatingPointError) as error:
            # a board must go on to the next frame whatever this one held
            reason = f"internal: {error!r}"[:200]
            return PoseResult(False, reason, None, None, 0.0, frame.stages_ms, frame.counts)

    def _unusable(self, image: Any) -> str:  # noqa: ANN401 - see estimate
        if not isinstance(image, np.ndarray) or image.size == 0:
            return "no picture"
        if image.ndim != 2:
            return "not a single-channel picture"
        if image.dtype not in (np.uint8, np.uint16):
            return f"pixels must be uint8 or uint16, not {image.dtype}"
        if image.shape != (self.camera.height_px, self.camera.width_px):
            return (
                f"picture is {image.shape[1]} x {image.shape[0]}, "
                f"the camera {self.camera.width_px} x {self.camera.height_px}"
            )
        if min(image.shape) < 64:
            return "picture is too small"
        if int(image.max()) == int(image.min()):
            return "picture is constant"
        return ""

    def _estimate(self, frame: Frame) -> PoseResult:
        image = frame.image
        # a 16-bit file may hold 10 or 12 bits: its own largest value is its scale
        full_scale = 255.0 if image.dtype == np.uint8 else float(image.max())
        frame.noise = max(noise_sigma(image, full_scale), 0.15 * full_scale / 255)
        small, _ = shrink(image, 0, 0, image.shape[1], image.shape[0], max(image.shape) // REDUCTION)
        frame.mark("prepare")
        wge = eliminate_weak_gradients(small)
        frame.mark("wge")
        regions, busy = propose_regions(small, wge, frame.noise / REDUCTION)
        if busy < BUSY:
            frame.background = float(np.median(small))
        frame.count("regions", len(regions))
        frame.mark("roi")
        found: List[Candidate] = []
        for region in regions[:REGIONS]:
            if region.diagonal_px >= SMALLEST_PX:
                found += search_region(self.craft, frame, region)
        if not found:
            return PoseResult(False, "no target found", None, None, 0.0, frame.stages_ms, frame.counts)
        found.sort(key=lambda c: -c.support.total)
        _, fit, evidence = choose(self.craft, frame, found)
        frame.count("edges", evidence.edges)
        reason = decide(evidence, self.accept_at)
        frame.mark("decide")
        return PoseResult(
            not reason, reason, fit.q, fit.t, confidence(evidence), frame.stages_ms, frame.counts, evidence
        )
