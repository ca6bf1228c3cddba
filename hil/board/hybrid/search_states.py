"""States of one image's search, in the order in which they are reached; each is made of the one before.

``SearchSetup`` -> ``PreparedImage`` -> ``Proposals`` -> ``Choice`` -> a ``PoseResult``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Optional

import numpy as np

from flyaround.hil.board.hybrid.decide.selection import Selection
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.keypoints.keypoint_proposal import LearnedProposal, LearnedProposer
from flyaround.hil.board.svd.perceptual_groups import Chains
from flyaround.hil.board.svd.region_of_interest import Region

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class SearchSetup:
    """Inputs that are the same for every image.

    Parameters
    ----------
    target : PreparedTarget
        The target prepared for the camera.
    figures : Chains
        Triads of its wireframe.
    learned : LearnedProposer, optional
        Its keypoint network.
    calibrated : bool
        True if confidence was fitted on this target.
    accept_at : float
        Confidence at which a pose is accepted.
    """

    target: PreparedTarget
    figures: Chains
    learned: Optional[LearnedProposer]
    calibrated: bool
    accept_at: float

    @property
    def has_faces(self) -> bool:
        """True if the whole image decides, False if the target has no faces and edges alone do."""
        return self.target.model.faces is not None

    @property
    def has_symmetries(self) -> bool:
        """True if the target's model lists near-symmetries."""
        return bool(len(self.target.model.symmetry_wxyz))


@dataclass(frozen=True, eq=False)
class PreparedImage:
    """An image before any target is looked for.

    Parameters
    ----------
    setup : SearchSetup
        Inputs that are the same for every image.
    frame : Observation
        The image with its noise, black level and background.
    reduced : (h, w) array
        The image reduced.
    regions : list of Region
        Where the target may be, the most likely first.
    regime : Regime
        Its light.
    smoothed : bool
        True if a filter or a file has hidden noise.
    """

    setup: SearchSetup
    frame: Observation
    reduced: Array
    regions: List[Region]
    regime: Regime
    smoothed: bool


@dataclass(frozen=True, eq=False)
class Proposals:
    """Hypotheses of one round, best first.

    Parameters
    ----------
    image : PreparedImage
        The image.
    hypotheses : list of Hypothesis
        Poses that the image may show.
    places : list of LearnedProposal
        Proposals of the network for the regions.
    thorough : bool
        True if an earlier round did not settle it: look at more.
    """

    image: PreparedImage
    hypotheses: List[Hypothesis]
    places: List[LearnedProposal]
    thorough: bool = False


@dataclass(frozen=True, eq=False)
class Choice:
    """The best of a round's hypotheses, and the others that it was chosen among."""

    proposals: Proposals
    selection: Selection

    @property
    def image(self) -> PreparedImage:
        """The image."""
        return self.proposals.image
