"""The pieces that a method is declared with: stages, rounds of them, and the search that they work on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Callable, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.hybrid.decide.selection import Selection
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.edge_search import RegionEdges
from flyaround.hil.board.hybrid.propose.learned.learned_proposal import LearnedProposal, LearnedProposer
from flyaround.hil.board.hybrid.propose.learned.network_input import ImageCrop
from flyaround.hil.board.svd.perceptual_groups import Chains
from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.board.svd.weak_gradients import WeakGradientElimination

Array = np.ndarray

# q (N, 4) and t (N, 3) of many poses.
Poses = Tuple[Array, Array]


@dataclass
class Search:
    """One image's way through the stages: what is known before it comes, and what the stages have found.

    Parameters
    ----------
    target, figures : the target prepared for the camera, and the triads of its wireframe.
    learned : its learned proposal, where it has one. lamps : another for the light of lamps.
    tried : whether confidence was fitted on this target.
    accept_at : confidence at which a pose is accepted. frame : the image with its noise and background.
    reduced, edges : the image reduced, and what weak gradient elimination leaves of it.
    regions : where the target may be, the likeliest first. places : what the learned proposal says of them.
    thorough : whether a round before did not settle it: ask more.
    hypotheses : the one list that generators fill, best first. elsewhere, crops : those of many places, and the places.
    poses : of each region, its edges and the poses of each generator, before edges make hypotheses of them.
    aligned : hypotheses refined so far, best first.
    patch : the part of the image they were last scored on. selection : the best, and between what.
    result : the best answer of all rounds so far. smoothed : whether a filter or a file has hidden noise.
    """

    target: PreparedTarget
    figures: Chains
    learned: Optional[LearnedProposer]
    tried: bool
    accept_at: float
    frame: Observation
    reduced: Array = field(default_factory=lambda: np.zeros((0, 0)))
    edges: Optional[WeakGradientElimination] = None
    regions: List[Region] = field(default_factory=list)
    places: List[LearnedProposal] = field(default_factory=list)
    thorough: bool = False
    hypotheses: List[Hypothesis] = field(default_factory=list)
    elsewhere: List[Hypothesis] = field(default_factory=list)
    crops: List[ImageCrop] = field(default_factory=list)
    poses: List[Tuple[RegionEdges, Poses, Poses]] = field(default_factory=list)
    aligned: List[Hypothesis] = field(default_factory=list)
    patch: Optional[ImagePatch] = None
    selection: Optional[Selection] = None
    result: Optional[PoseResult] = None
    lamps: Optional[LearnedProposer] = None
    smoothed: bool = False

    @property
    def selected(self) -> Selection:
        """The selection of this round."""
        assert self.selection is not None  # noqa: S101 - the stages before made it
        return self.selection


def always(_: Search) -> bool:
    """The condition of a stage that always runs."""
    return True


@dataclass(frozen=True)
class Stage:
    """A generator, a refiner or a check: what it does to a search, and when.

    Parameters
    ----------
    name : its key in ``stages_ms``. run : changes the search. when : whether it is to run now.
    """

    name: str
    run: Callable[[Search], None]
    when: Callable[[Search], bool] = always


@dataclass(frozen=True)
class Round:
    """Generators whose hypotheses go through the refiners, the selection and the checks together.

    Parameters
    ----------
    generators : propose. refiners : of this round alone, before those of all rounds.
    when : whether what the rounds before found asks for it. thorough : ask more in the stages that follow.
    """

    generators: Tuple[Stage, ...]
    refiners: Tuple[Stage, ...] = ()
    when: Callable[[Search], bool] = always
    thorough: bool = False


def run(stages: Tuple[Stage, ...], search: Search) -> None:
    """Run each stage that is to run, and tell its time."""
    for stage in stages:
        if stage.when(search):
            stage.run(search)
            search.frame.mark(stage.name)
