"""The pose estimator: an image in, a pose with its confidence out.

It is a list of stages: propose -> one list of hypotheses -> refine -> decide. ``PREPARE``, ``ROUNDS``, ``REFINE``,
``SELECT``, ``CHECKS`` and ``DECIDE`` below are that list; what a stage does lives in the folder of its name.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Optional

import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.estimator import Estimator
from flyaround.hil.board.estimation.record import StageRecord
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.hybrid.decide.axial_symmetry import check_axial_symmetry
from flyaround.hil.board.hybrid.decide.confidence import (
    ACCEPT_AT,
    TRIED,
    Evidence,
    confidence,
    decide,
    doubtful,
    error_scale,
)
from flyaround.hil.board.hybrid.decide.decision import decided, reconsidered
from flyaround.hil.board.hybrid.decide.discrete_symmetry import Prior, check_discrete_symmetry
from flyaround.hil.board.hybrid.decide.near_minima import check_near_minima
from flyaround.hil.board.hybrid.decide.selection import select_by_edges, select_by_image
from flyaround.hil.board.hybrid.hypotheses.ambiguity import same_end
from flyaround.hil.board.hybrid.hypotheses.hypothesis import PoseFit
from flyaround.hil.board.hybrid.image.edge_field import shrink
from flyaround.hil.board.hybrid.image.noise import (
    black_level,
    coarse_noise,
    has_flat_floor,
    noise_sigma,
    whole_median,
)
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.hybrid.propose.edge_search import group_poses, region_edges, template_poses
from flyaround.hil.board.hybrid.propose.learned.learned_proposal import LAMPS, LearnedProposer
from flyaround.hil.board.hybrid.propose.learned_hypotheses import hypotheses_of_places, learned_hypotheses
from flyaround.hil.board.hybrid.propose.regions import REDUCTION, propose_regions
from flyaround.hil.board.hybrid.refine.close import refine_close_up
from flyaround.hil.board.hybrid.refine.coarse import refine_coarsely, refine_many_scales
from flyaround.hil.board.hybrid.refine.edge_hypotheses import refine_by_edges
from flyaround.hil.board.hybrid.refine.final_edges import refine_on_edges
from flyaround.hil.board.hybrid.refine.settling import settle
from flyaround.hil.board.hybrid.refine.synthetic_view import draw_at
from flyaround.hil.board.hybrid.stages import Round, Search, Stage, run
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients
from flyaround.hil.board.svd.wireframe_groups import model_triads

# Least noise: quantisation of a scale of 255 [its steps], and half as much again is not told from it.
LEAST_NOISE, SCALE = 0.15, 255.0

# Noise of means over many pixels from which it is not that of single ones, over what theirs would be.
CORRELATED = 1.4

# Black level from which a camera is one of a laboratory, over the noise: there the light is that of lamps.
OFFSET = 2.0

# The same before a texture, whose dark parts are above zero as well.
FLOOR_OFFSET = 3.0

# Confidences between which a pose in the light of lamps is held against near leans, accepted or not: of 171 surer ones
# leaning made none right or wrong, and 11 worse of the 13 that it moved by a degree.
LIKELY, CLEAR = 0.5, 0.99

# Share of the frame's tiles with edges above which the background is not empty space.
BUSY = 0.25

# Regions looked at by the learned proposal, and places it hands on with a texture behind and with nothing.
ASKED, PLACES, EMPTY_PLACES = 5, 2, 1

# Logit of there being a craft from which its edges are not searched: what the picture cannot settle, they cannot.
SURE = 2.0

# Regions searched at most with a texture behind and with nothing, and the least diagonal of one [px].
REGIONS, EMPTY_REGIONS, SMALLEST_PX = 2, 3, 24.0


# --- prepare: what the image says before any target is looked for


def measure_noise(s: Search) -> None:
    """Noise of the image (Immerkaer 1996), and the image reduced."""
    image = s.frame.image
    # a 16-bit file may hold 10 or 12 bits: its own largest value is its scale
    full_scale = SCALE if image.dtype == np.uint8 else float(image.max())
    s.frame.noise = max(noise_sigma(image, full_scale), LEAST_NOISE * full_scale / SCALE)
    s.reduced, _ = shrink(image, 0, 0, image.shape[1], image.shape[0], max(image.shape) // REDUCTION)
    coarse = coarse_noise(s.reduced, REDUCTION)
    if coarse > CORRELATED * s.frame.noise:
        s.frame.noise, s.smoothed = coarse, True
    s.frame.keep("reduced", s.reduced)


def find_strong_gradients(s: Search) -> None:
    """Weak gradient elimination (Sharma, Ventura & D'Amico 2018)."""
    s.edges = eliminate_weak_gradients(s.reduced)
    s.frame.keep("wge", s.edges)


def find_regions(s: Search) -> None:
    """Regions where the target may be, and whether the background is empty space."""
    assert s.edges is not None  # noqa: S101 - the stage before found them
    regions, busy, s.frame.likely = propose_regions(s.reduced, s.edges, s.frame.noise / REDUCTION)
    if busy < BUSY:
        # reduced pixels are whole numbers as well
        s.frame.background = whole_median(s.reduced.astype(np.int32))
    s.frame.black = _black_level(s, busy)
    if s.lamps is not None and s.frame.black > OFFSET * s.frame.noise:
        s.learned = s.lamps
    s.frame.count("regions", len(regions))
    s.frame.keep("regions", regions)
    s.regions = [r for r in regions if r.diagonal_px >= SMALLEST_PX]


def _black_level(s: Search, busy: float) -> float:
    """What the camera adds to light, 0 where nothing says that it does."""
    noise = s.frame.noise / REDUCTION
    if not s.smoothed and s.frame.clipped:
        # noise is cut off at zero: nothing is added
        return 0.0
    black = black_level(s.reduced, noise)
    if s.smoothed or busy < BUSY:
        return black
    # the Earth in the whole frame has a darkest part too
    return black if has_flat_floor(s.reduced, noise) and black > FLOOR_OFFSET * s.frame.noise else 0.0


# --- propose: hypotheses for the one list


def propose_learned(s: Search) -> None:
    """Poses of the likeliest places, by the pose proposal network (Sharma & D'Amico 2019)."""
    if s.learned is not None:
        keep = PLACES if s.frame.background < 0 else EMPTY_PLACES
        frame = s.frame
        s.places = s.learned.propose(
            frame.image, frame.noise, s.regions[:ASKED], keep, s.reduced, frame.black
        )
    s.hypotheses = [h for place in s.places for h in learned_hypotheses(s.target, s.frame, place)]
    s.frame.keep("learned_proposals", s.places)


def propose_many_scales(s: Search) -> None:
    """Poses of many places and sizes about what is seen, by the same network."""
    assert s.learned is not None  # noqa: S101 - the round asks for it
    source = s.hypotheses[0].source
    s.elsewhere, s.crops = hypotheses_of_places(s.target, s.frame, s.learned, s.places[0], source, s.reduced)


def propose_by_edges(s: Search) -> None:
    """Poses of perceptual groups and of viewpoint templates in each region."""
    # what the learned proposal is sure of is where it is: there edges find the attitudes that it does not
    sure = [place.source for place in s.places if place.craft > SURE]
    some = sure[:1] or s.regions[: REGIONS if s.frame.background < 0 else EMPTY_REGIONS]
    s.frame.count("searched", 1)
    for region in some:
        edges = region_edges(s.target, s.frame, region)
        if edges is not None:
            templates = template_poses(s.target, s.frame, edges)
            s.poses.append((edges, templates, group_poses(s.target, s.figures, s.frame, edges)))


# --- refine


def align_many_scales(s: Search) -> None:
    """Hypotheses of many places, which share no patch with those of a region, on one patch of all of them."""
    if s.crops:
        s.aligned = refine_many_scales(s.target, s.frame, s.elsewhere, s.crops)


def align_poses_on_edges(s: Search) -> None:
    """The poses of each region on its edges: what holds becomes a hypothesis."""
    for edges, *poses in s.poses:
        q, t = (np.concatenate(parts) for parts in zip(*poses))  # noqa: B905 - Python 3.9 has no strict=
        s.hypotheses += refine_by_edges(s.target, s.frame, edges, q, t)


def rank_hypotheses(s: Search) -> None:
    """The list in the order of its scores."""
    s.hypotheses.sort(key=lambda h: -h.score)
    s.frame.keep("found", s.hypotheses)


def align_coarsely(s: Search) -> None:
    """The best of each region on a small patch of it, and those refined already."""
    leaders = refine_coarsely(s.target, s.frame, s.hypotheses, thorough=s.thorough)
    s.aligned = sorted([*leaders, *s.aligned], key=lambda h: -h.score)


def align_close_up(s: Search) -> None:
    """The leaders, the winner's near-symmetries and its tilts on one patch of the target."""
    s.patch, s.aligned = refine_close_up(s.target, s.frame, s.aligned, thorough=s.thorough)


def align_on_edges(s: Search) -> None:
    """The leaders on sub-pixel edges."""
    s.aligned = refine_on_edges(s.target, s.frame, s.hypotheses)


# --- decide


def select_among_ends(s: Search) -> None:
    """The best of those refined to their ends on the whole image."""
    assert s.patch is not None  # noqa: S101 - the stage before made it
    s.selection = select_by_image(s.target, s.frame, s.patch, s.aligned, thorough=s.thorough)


def select_among_edges(s: Search) -> None:
    """The best of those refined on edges."""
    s.selection = select_by_edges(s.target, s.hypotheses, s.aligned)


def turn_about_axis(s: Search) -> None:
    """The selected pose against turns about the axis of a round target."""
    s.selection = check_axial_symmetry(s.target, s.frame, s.selected)


def turn_by_symmetries(s: Search) -> None:
    """The selected pose against its near-symmetries; of a round target a few small parts tell them apart."""
    s.selection = check_discrete_symmetry(s.target, s.frame, s.selected, _prior(s))


def tilt(s: Search) -> None:
    """A doubtful pose against its near minima; of a target not tried before the last word is its near-symmetries'."""
    before = s.selected
    if s.tried:
        s.selection = check_near_minima(s.target, s.frame, before)
        return
    after = check_near_minima(s.target, s.frame, before, symmetries=False)
    if after.best is before.best:
        # the near-symmetries are named still
        s.selection = replace(after.no_clearer(before.evidence), alternatives=before.alternatives)
        return
    evidence = after.evidence
    if has_symmetries(s):
        after = check_discrete_symmetry(s.target, s.frame, after, _prior(s))
    s.selection = after.no_clearer(evidence)


def settle_pose(s: Search) -> None:
    """The last steps of the selected pose; what it was chosen by stays as it is."""
    selection = s.selected
    pose = settle(s.target, s.frame, selection.close, selection.best)
    s.selection = replace(selection, best=replace(selection.best, pose=pose))


def accept_or_decline(s: Search) -> None:
    """Confidence and the acceptance test; the surest answer of all rounds stands."""
    selection, frame = s.selected, s.frame
    pose, evidence, first = selection.best.pose, _fitted(s), s.result
    if evidence.lamps and first is not None and isinstance(first.evidence, Evidence):
        agreed = _agrees(first, pose)
        evidence = replace(evidence, agreed=agreed)
        first = reconsidered(first, replace(first.evidence, agreed=agreed), s.accept_at)
    frame.count("edges", evidence.edges)
    frame.keep("field", selection.best.source.field)
    if frame.shows_all:
        frame.keep("drawn", draw_at(s.target, frame, pose.q, pose.t))
    if evidence.score is not None:
        pose = replace(pose, covariance=error_scale(evidence) * pose.covariance)
    result = decided(frame, pose, evidence, selection.alternatives, s.accept_at)
    # not by what they explain: the rounds were judged on different cuts of the image
    s.result = result if first is None or result.confidence > first.confidence else first


def _agrees(answer: PoseResult, pose: PoseFit) -> bool:
    """Whether an answer is the same pose."""
    q, t = answer.q_camera_from_target_wxyz, answer.t_camera_from_target_m
    return q is not None and t is not None and same_end(PoseFit(q, t), pose)


def _prior(s: Search) -> Optional[Prior]:
    """The learned proposal's log-likelihood of a pose, where it has looked."""
    return None if s.learned is None or not s.places else partial(s.learned.log_likelihood, s.places)


def _fitted(s: Search) -> Evidence:
    """The evidence with what is known of the target's confidences."""
    lamps = s.lamps is not None and s.learned is s.lamps
    return replace(s.selected.evidence, tried=s.tried, looked=s.learned is not None, lamps=lamps)


# --- conditions


def by_image(s: Search) -> bool:
    """The target has faces: the whole image decides."""
    return s.target.model.faces is not None


def by_edges(s: Search) -> bool:
    """The target has none: edges alone decide."""
    return not by_image(s)


def untried_round(s: Search) -> bool:
    """A round target on which confidence was not fitted."""
    return by_image(s) and not s.tried and s.target.round


def has_symmetries(s: Search) -> bool:
    """The target's model lists near-symmetries."""
    return bool(len(s.target.model.symmetry_wxyz))


def untried_symmetric(s: Search) -> bool:
    """A target with near-symmetries on which confidence was not fitted."""
    return by_image(s) and not s.tried and has_symmetries(s)


def accepted_in_doubt(s: Search) -> bool:
    """A first round would accept the pose, with a confidence that wrong ones have too; by lamps, nearly would."""
    if not by_image(s) or s.thorough:
        return False
    evidence = _fitted(s)
    if evidence.lamps:
        asked = LIKELY < confidence(evidence) < CLEAR
    else:
        asked = not decide(evidence, s.accept_at) and doubtful(evidence)
    if not asked:
        return False
    s.frame.count("checked", 1)
    return True


def declined_by_learned(s: Search) -> bool:
    """The learned proposal found poses, none of which is accepted."""
    # edges besides would double the time: of 211 frames they set 8 right, and had a wrong pose accepted
    return s.learned is not None and s.result is not None and not s.result.accepted


def nothing_found(s: Search) -> bool:
    """No round before found any pose."""
    return s.result is None


# --- the list

PREPARE = (
    Stage("noise", measure_noise),
    Stage("weak_gradients", find_strong_gradients),
    Stage("regions", find_regions),
)

ROUNDS = (
    Round((Stage("learned_proposal", propose_learned),)),
    Round(
        (Stage("multi_scale_proposal", propose_many_scales),),
        (Stage("multi_scale_alignment", align_many_scales),),
        when=declined_by_learned,
        thorough=True,
    ),
    Round(
        (Stage("edge_search", propose_by_edges),),
        (Stage("edge_alignment", align_poses_on_edges),),
        when=nothing_found,
        thorough=True,
    ),
)

REFINE = (
    Stage("ranking", rank_hypotheses),
    Stage("coarse_alignment", align_coarsely, when=by_image),
    Stage("close_alignment", align_close_up, when=by_image),
    Stage("subpixel_alignment", align_on_edges, when=by_edges),
)

SELECT = (
    Stage("final_alignment", select_among_ends, when=by_image),
    Stage("selection", select_among_edges, when=by_edges),
)

CHECKS = (
    Stage("axial_symmetry", turn_about_axis, when=untried_round),
    Stage("discrete_symmetry", turn_by_symmetries, when=untried_symmetric),
    Stage("near_minima", tilt, when=accepted_in_doubt),
)

DECIDE = (
    Stage("settling", settle_pose, when=by_image),
    Stage("decision", accept_or_decline),
)


class PoseEstimator(Estimator):
    """Estimates the target's pose from single images; keeps nothing between them.

    Parameters
    ----------
    model : the target. camera : the intrinsics of every image.
    accept_at : confidence at which a pose is accepted.

    Raises
    ------
    KernelError
        If the compiled library cannot be used here.
    """

    method = HYBRID

    def __init__(self, model: BoardModel, camera: CameraIntrinsics, accept_at: float = ACCEPT_AT) -> None:
        # loaded here, not while a frame waits
        library()
        super().__init__(model, camera)
        self.accept_at = accept_at
        self.target = PreparedTarget.prepare(model, camera)
        self.figures = model_triads(self.target.model)
        self.learned = LearnedProposer.prepare(model, camera)
        self.lamps = LearnedProposer.prepare(model, camera, LAMPS)
        self.tried = self.learned is not None and model.name in TRIED

    def _estimate(self, frame: StageRecord) -> PoseResult:
        return self.initialise(Observation.of(frame))

    def search(self, frame: Observation) -> Search:
        """The search of one image, before its first stage."""
        return Search(
            self.target, self.figures, self.learned, self.tried, self.accept_at, frame, lamps=self.lamps
        )

    def initialise(self, frame: Observation) -> PoseResult:
        """The pose in one image, without knowing any other."""
        s = self.search(frame)
        run(PREPARE, s)
        for turn in ROUNDS:
            if not turn.when(s):
                continue
            s.thorough, s.aligned = turn.thorough, []
            run((*turn.generators, *turn.refiners), s)
            if s.hypotheses:
                run((*REFINE, *SELECT, *CHECKS, *DECIDE), s)
        if s.result is None:
            return self._declined(frame, "no target found")
        if frame.shows_all and s.places and s.regions:
            # the stages that were not needed, for the pictures of all
            s.places, s.regions = [], s.regions[:1]
            propose_by_edges(s)
            align_poses_on_edges(s)
        return replace(s.result, method=self.method)
