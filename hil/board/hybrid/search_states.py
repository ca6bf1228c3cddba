"""States of the search in one image, in order; each is built from the previous one.

``SearchSetup`` -> ``PreparedImage`` -> ``Proposals`` -> ``Choice`` -> a ``PoseResult``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Optional

import numpy as np

from flyaround.hil.board.hybrid.decide.selection import Selection
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.keypoints.calibration import Calibration
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
        Target prepared for the camera.
    figures : Chains
        Triads of the target's wireframe.
    learned : LearnedProposer, optional
        Keypoint network of the target.
    fitted : bool
        True if the confidence was fitted on this target.
    calibration : Calibration
        Calibration of the confidence and the covariance.
    """

    target: PreparedTarget
    figures: Chains
    learned: Optional[LearnedProposer]
    fitted: bool
    calibration: Calibration

    @property
    def has_faces(self) -> bool:
        """True if rendered views decide; False if the target has no faces, and edges alone do."""
        return self.target.model.faces is not None

    @property
    def has_symmetries(self) -> bool:
        """True if the target model lists near-symmetries."""
        return bool(len(self.target.model.symmetry_wxyz))


@dataclass(frozen=True, eq=False)
class PreparedImage:
    """An image before the search.

    Parameters
    ----------
    setup : SearchSetup
        Inputs that are the same for every image.
    frame : Observation
        The image with its noise, black level and background.
    reduced : (h, w) array
        Reduced image.
    regions : list of Region
        Regions that may contain the target, most likely first.
    """

    setup: SearchSetup
    frame: Observation
    reduced: Array
    regions: List[Region]


@dataclass(frozen=True, eq=False)
class Proposals:
    """Hypotheses of one round, best first.

    Parameters
    ----------
    image : PreparedImage
        The image.
    hypotheses : list of Hypothesis
        Candidate poses.
    learned : LearnedProposal, optional
        Proposal of the network; None without a network or a region.
    """

    image: PreparedImage
    hypotheses: List[Hypothesis]
    learned: Optional[LearnedProposal]


@dataclass(frozen=True, eq=False)
class Choice:
    """The best hypothesis of a round, and the others that it was selected from."""

    proposals: Proposals
    selection: Selection

    @property
    def image(self) -> PreparedImage:
        """The image."""
        return self.proposals.image
