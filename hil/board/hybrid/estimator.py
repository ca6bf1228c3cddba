"""Estimator of the method ``hybrid``: a pose and its confidence from one image.

The stages are prepare, propose, choose, check and answer. Each is a function from one frozen state to the next (see
``search_states``). ``PoseEstimator.initialise`` runs the stages in up to three rounds.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import List, Optional, Sequence

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.estimator import Estimator
from flyaround.hil.board.estimation.record import StageRecord
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.decide.confidence import (
    FITTED,
    FITTED_CRAFT,
    UNCALIBRATED,
    WITHOUT_NETWORK,
    Evidence,
    confidence,
    decide,
    decided,
    scaled_covariance,
)
from flyaround.hil.board.hybrid.decide.discrete_symmetry import check_discrete_symmetry
from flyaround.hil.board.hybrid.decide.selection import select_by_edges, select_by_image
from flyaround.hil.board.hybrid.hypotheses.ambiguity import Prior, without_unlikely
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
from flyaround.hil.board.hybrid.refine.final import refine_to_convergence
from flyaround.hil.board.hybrid.refine.final_edges import refine_on_edges
from flyaround.hil.board.hybrid.refine.settling import settle
from flyaround.hil.board.hybrid.refine.synthetic_view import draw_at
from flyaround.hil.board.hybrid.search_states import Choice, PreparedImage, Proposals, SearchSetup
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.board.svd.wireframe_groups import model_triads

# Maximum number of regions passed to the network; hand-tuned, as all numbers of regions below.
NETWORK_REGIONS = 5

# Maximum number of regions searched by edges, in front of a texture and of empty space.
TEXTURED_REGIONS = 2
EMPTY_REGIONS = 3

# Logit of the presence score (probability 0.88) above which only the network's first region is searched by edges.
PRESENT_LOGIT = 2.0


# --- propose


def propose_learned(image: PreparedImage) -> Proposals:
    """Propose poses at the most likely location by the keypoint network (Park, Sharma & D'Amico 2019).

    Returns
    -------
    Proposals
        Poses of the network; without a network or a region, no hypotheses and ``learned`` None.
    """
    frame, proposal = image.frame, None
    if image.setup.learned is not None:
        regions = image.regions[:NETWORK_REGIONS]
        proposal = image.setup.learned.propose(frame.image, frame.noise, regions, image.reduced, frame.black)
    frame.keep("learned_proposal", proposal)
    proposals = _with_hypotheses(image, proposal)
    frame.mark("learned_proposal")
    return proposals


def propose_again(first: Proposals, learned: LearnedProposer, proposal: LearnedProposal) -> Proposals:
    """Propose poses from further inferences at the location of the first round."""
    image, frame = first.image, first.image.frame
    again = learned.infer_again(frame.image, frame.noise, proposal, image.reduced, frame.black)
    proposals = _with_hypotheses(image, again)
    frame.mark("second_look")
    return proposals


def _with_hypotheses(image: PreparedImage, proposal: Optional[LearnedProposal]) -> Proposals:
    hypotheses = [] if proposal is None else learned_hypotheses(image.setup.target, image.frame, proposal)
    return Proposals(image, hypotheses, proposal)


def propose_by_edges(image: PreparedImage, learned: Optional[LearnedProposal]) -> Proposals:
    """Propose poses from perceptual groups and viewpoint templates, aligned on the edges of each region."""
    target, frame = image.setup.target, image.frame
    # where the network detects the craft, edges may still find attitudes that it does not propose
    regions = image.regions[: TEXTURED_REGIONS if frame.background < 0 else EMPTY_REGIONS]
    if learned is not None and learned.craft > PRESENT_LOGIT:
        regions = [learned.source]
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
    hypotheses.sort(key=lambda h: -h.score)
    frame.mark("edge_alignment")
    return Proposals(image, hypotheses, learned)


# --- choose


def choose(proposals: Proposals) -> Choice:
    """Refine the hypotheses and choose one: by the whole image if the target has faces, otherwise by edges."""
    target, frame = proposals.image.setup.target, proposals.image.frame
    _keep_poses(frame, "proposal", proposals.hypotheses)
    if proposals.image.setup.has_faces:
        return _choose_by_image(proposals)
    aligned = refine_on_edges(target, frame, proposals.hypotheses)
    frame.mark("subpixel_alignment")
    selection = select_by_edges(target, proposals.hypotheses, aligned)
    frame.mark("selection")
    return Choice(proposals, selection)


def _choose_by_image(proposals: Proposals) -> Choice:
    image = proposals.image
    target, frame = image.setup.target, image.frame
    prior = _prior(proposals)
    # the best hypotheses of each region, on a small patch of it
    likely = without_unlikely(proposals.hypotheses, prior)
    aligned = without_unlikely(refine_coarsely(target, frame, likely), prior)
    _keep_poses(frame, "coarse_alignment", aligned)
    frame.mark("coarse_alignment")
    # the best hypotheses, and near-symmetries of the first one, on one patch of the target
    patch, aligned = refine_close_up(target, frame, aligned, prior)
    aligned = without_unlikely(aligned, prior)
    _keep_poses(frame, "close_alignment", aligned)
    frame.mark("close_alignment")
    # the best hypothesis refined to convergence on the full resolution
    best = refine_to_convergence(target, frame, patch, aligned[0])
    selection = select_by_image(target, patch, aligned, best)
    _keep_poses(frame, "final_alignment", [best])
    frame.mark("final_alignment")
    return Choice(proposals, selection)


def _keep_poses(frame: Observation, stage: str, hypotheses: Sequence[Hypothesis]) -> None:
    frame.keep_poses(stage, np.array([h.q for h in hypotheses]), np.array([h.t for h in hypotheses]))


# --- check


def check(choice: Choice) -> Choice:
    """Complete the evidence, after near-symmetries were compared if the confidence was not fitted on the target."""
    setup, frame = choice.image.setup, choice.image.frame
    if setup.has_faces and not setup.fitted and setup.has_symmetries:
        # only a few small parts distinguish half turns of a round target
        selection = check_discrete_symmetry(setup.target, frame, choice.selection, _prior(choice.proposals))
        choice = replace(choice, selection=selection)
        frame.mark("discrete_symmetry")
    return replace(choice, selection=replace(choice.selection, evidence=_evidence(choice)))


def _prior(proposals: Proposals) -> Optional[Prior]:
    """Return the keypoint network's log-likelihood as a function of the pose; None if it did not run."""
    learned, proposal = proposals.image.setup.learned, proposals.learned
    return None if learned is None or proposal is None else partial(learned.log_likelihood, proposal)


def _evidence(choice: Choice) -> Evidence:
    """Return the evidence of the selection, completed by terms of the network and the calibration."""
    image, best, prior = choice.image, choice.selection.best, _prior(choice.proposals)
    learned = choice.proposals.learned
    return replace(
        choice.selection.evidence,
        fitted=image.setup.fitted,
        calibration=image.setup.calibration,
        lamps=image.frame.black > 0,
        network=0.0 if prior is None else float(prior(best.q[None], best.t[None])[0]),
        craft=0.0 if learned is None else learned.craft,
    )


# --- answer


def answer(choice: Choice) -> PoseResult:
    """Refine the selected pose further and decide on it."""
    setup, frame, selection = choice.image.setup, choice.image.frame, choice.selection
    pose, evidence = selection.best.pose, selection.evidence
    if setup.has_faces:
        # the last steps change the pose but not its evidence
        pose = settle(setup.target, frame, selection.close, selection.best)
        frame.mark("settling")
    frame.count("edges", evidence.edges)
    if frame.shows_all:
        frame.keep("drawn", draw_at(setup.target, frame, pose.q, pose.t))
    if evidence.score is not None:
        pose = replace(pose, covariance=scaled_covariance(evidence, pose))
    return decided(frame, pose, evidence, selection.alternatives)


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
        fitted = learned is not None and model.name in FITTED_CRAFT
        if learned is None:
            calibration = WITHOUT_NETWORK
        else:
            calibration = learned.network.head.calibration or (FITTED if fitted else UNCALIBRATED)
        self.setup = SearchSetup(self.target, model_triads(self.target.model), learned, fitted, calibration)

    def _estimate(self, frame: StageRecord) -> PoseResult:
        return self.initialise(Observation.from_record(frame))

    def initialise(self, frame: Observation) -> PoseResult:
        """Estimate the pose in one image, without a prior pose.

        The first round uses the network. If its answer is not accepted, a second round averages the network over
        several rolls of the crop. Edges propose poses only if the network proposed none.

        Returns
        -------
        PoseResult
            Best pose found, accepted or declined with a reason; without a pose if no target was found.
        """
        image = prepare(self.setup, frame)
        first = propose_learned(image)
        surest = _surest(first, None)
        learned, proposal = self.setup.learned, first.learned
        # a search by edges would double the time and find hardly any further correct poses
        if learned is not None and proposal is not None and surest is not None:
            if decide(surest.selection.evidence):
                surest = _surest(propose_again(first, learned, proposal), surest)
        elif surest is None:
            surest = _surest(propose_by_edges(image, proposal), None)
        if surest is None:
            return self._declined(frame, "no target found")
        result = answer(surest)
        if frame.shows_all and proposal is not None and image.regions:
            # run the stages that were not needed, for the debug images
            propose_by_edges(replace(image, regions=image.regions[:1]), None)
        return replace(result, method=self.method)


def _surest(proposals: Proposals, previous: Optional[Choice]) -> Optional[Choice]:
    """Run one round. Return the most confident choice of this and the previous rounds; None if nothing was proposed."""
    if not proposals.hypotheses:
        return previous
    choice = check(choose(proposals))
    # scores of different rounds are not comparable, because they use different patches
    if previous is None or _sureness(choice) > _sureness(previous):
        return choice
    return previous


def _sureness(choice: Choice) -> float:
    """Return the confidence by the weights that most frames determined; those of one craft order its rounds worse."""
    return confidence(replace(choice.selection.evidence, calibration=FITTED))
