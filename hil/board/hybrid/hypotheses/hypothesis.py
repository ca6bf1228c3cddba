"""The one type of pose hypothesis: its pose, where it comes from, its score, and the evidence for it."""

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

# Of hypotheses that have not been asked for their support by edges.
UNASKED = Support(0.0, 0.0, 0.0, 0.0, np.zeros(0, int))


def _unknown() -> Array:
    return np.eye(6)


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A pose and how well it is held.

    Parameters
    ----------
    q, t : (4,), (3,) camera from target. cost : mean robust residual in noise units.
    covariance : (6, 6) of turn [rad] and shift [m], camera axes.
    """

    q: Array
    t: Array
    cost: float = 9.9
    covariance: Array = field(default_factory=_unknown)


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """How a pose fits the sub-pixel edges of the image.

    Parameters
    ----------
    found, tight : share of the visible samples with an edge, and with one very near.
    rms_px : of the inliers' residuals.
    """

    found: float
    tight: float
    rms_px: float


@dataclass(frozen=True, eq=False)
class Source:
    """Where a hypothesis comes from.

    Parameters
    ----------
    region : the box of the image that proposed it; ``region.source`` names the rule. field : edges of its place.
    log_prior : logarithm of its likelihood by the learned proposal over that of the best of its region, else zero.
    """

    region: Region
    field: EdgeField
    log_prior: float = 0.0


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A pose that the image may show.

    Parameters
    ----------
    pose : where it is. source : who proposed it.
    score : what it is ranked by: its support by edges, and once the target was drawn there, the share of the image
        that the drawing explains.
    support : evidence of the edges; ``UNASKED`` where the learned proposal made it.
    edge_fit : evidence of sub-pixel edges, where these were searched.
    view : the target drawn there, until that is let go of. seen : (H, W) the faces that it shows, which are kept.
    sun : casts the shadows of ``view``; None draws none.
    start : where its refinement began, with the score it had there.
    """

    pose: PoseFit
    source: Source
    score: float = 0.0
    support: Support = UNASKED
    edge_fit: Optional[EdgeFit] = None
    view: Optional[Shading] = None
    seen: Optional[Array] = None
    sun: Optional[ShadowMap] = None
    start: Optional[Hypothesis] = None

    @property
    def q(self) -> Array:
        """(4,) attitude, camera from target."""
        return self.pose.q

    @property
    def t(self) -> Array:
        """(3,) position of the target, camera axes [m]."""
        return self.pose.t

    @property
    def origin(self) -> Hypothesis:
        """Where its refinement began; itself where there was none."""
        return self if self.start is None else self.start

    def at(self, q: Array, t: Array) -> Hypothesis:
        """Another pose of the same source, its score and support by edges, not drawn yet."""
        return Hypothesis(PoseFit(q, t), self.source, self.score, self.support)

    def without_view(self, score: float) -> Hypothesis:
        """The same with another score, its drawing let go of: only the faces it shows are kept."""
        seen = self.seen if self.view is None else self.view.seen
        return replace(self, score=score, view=None, seen=seen)


def drawn(h: Hypothesis) -> Shading:
    """The view of a hypothesis that was drawn."""
    assert h.view is not None  # noqa: S101 - the caller drew it
    return h.view
