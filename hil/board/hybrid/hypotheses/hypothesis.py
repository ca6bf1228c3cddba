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
    q, t : (4,), (3,) array
        Camera from target.
    cost : float
        Mean robust residual, in units of the noise.
    covariance : (6, 6) array
        Covariance of rotation [rad] and translation [m], camera axes.
    """

    q: Array
    t: Array
    cost: float = 9.9
    covariance: Array = field(default_factory=lambda: np.eye(6))


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """Fit of a pose to the sub-pixel edges of the image.

    Parameters
    ----------
    found, tight : float
        Share of the visible samples with an edge, and with one very near.
    rms_px : float
        RMS residual of the inliers.
    """

    found: float
    tight: float
    rms_px: float


@dataclass(frozen=True, eq=False)
class Source:
    """Origin of a hypothesis.

    Parameters
    ----------
    region : Region
        Box of the image that proposed it; ``region.source`` names the rule.
    field : EdgeField
        Edges there.
    log_prior : float
        Its log-likelihood ratio to the best of its region by the network, zero without one.
    """

    region: Region
    field: EdgeField
    log_prior: float = 0.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A pose that the image may show.

    Parameters
    ----------
    pose : PoseFit
        The pose.
    source : Source
        Its origin.
    score : float
        Its support by edges or, once the target was drawn there, the share of the image that the drawing explains.
    support : Support
        Evidence of the edges; ``NO_SUPPORT`` of the network's hypotheses.
    edge_fit : EdgeFit, optional
        Evidence of sub-pixel edges, if these were searched.
    view : Shading, optional
        The target drawn there.
    seen : (H, W) array, optional
        Faces that the drawing shows, kept when ``view`` is dropped.
    sun : ShadowMap, optional
        Source of the shadows in ``view``; None if there are none.
    start : Hypothesis, optional
        Start of its refinement, with the score there.
    """

    pose: PoseFit
    source: Source
    score: float = 0.0
    support: Support = NO_SUPPORT
    edge_fit: Optional[EdgeFit] = None
    view: Optional[Shading] = None
    seen: Optional[Array] = None
    sun: Optional[ShadowMap] = None
    start: Optional[Hypothesis] = None

    @property
    def q(self) -> Array:
        """Attitude (4,), camera from target."""
        return self.pose.q

    @property
    def t(self) -> Array:
        """Position (3,) of the target, camera axes [m]."""
        return self.pose.t

    @property
    def origin(self) -> Hypothesis:
        """Start of its refinement; itself if it was not refined."""
        return self if self.start is None else self.start

    def at(self, q: Array, t: Array) -> Hypothesis:
        """Return another pose of the same source, with the same score and support by edges, not drawn yet."""
        return Hypothesis(PoseFit(q, t), self.source, self.score, self.support)

    def without_view(self, score: float) -> Hypothesis:
        """Return the hypothesis with another score and without its drawing; only the faces it shows are kept."""
        seen = self.seen if self.view is None else self.view.seen
        return replace(self, score=score, view=None, seen=seen)


def drawn(h: Hypothesis) -> Shading:
    """Return the view of a hypothesis that was drawn."""
    assert h.view is not None  # noqa: S101 - the caller drew it
    return h.view
