"""Pose hypothesis: its pose, source and score, and the evidence for it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Optional

import numpy as np

from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.hypotheses.edge_support import Support
from flyaround.hil.board.hybrid.image.edge_field import EdgeField
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board.svd.region_of_interest import Region

Array = np.ndarray

# Support of hypotheses whose edges were not compared.
NO_SUPPORT = Support(0.0, 0.0, 0.0, 0.0, np.zeros(0, int))


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A pose and its covariance.

    Parameters
    ----------
    q : (4,) array
        Attitude quaternion, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    covariance : (6, 6) array, optional
        Covariance of rotation [rad] and translation [m], camera axes.
    """

    q: Array
    t: Array
    covariance: Array = field(default_factory=lambda: np.eye(6))


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """Fit of a pose to the sub-pixel edges of the image.

    Parameters
    ----------
    matched_share : float
        Share of the visible samples with an image edge nearby.
    tight : float
        Share of the visible samples with an image edge very near.
    rms_px : float
        RMS residual of the inliers [image px].
    """

    matched_share: float
    tight: float
    rms_px: float


@dataclass(frozen=True, eq=False)
class Source:
    """Origin of a hypothesis.

    Parameters
    ----------
    region : Region
        Image region in which it was proposed; ``region.source`` names the rule.
    field : EdgeField
        Edges of the region.
    log_prior : float
        Log-likelihood by the network relative to the best hypothesis of the region; zero without a network.
    """

    region: Region
    field: EdgeField
    log_prior: float = 0.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A candidate pose of the target.

    Parameters
    ----------
    pose : PoseFit
        Pose with its covariance.
    source : Source
        Origin of the hypothesis.
    score : float
        Edge support or, once the target is rendered at the pose, share of the image that the rendering explains.
    support : Support
        Edge evidence; ``NO_SUPPORT`` for hypotheses of the network.
    edge_fit : EdgeFit, optional
        Sub-pixel edge evidence, if edges were searched.
    view : Shading, optional
        Rendering of the target at the pose.
    visible_face : (H, W) array, optional
        Faces visible in the rendering, kept when ``view`` is dropped.
    sun : ShadowMap, optional
        Source of the shadows in ``view``; None without shadows.
    start : Hypothesis, optional
        Hypothesis that refinement started from, with its score.
    """

    pose: PoseFit
    source: Source
    score: float = 0.0
    support: Support = NO_SUPPORT
    edge_fit: Optional[EdgeFit] = None
    view: Optional[Shading] = None
    visible_face: Optional[Array] = None
    sun: Optional[ShadowMap] = None
    start: Optional[Hypothesis] = None

    @property
    def q(self) -> Array:
        """Attitude quaternion (4,), camera from target."""
        return self.pose.q

    @property
    def t(self) -> Array:
        """Target position (3,), camera frame [m]."""
        return self.pose.t

    @property
    def origin(self) -> Hypothesis:
        """Hypothesis that refinement started from; itself if it was not refined."""
        return self if self.start is None else self.start

    def at(self, q: Array, t: Array) -> Hypothesis:
        """Return the hypothesis at another pose.

        Returns
        -------
        Hypothesis
            Hypothesis of the same source, score and edge support, with the default covariance of `PoseFit`; without
            edge fit, rendering and start of refinement.
        """
        return Hypothesis(PoseFit(q, t), self.source, self.score, self.support)

    def without_view(self, score: float) -> Hypothesis:
        """Return the hypothesis with another score and without its rendering.

        Returns
        -------
        Hypothesis
            Copy without a rendering, of which ``visible_face`` is kept.
        """
        visible_face = self.visible_face if self.view is None else self.view.visible_face
        return replace(self, score=score, view=None, visible_face=visible_face)


def drawn(h: Hypothesis) -> Shading:
    """Return the rendering of a hypothesis."""
    assert h.view is not None  # noqa: S101 - the caller rendered it
    return h.view
