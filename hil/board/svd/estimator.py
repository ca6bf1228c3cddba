"""The pose estimator: a picture in, a pose with its confidence out."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import List, Sequence, Tuple, Union

import numpy as np

from hil.board.svd.base import Estimator, PoseResult
from hil.board.svd.decide.axial_symmetry import check_rolled
from hil.board.svd.decide.confidence import ACCEPT_AT, TRIED, Evidence, doubtful, error_scale
from hil.board.svd.decide.discrete_symmetry import check_turned
from hil.board.svd.decide.selection import (
    ALL_LEADERS,
    LEADERS,
    align_leaders,
    check_leaning,
    choose_by_picture,
)
from hil.board.svd.geometry.camera import CameraIntrinsics
from hil.board.svd.hypotheses.ambiguity import Alternative
from hil.board.svd.hypotheses.hypothesis import UNASKED, Candidate
from hil.board.svd.image.edge_field import edge_field, shrink
from hil.board.svd.image.noise import noise_sigma, whole_median
from hil.board.svd.image.observation import Observation
from hil.board.svd.image.region import Region
from hil.board.svd.image.weak_gradients import eliminate_weak_gradients
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.model.target_model import BoardModel
from hil.board.svd.propose.edge_search import search_region
from hil.board.svd.propose.learned.learned_proposal import LearnedProposal, LearnedProposer
from hil.board.svd.propose.multi_scale import align_wide
from hil.board.svd.propose.perceptual_groups import model_triads
from hil.board.svd.propose.regions import REDUCTION, propose_regions
from hil.board.svd.refine.edges import FineFit
from hil.board.svd.refine.final import Choice, no_clearer
from hil.board.svd.refine.final_edges import choose
from hil.board.svd.refine.parallel import Ranked
from hil.board.svd.refine.photometric import PhotoFit
from hil.board.svd.refine.synthetic_view import draw_at

Array = np.ndarray
Chosen = Tuple[Candidate, Union[FineFit, PhotoFit], Evidence, Tuple[Alternative, ...]]

# Share of the frame's tiles with edges above which the background is not empty space.
BUSY = 0.25

# Regions glanced at by the learned proposal, and places it hands on with a texture behind and with nothing.
GLANCES, LOOKS, EMPTY_LOOKS = 5, 2, 1

# Logit of there being a craft from which its edges are not searched: what the picture cannot settle, they cannot.
SURE = 2.0

# Longest side of the edges that its poses are supported by [px].
LOOK_FIELD_PX = 200

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
        self.craft = PreparedTarget.prepare(model, camera)
        self.figures = model_triads(self.craft.model)
        self.first = LearnedProposer.prepare(model, camera)
        self.tried = self.first is not None and model.name in TRIED

    def _estimate(self, frame: Observation) -> PoseResult:
        return self.initialise(frame)

    def initialise(self, frame: Observation) -> PoseResult:
        """The pose in one frame, without knowing any other: by the learned proposal, then by edges."""
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
            # reduced pixels are whole numbers as well
            frame.background = whole_median(small.astype(np.int32))
        frame.count("regions", len(regions))
        frame.keep("regions", regions)
        frame.mark("roi")
        regions = [r for r in regions if r.diagonal_px >= SMALLEST_PX]
        learned = self._learned(frame, regions, small)
        found = [c for g in learned for c in self._candidates(frame, g)]
        frame.keep("learned_proposals", learned)
        frame.mark("learned_proposal")
        looked = self._chosen(frame, found, learned) if found else None
        if looked is not None and not looked.accepted and self.first is not None:
            # poses of many places about what is seen, then those that the look named, with shadows
            wide = align_wide(self.craft, frame, self.first, learned[0], found[0], small)
            again = self._chosen(frame, list(found), learned, thorough=True, beside=wide)
            # edges besides would double the time: of 211 frames they set 8 right, and had a wrong pose accepted
            looked = max(looked, again, key=_confidence)
        if looked is not None and (looked.accepted or self.first is not None):
            if frame.shows_all and regions:
                search_region(self.craft, self.figures, frame, regions[0])
            return looked
        # what the look is sure of is where it is: there edges find the attitudes that it does not
        sure = [g.source for g in learned if g.craft > SURE]
        some = sure[:1] or regions[: REGIONS if frame.background < 0 else EMPTY_REGIONS]
        frame.count("searched", 1)
        found = [c for region in some for c in search_region(self.craft, self.figures, frame, region)]
        if found:
            searched = self._chosen(frame, found, learned, thorough=True)
            # not by what they explain: the two were judged on different cuts of the picture
            looked = searched if looked is None else max(looked, searched, key=_confidence)
        return self._declined(frame, "no target found") if looked is None else looked

    def _learned(self, frame: Observation, regions: List[Region], reduced: Array) -> List[LearnedProposal]:
        """What the learned proposal says of the likeliest places; nothing where the target has none."""
        if self.first is None:
            return []
        keep = LOOKS if frame.background < 0 else EMPTY_LOOKS
        return self.first.propose(frame.image, frame.noise, regions[:GLANCES], keep, reduced)

    def _candidates(self, frame: Observation, proposal: LearnedProposal) -> List[Candidate]:
        """Poses of a proposal, the likeliest first, and the edges of its place for who wants to ask them."""
        region = proposal.region(self.craft.camera)
        h, w = frame.image.shape
        x0, y0, x1, y1 = region.grown(0.05, w, h)
        if min(x1 - x0, y1 - y0) < SMALLEST_PX:
            return []
        field = edge_field(
            frame.image,
            (x0, y0, x1, y1),
            frame.noise,
            LOOK_FIELD_PX,
            background=frame.background,
            likely=frame.likely,
        )
        return [
            Candidate(q, t, UNASKED, field, region, float(likely - proposal.log_likely[0]))
            for q, t, likely in zip(proposal.q, proposal.t, proposal.log_likely)  # noqa: B905 - Python 3.9 has no strict=
        ]

    def _chosen(
        self,
        frame: Observation,
        found: List[Candidate],
        learned: Sequence[LearnedProposal],
        *,
        thorough: bool = False,
        beside: Sequence[Ranked] = (),
    ) -> PoseResult:
        """The best of the candidates, and whether it is to be accepted; ``beside`` are poses aligned already."""
        found.sort(key=lambda c: -c.support.total)
        frame.keep("found", found)
        if self.model.faces is None:
            return self._told(frame, choose(self.craft, frame, found))
        choice = self._compared(frame, found, beside, thorough=thorough)
        if not self.tried:
            choice = self._turned(frame, check_rolled(self.craft, frame, choice), learned)
        result = self._told(frame, _all_of(choice))
        if thorough or not result.accepted or not doubtful(choice.evidence):
            return result
        frame.count("checked", 1)
        return self._told(frame, _all_of(self._held_against_near_minima(frame, choice, learned)))

    def _compared(
        self, frame: Observation, found: List[Candidate], beside: Sequence[Ranked], *, thorough: bool
    ) -> Choice:
        """The best of the candidates and of poses aligned already, by the picture alone."""
        keep = ALL_LEADERS if thorough else LEADERS
        leaders = align_leaders(self.craft, frame, found, keep, shadows=thorough)
        leaders = sorted([*leaders, *beside], key=lambda r: -r.score)
        return choose_by_picture(self.craft, frame, leaders, thorough=thorough)

    def _turned(self, frame: Observation, choice: Choice, learned: Sequence[LearnedProposal]) -> Choice:
        """The same held against its near-symmetries, about which the learned proposal is heard where there is one.

        Of a round craft a few small parts say which way round it is, and confidence was not fitted on them.
        """
        first = self.first if learned else None
        prior = None if first is None else partial(first.log_likelihood, learned)
        return check_turned(self.craft, frame, choice, prior)

    def _held_against_near_minima(
        self, frame: Observation, choice: Choice, learned: Sequence[LearnedProposal]
    ) -> Choice:
        """A doubtful choice beside poses that lean about it; of an untried craft the last word is its half turns'."""
        if self.tried:
            return check_leaning(self.craft, frame, choice)
        leant = check_leaning(self.craft, frame, choice, symmetries=False)
        if leant.end is choice.end:
            # the half turns are named still
            return replace(no_clearer(leant, choice.evidence), alternatives=choice.alternatives)
        return no_clearer(self._turned(frame, leant, learned), leant.evidence)

    def _told(self, frame: Observation, chosen: Chosen) -> PoseResult:
        """The result of a choice, and whether it is to be accepted."""
        best, fit, evidence, alternatives = chosen
        evidence = replace(evidence, tried=self.tried, looked=self.first is not None)
        frame.count("edges", evidence.edges)
        frame.keep("field", best.field)
        if frame.shows_all:
            frame.keep("drawn", draw_at(self.craft, frame, fit.q, fit.t))
        if evidence.score is not None:
            fit = replace(fit, covariance=error_scale(evidence) * fit.covariance)
        return self._decided(frame, fit, evidence, alternatives, self.accept_at)


def _all_of(choice: Choice) -> Chosen:
    """What is told of a choice."""
    return choice.best, choice.end.fit, choice.evidence, choice.alternatives


def _confidence(result: PoseResult) -> float:
    return result.confidence
