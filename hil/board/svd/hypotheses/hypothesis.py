"""One picture on its way through the stages, the craft it may show, and what is said of it."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Dict, Optional, Tuple

import numpy as np

from hil.board.svd.decide.confidence import Evidence
from hil.board.svd.geometry.camera import CameraIntrinsics
from hil.board.svd.geometry.faces import ROUND_STEPS
from hil.board.svd.geometry.wireframe import EdgeSamples, Occluders
from hil.board.svd.hypotheses.edge_support import Support
from hil.board.svd.image.edge_field import EdgeField
from hil.board.svd.image.noise import clipped_noise
from hil.board.svd.model.round_bodies import is_round, with_outlines
from hil.board.svd.model.shadow_map import SunTable
from hil.board.svd.model.target_model import BoardModel
from hil.board.svd.model.visibility import occluders, sample_edges
from hil.board.svd.propose.perceptual_groups import Chains, model_triads
from hil.board.svd.propose.regions import Region
from hil.board.svd.propose.templates import ViewTable, build_views

Array = np.ndarray


# What the stages found, by name, for debug pictures.
Trace = Dict[str, Any]


@dataclass(frozen=True, eq=False)
class Alternative:
    """A distinct pose that was considered.

    Parameters
    ----------
    q_camera_from_target_wxyz, t_camera_from_target_m : the pose.
    score : what poses were ranked by, larger is better; only differences within one result mean anything.
    """

    q_camera_from_target_wxyz: Array
    t_camera_from_target_m: Array
    score: float


@dataclass(frozen=True, eq=False)
class PoseResult:
    """What the estimator says of one picture.

    Parameters
    ----------
    accepted : whether the pose may be used. reason : why not, else empty.
    q_camera_from_target_wxyz, t_camera_from_target_m : best pose, ``x_camera = R(q) x_target + t``; None when
        there is none. A declined result still carries its best pose.
    confidence : 0..1. stages_ms : time of each stage in order. counts : what each stage found.
    evidence : what the decision was made from; None when no pose was found.
    covariance : (6, 6) of turn [rad] and shift [m], camera axes. alternatives : distinct poses, best first.
    method : its name.
    """

    accepted: bool
    reason: str
    q_camera_from_target_wxyz: Optional[Array]
    t_camera_from_target_m: Optional[Array]
    confidence: float
    stages_ms: Dict[str, float] = field(default_factory=dict)
    counts: Dict[str, int] = field(default_factory=dict)
    evidence: Optional[Evidence] = None
    covariance: Optional[Array] = None
    alternatives: Tuple[Alternative, ...] = ()
    method: str = ""


@dataclass(frozen=True, eq=False)
class Craft:
    """What is prepared once from the model and the camera.

    Parameters
    ----------
    samples : points on the wireframe, ``spacing_m`` apart. occ : what hides them.
    figures : triads of the wireframe. tables : views of it, near and far.
    centre_m, radius_m : sphere that holds it. suns : it as the Sun may see it; None without faces.
    round : whether much of its outline lies on curved surfaces.
    """

    model: BoardModel
    camera: CameraIntrinsics
    samples: EdgeSamples
    spacing_m: float
    occ: Occluders
    figures: Chains
    tables: Tuple[ViewTable, ...]
    centre_m: Array
    radius_m: float
    suns: Optional[SunTable] = None
    round: bool = False

    @staticmethod
    def prepare(model: BoardModel, camera: CameraIntrinsics) -> Craft:
        """Tables of one target for one camera."""
        radius = model.radius_m
        spacing = radius / 30.0
        samples, occ = sample_edges(model, spacing), occluders(model)
        # perspective changes shapes near by: one table near, one far
        tables = tuple(build_views(model, samples, occ, d * radius) for d in (4.5, 14.0))
        curved = is_round(model)
        if model.outlines is not None and curved:
            tables = tuple(with_outlines(view, model.outlines, model.centre_m) for view in tables)
        suns = None if model.faces is None else SunTable.of(model.faces)
        if model.faces is not None and curved:
            model = replace(model, faces=model.faces.grouped(ROUND_STEPS))
        figures, centre = model_triads(model), model.centre_m
        return Craft(model, camera, samples, spacing, occ, figures, tables, centre, radius, suns, curved)


# Of poses that edges have not been asked about.
UNASKED = Support(0.0, 0.0, 0.0, 0.0, np.zeros(0, int))


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pose with its evidence, and the region and edges that gave it.

    Parameters
    ----------
    support : by edges; ``UNASKED`` where the first look proposed the pose.
    likely : logarithm of its likelihood by the first look over that of the best of its region; zero for others.
    """

    q: Array
    t: Array
    support: Support
    field: EdgeField
    region: Region
    likely: float = 0.0


class Frame:
    """A picture with its noise and background, and the record of its stages.

    Parameters
    ----------
    image : (H, W). noise : standard deviation.
    background : level of empty space, negative when it is not empty.
    likely : (h, w) map of the craft against a textured background, see target_map; None where it was not needed.
    trace : receives what ``keep`` is given; None costs nothing. drawn : what poses were drawn as on each canvas.
    """

    def __init__(self, image: Array, trace: Optional[Trace] = None) -> None:
        self.image = image
        self.trace = trace
        self.noise = 0.0
        self.background = -1.0
        self.likely: Optional[Array] = None
        # a second search begins with poses of the first: what was drawn for them, by canvas
        self.drawn: Dict[Any, Dict[Any, Any]] = {}
        self.stages_ms: Dict[str, float] = {}
        self.counts: Dict[str, int] = {}
        self._last = time.perf_counter()

    @cached_property
    def clipped(self) -> float:
        """Standard deviation of noise that is cut off at zero, 0 where none is."""
        # a limb or a coast with zeros beside it is no noise
        return min(clipped_noise(self.image), 1.25 * self.noise)

    def mark(self, stage: str) -> None:
        """Add the time since the last mark to ``stage``."""
        now = time.perf_counter()
        self.stages_ms[stage] = self.stages_ms.get(stage, 0.0) + 1e3 * (now - self._last)
        self._last = now

    def count(self, what: str, number: int) -> None:
        """Add to a counter."""
        self.counts[what] = self.counts.get(what, 0) + number

    @property
    def shows_all(self) -> bool:
        """Whether somebody asked for every stage, also those that the pose did not need."""
        return self.trace is not None and "every_stage" in self.trace

    def keep(self, what: str, value: Any) -> None:  # noqa: ANN401 - arrays, regions, segments
        """Keep what a stage found, where somebody looks."""
        if self.trace is not None:
            self.trace[what] = value
