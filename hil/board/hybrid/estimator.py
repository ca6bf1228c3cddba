"""Estimator of the method ``hybrid``: a pose and its confidence from one image.

The stages are prepare, propose, choose, check and answer. Each is a function from one frozen state to the next (see
``search_states``). ``PoseEstimator.initialise`` runs the stages in up to three rounds.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import List, Optional, Sequence, Tuple

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.estimator import Estimator
from flyaround.hil.board.estimation.record import StageRecord
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.decide.confidence import (
    CALIBRATED_CRAFT,
    Evidence,
    decided,
    scaled_covariance,
)
from flyaround.hil.board.hybrid.decide.discrete_symmetry import Prior, check_discrete_symmetry
from flyaround.hil.board.hybrid.decide.selection import select_by_edges, select_by_image
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.hybrid.prepare import prepare
from flyaround.hil.board.hybrid.propose.edge_search import group_poses, region_edges, template_poses
from flyaround.hil.board.hybrid.propose.keypoints.keypoint_proposal import (
    LearnedProposal,
    LearnedProposer,
)
from flyaround.hil.board.hybrid.propose.learned_hypotheses import learned_hypotheses
from flyaround.hil.board.hybrid.refine.close import refine_close_up
from flyaround.hil.board.hybrid.refine.coarse import refine_coarsely
from flyaround.hil.board.hybrid.refine.edge_hypotheses import refine_by_edges
from flyaround.hil.board.hybrid.refine.final_edges import refine_on_edges
from flyaround.hil.board.hybrid.refine.settling import settle
from flyaround.hil.board.hybrid.refine.synthetic_view import draw_at
from flyaround.hil.board.hybrid.search_states import Choice, PreparedImage, Proposals, SearchSetup
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.board.svd.wireframe_groups import model_triads

# Maximum number of regions passed to the network; hand-tuned, as all numbers of regions and locations below.
NETWORK_REGIONS = 5

# Maximum number of locations that the network proposes, in front of a texture and of empty space.
TEXTURED_LOCATIONS = 2
EMPTY_LOCATIONS = 1

# Maximum number of regions searched by edges, in front of a texture and of empty space.
TEXTURED_REGIONS = 2
EMPTY_REGIONS = 3

# Logit of the presence score (probability 0.88) above which only the network's first region is searched by edges.
PRESENT_LOGIT = 2.0

# Maximum deficit of a pose's log-likelihood by the network. Correct poses have far smaller deficits
# (docs/lab/2026-11-keypoint-network.md).
MAX_NETWORK_DEFICIT = 5.0


# --- propose


def propose_learned(image: PreparedImage) -> Proposals:
    """Propose poses at the most likely locations by the keypoint network (Park, Sharma & D'Amico 2019)."""
    frame, locations = image.frame, []
    if image.setup.learned is not None:
        keep = TEXTURED_LOCATIONS if frame.background < 0 else EMPTY_LOCATIONS
        locations = image.setup.learned.propose(
            frame.image, frame.noise, image.regions[:NETWORK_REGIONS], keep, image.reduced, frame.black
        )
    hypotheses = [
        h for location in locations for h in learned_hypotheses(image.setup.target, frame, location)
    ]
    frame.keep("learned_proposals", locations)
    frame.mark("learned_proposal")
    return Proposals(image, hypotheses, locations)


def propose_again(first: Proposals, learned: LearnedProposer) -> Proposals:
    """Propose poses from further inferences at the locations of the first round, in addition to its hypotheses."""
    image, target, frame = first.image, first.image.setup.target, first.image.frame
    locations = [
        learned.infer_again(frame.image, frame.noise, location, image.reduced, frame.black)
        for location in first.locations
    ]
    hypotheses = [h for location in locations for h in learned_hypotheses(target, frame, location)]
    frame.mark("second_look")
    return replace(first, hypotheses=[*hypotheses, *first.hypotheses], locations=locations, thorough=True)


def propose_by_edges(image: PreparedImage, locations: Sequence[LearnedProposal]) -> Proposals:
    """Propose poses from perceptual groups and viewpoint templates, aligned on the edges of each region."""
    target, frame = image.setup.target, image.frame
    # where the network detects the craft, edges may still find attitudes that it does not propose
    detected = [location.source for location in locations if location.craft > PRESENT_LOGIT]
    regions = detected[:1] or image.regions[: TEXTURED_REGIONS if frame.background < 0 else EMPTY_REGIONS]
    frame.count("searched", 1)
    searched = []
    for region in regions:
        edges = region_edges(target, frame, region)
        if edges is not None:
            templates = template_poses(target, frame, edges)
            searched.append((edges, templates, group_poses(target, image.setup.figures, frame, edges)))
    frame.mark("edge_search")
    hypotheses: List[Hypothesis] = []
    for edges, *poses in searched:
        q, t = (np.concatenate(parts) for parts in zip(*poses))  # noqa: B905 - Python 3.9 has no strict=
        hypotheses += refine_by_edges(target, frame, edges, q, t)
    frame.mark("edge_alignment")
    return Proposals(image, hypotheses, list(locations), thorough=True)


def rank(proposals: Proposals) -> Proposals:
    """Return the hypotheses in the order of their scores."""
    hypotheses = sorted(proposals.hypotheses, key=lambda h: -h.score)
    _keep_poses(proposals.image.frame, "ranking", hypotheses)
    proposals.image.frame.mark("ranking")
    return replace(proposals, hypotheses=hypotheses)


# --- choose


def choose(proposals: Proposals) -> Choice:
    """Refine the hypotheses and choose one: by the whole image if the target has faces, otherwise by edges."""
    if proposals.image.setup.has_faces:
        return _choose_by_image(proposals)
    target, frame = proposals.image.setup.target, proposals.image.frame
    aligned = refine_on_edges(target, frame, proposals.hypotheses)
    frame.mark("subpixel_alignment")
    selection = select_by_edges(target, proposals.hypotheses, aligned)
    frame.mark("selection")
    return Choice(proposals, selection)


def _choose_by_image(proposals: Proposals) -> Choice:
    image, thorough = proposals.image, proposals.thorough
    target, frame, regime = image.setup.target, image.frame, image.regime
    prior = _prior(proposals)
    # the best hypotheses of each region, on a small patch of it
    aligned = refine_coarsely(target, frame, regime, proposals.hypotheses, thorough=thorough)
    aligned = without_unlikely(aligned, prior)
    _keep_poses(frame, "coarse_alignment", aligned)
    frame.mark("coarse_alignment")
    # the best hypotheses, and near-symmetries and tilts of the first one, on one patch of the target
    patch, aligned = refine_close_up(target, frame, aligned, thorough=thorough)
    aligned = without_unlikely(aligned, prior)
    _keep_poses(frame, "close_alignment", aligned)
    frame.mark("close_alignment")
    # hypotheses refined to convergence on the full resolution
    selection = select_by_image(target, frame, regime, patch, aligned, thorough=thorough)
    _keep_poses(frame, "final_alignment", selection.optima)
    frame.mark("final_alignment")
    return Choice(proposals, selection)


def without_unlikely(hypotheses: List[Hypothesis], prior: Optional[Prior]) -> List[Hypothesis]:
    """Return the hypotheses except those that the keypoint network considers far less likely than another.

    Under lamps a view of the wrong side explains an image nearly as well as a view of the right side.
    """
    if prior is None or len(hypotheses) < 2:
        return hypotheses
    log_likelihood = np.array([prior(h.q, h.t) for h in hypotheses])
    return [
        hypotheses[k] for k in np.flatnonzero(log_likelihood >= log_likelihood.max() - MAX_NETWORK_DEFICIT)
    ]


def _keep_poses(frame: Observation, stage: str, hypotheses: Sequence[Hypothesis]) -> None:
    frame.keep_poses(stage, np.array([h.q for h in hypotheses]), np.array([h.t for h in hypotheses]))


# --- check


def check(choice: Choice) -> Choice:
    """Compare the selected pose with its near-symmetries, if the confidence was not fitted on the target."""
    setup, frame = choice.image.setup, choice.image.frame
    if setup.has_faces and not setup.calibrated and setup.has_symmetries:
        # only a few small parts distinguish half turns of a round target
        selection = check_discrete_symmetry(setup.target, frame, choice.selection, _prior(choice.proposals))
        choice = replace(choice, selection=selection)
        frame.mark("discrete_symmetry")
    return choice


def _prior(proposals: Proposals) -> Optional[Prior]:
    """Return the keypoint network's log-likelihood as a function of the pose; None if it did not run."""
    learned, locations = proposals.image.setup.learned, proposals.locations
    return None if learned is None or not locations else partial(learned.log_likelihood, locations)


def _evidence(choice: Choice) -> Evidence:
    """Return the evidence of the selection, completed by terms of the network and the calibration."""
    image, best = choice.image, choice.selection.best
    learned, locations = image.setup.learned, choice.proposals.locations
    return replace(
        choice.selection.evidence,
        calibrated=image.setup.calibrated,
        has_network=learned is not None,
        regime=image.regime,
        network=learned.log_likelihood(locations, best.q, best.t)
        if learned is not None and locations
        else 0.0,
        craft=max((location.craft for location in locations), default=0.0),
    )


# --- answer


def answer(choice: Choice, previous: Optional[PoseResult]) -> PoseResult:
    """Refine the selected pose further and decide on it; return the most confident answer of all rounds.

    Parameters
    ----------
    choice : Choice
        Selected hypothesis of this round.
    previous : PoseResult, optional
        Answer of the previous rounds.
    """
    setup, frame, selection = choice.image.setup, choice.image.frame, choice.selection
    pose = selection.best.pose
    if setup.has_faces:
        # the last steps change the pose but not its evidence
        pose = settle(setup.target, frame, selection.close, selection.best)
        frame.mark("settling")
    evidence = _evidence(choice)
    frame.count("edges", evidence.edges)
    if frame.shows_all:
        frame.keep("drawn", draw_at(setup.target, frame, pose.q, pose.t))
    if evidence.score is not None:
        pose = replace(pose, covariance=scaled_covariance(evidence, pose))
    result = decided(frame, pose, evidence, selection.alternatives)
    # scores of different rounds are not comparable, because they use different patches
    return result if previous is None or result.confidence > previous.confidence else previous


class PoseEstimator(Estimator):
    """Estimator of a target's pose from single images; it keeps no state between images.

    Parameters
    ----------
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.

    Raises
    ------
    KernelError
        If no compiled library is usable on this machine.
    """

    method = HYBRID
    takes_sun = True

    def __init__(self, model: BoardModel, camera: CameraIntrinsics) -> None:
        # loaded now, so that the first frame is not delayed
        library()
        super().__init__(model, camera)
        self.target = PreparedTarget.prepare(model, camera)
        learned = LearnedProposer.prepare(model, camera)
        self.setup = SearchSetup(
            self.target,
            model_triads(self.target.model),
            learned,
            learned is not None and model.name in CALIBRATED_CRAFT,
        )

    def _estimate(self, frame: StageRecord) -> PoseResult:
        return self.initialise(Observation.from_record(frame))

    def initialise(self, frame: Observation) -> PoseResult:
        """Return the pose in one image, without a prior pose.

        The first round uses the network. If its answer is not accepted, a second round averages the network over
        several rolls of the crop. Edges propose poses only if the network proposed none.
        """
        image = prepare(self.setup, frame)
        first, result = _round(propose_learned(image), None)
        # a search by edges would double the time and find hardly any further correct poses
        if image.setup.learned is not None and result is not None and not result.accepted:
            _, result = _round(propose_again(first, image.setup.learned), result)
        if result is None:
            _, result = _round(propose_by_edges(image, first.locations), None)
        if result is None:
            return self._declined(frame, "no target found")
        if frame.shows_all and first.locations and image.regions:
            # run the stages that were not needed, for the debug images
            propose_by_edges(replace(image, regions=image.regions[:1]), [])
        return replace(result, method=self.method)


def _round(proposals: Proposals, previous: Optional[PoseResult]) -> Tuple[Proposals, Optional[PoseResult]]:
    """Run one round. Return the ranked proposals, and the most confident answer of this and the previous rounds."""
    if not proposals.hypotheses:
        return proposals, previous
    proposals = rank(proposals)
    return proposals, answer(check(choose(proposals)), previous)
