"""The published methods from picture to pose: WGE, region, two Hough streams, groups, PnP, ranking, refinement."""

from __future__ import annotations

from typing import List, NamedTuple, Tuple

import numpy as np

from flyaround.hil.board.svd.base import Estimator, PoseResult, decided
from flyaround.hil.board.svd.decide.selection import select_by_edges
from flyaround.hil.board.svd.geometry import quaternion as quat
from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics
from flyaround.hil.board.svd.hypotheses.ambiguity import alternatives, differs
from flyaround.hil.board.svd.hypotheses.edge_support import quick_cost, support
from flyaround.hil.board.svd.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.svd.image.edge_field import edge_field, shrink
from flyaround.hil.board.svd.image.noise import noise_sigma
from flyaround.hil.board.svd.image.observation import Observation
from flyaround.hil.board.svd.image.region import Region
from flyaround.hil.board.svd.image.weak_gradients import WeakGradientElimination, eliminate_weak_gradients
from flyaround.hil.board.svd.model.prepared_target import PreparedTarget
from flyaround.hil.board.svd.model.target_model import BoardModel
from flyaround.hil.board.svd.native.library import library
from flyaround.hil.board.svd.propose.edge_search import FINE_PX, MARGIN, views_for
from flyaround.hil.board.svd.propose.regions import REDUCTION, propose_regions
from flyaround.hil.board.svd.published.corners import (
    CornerMap,
    corner_map,
    model_corners,
    plausible,
    refine_on_corners,
    reprojection,
)
from flyaround.hil.board.svd.published.correspondence_search import solve_all
from flyaround.hil.board.svd.published.ellipses import circle_poses, model_circles
from flyaround.hil.board.svd.published.line_streams import Streams, cdf_box, find_streams
from flyaround.hil.board.svd.published.point_groups import PointGroups, image_point_groups, model_point_groups
from flyaround.hil.board.svd.published.settings import PublishedConfig
from flyaround.hil.board.svd.refine.final_edges import refine_on_edges

Array = np.ndarray

# Regions of ours searched at most, and the least diagonal of one [px].
REGIONS, SMALLEST_PX = 3, 24.0

# The papers decide by reprojection error: a pose stands when this share of the picture's corners is met, and the
# next distinct pose has at least this much larger an error.
LEAST_INLIERS, ERROR_RATIO = 0.5, 1.15

# Corners met that a decision takes at least: four points are any plane figure's.
LEAST_CORNERS = 7

# Where the frame cuts a line is no corner: ends this near its border do not count [px].
BORDER_PX = 2.5


class ScoredPose(NamedTuple):
    """A pose after Gauss-Newton on corners.

    Parameters
    ----------
    error : reprojection error over its cap. q, t : (4,), (3,). covariance : (6, 6). inliers : share of the image's
        corners that the model's meet. met : their number.
    """

    error: float
    q: Array
    t: Array
    covariance: Array
    inliers: float
    met: float


class PublishedEstimator(Estimator):
    """A published method, keeping nothing between pictures.

    Parameters
    ----------
    model, camera : as ``Estimator``. config : which method, and any step from it towards ours.
    """

    def __init__(self, model: BoardModel, camera: CameraIntrinsics, config: PublishedConfig) -> None:
        super().__init__(model, camera)
        self.config, self.method = config, config.name
        self.groups = model_point_groups(model)
        self.corners = model_corners(model)
        self.circles = model_circles(model) if "ellipse" in config.streams else ()
        # the tables of ours are dear: only where a step towards ours asks for them
        ours = config.rank == "edges" or config.finish == "edges" or bool(self.circles)
        if ours:
            library()
        self.craft = PreparedTarget.prepare(model, camera) if ours else None

    def _estimate(self, frame: Observation) -> PoseResult:
        image = np.asarray(frame.image, np.float32)
        full_scale = 255.0 if frame.image.dtype == np.uint8 else float(image.max())
        frame.noise = max(noise_sigma(frame.image, full_scale), 0.15 * full_scale / 255)
        frame.mark("noise")
        wge = eliminate_weak_gradients(image, blur_px=1.5)
        frame.keep("image_gradient", wge)
        frame.mark("weak_gradients")
        regions = self._regions(frame, wge)
        frame.keep("regions", regions)
        frame.count("regions", len(regions))
        frame.mark("regions")
        found: List[ScoredPose] = []
        hypotheses: List[Hypothesis] = []
        for region in regions:
            if region.diagonal_px >= SMALLEST_PX:
                self._search(frame, image, wge, region, found, hypotheses)
        if self.config.finish == "edges":
            return self._finish_on_edges(frame, hypotheses)
        return self._finish_on_corners(frame, found)

    def _regions(self, frame: Observation, wge: WeakGradientElimination) -> List[Region]:
        if self.config.regions == "cdf":
            return [cdf_box(wge)]
        small, _ = shrink(
            frame.image, 0, 0, frame.image.shape[1], frame.image.shape[0], max(frame.image.shape) // REDUCTION
        )
        regions, _, _ = propose_regions(small, eliminate_weak_gradients(small), frame.noise / REDUCTION)
        return regions[:REGIONS]

    def _search(
        self,
        frame: Observation,
        image: Array,
        wge: WeakGradientElimination,
        region: Region,
        found: List[ScoredPose],
        hypotheses: List[Hypothesis],
    ) -> None:
        """Lines, groups, poses by PnP and their ranking in one region, added to what was found in others."""
        streams = self._streams(frame, image, wge, region)
        region = streams.region
        groups = image_point_groups(streams.lines, region.diagonal_px)
        frame.keep("point_groups", groups)
        for kind, points in groups.by_kind.items():
            frame.count(kind, len(points))
        frame.mark("groups")
        q, t = self._poses(frame, groups, streams)
        points = _picture_corners(groups, streams, image.shape)
        if not len(q) or not len(points):
            return
        image_corners = corner_map(points, region)
        if self.config.rank == "edges" or (self.circles and streams.ellipses):
            hypotheses += self._rank_on_edges(frame, q, t, region)
            frame.mark("rank")
            q = np.array([c.q for c in hypotheses]).reshape(-1, 4)
            t = np.array([c.t for c in hypotheses]).reshape(-1, 3)
        else:
            q, t = self._rank_on_corners(q, t, image_corners)
            frame.mark("rank")
        if self.config.finish == "corners" and len(q):
            found += self._refine(q, t, image_corners, region)
            frame.mark("refine")
        elif self.config.rank == "corners":
            hypotheses += self._judge(frame, q, t, region)

    def _streams(
        self, frame: Observation, image: Array, wge: WeakGradientElimination, region: Region
    ) -> Streams:
        """Line streams, ellipses and corners of a region."""
        streams = find_streams(image, wge, region, self.config)
        frame.keep("published_streams", streams)
        frame.keep("published_region", streams.region)
        frame.count("lines", len(streams.lines))
        frame.count("ellipses", len(streams.ellipses))
        frame.mark("lines")
        return streams

    def _poses(self, frame: Observation, groups: PointGroups, streams: Streams) -> Tuple[Array, Array]:
        """Plausible poses q (N, 4), t (N, 3) of pairs of groups, and of pairs of circles and ellipses."""
        q, t, solved = solve_all(groups, self.groups, self.camera, self.config)
        if self.circles and streams.ellipses:
            cq, ct = circle_poses(streams.ellipses, self.circles, self.camera)
            q, t = np.concatenate([q, cq]), np.concatenate([t, ct])
        frame.count("pairs", solved)
        frame.count("hypotheses", len(q))
        frame.mark("pnp")
        if len(q):
            ok = plausible(q, t, self.model, self.camera, streams.region)
            q, t = q[ok], t[ok]
        return q, t

    def _rank_on_corners(self, q: Array, t: Array, image: CornerMap) -> Tuple[Array, Array]:
        """The best few by reprojection error (2018) or by inliers (RANSAC, thesis), distinct ones."""
        error, inliers = reprojection(q, t, self.corners, self.camera, image)
        key = error / image.cap_px - (inliers if self.config.ransac else 0.0)
        chosen: List[int] = []
        for k in np.argsort(key, kind="stable")[:400]:
            if all(
                quat.angle_rad(q[c], q[k]) > 0.05 or np.linalg.norm(t[c] - t[k]) > 0.02 * t[k, 2]
                for c in chosen
            ):
                chosen.append(int(k))
            if len(chosen) >= self.config.top:
                break
        return q[chosen], t[chosen]

    def _refine(self, q: Array, t: Array, image: CornerMap, region: Region) -> List[ScoredPose]:
        """Each pose after Gauss-Newton, those that drifted away dropped."""
        q, t, covariance = refine_on_corners(q, t, self.corners, self.camera, image, self.model.radius_m)
        ok = plausible(q, t, self.model, self.camera, region)
        q, t, covariance = q[ok], t[ok], covariance[ok]
        error, inliers = reprojection(q, t, self.corners, self.camera, image)
        share = error / image.cap_px
        met = inliers * len(image.points)
        return [
            ScoredPose(float(share[k]), q[k], t[k], covariance[k], float(inliers[k]), float(met[k]))
            for k in range(len(q))
        ]

    def _finish_on_corners(self, frame: Observation, found: List[ScoredPose]) -> PoseResult:
        if not found:
            return self._declined(frame, "no target found")
        found.sort(key=lambda f: f.error)
        error, q, t, covariance, inliers, met = found[0]
        rival = min((f.error for f in found if differs(f.q, f.t, q, t)), default=1.0)
        sure = float(np.clip(inliers * min(1.0, (rival / max(error, 1e-6) - 1.0) / 0.6), 0.0, 1.0))
        reason = ""
        if inliers < LEAST_INLIERS or met < LEAST_CORNERS:
            reason = "too few of the picture's corners are met"
        elif rival < ERROR_RATIO * error:
            reason = "ambiguous: another pose explains the corners as well"
        frame.mark("decision")
        return PoseResult(
            not reason,
            reason,
            q,
            t,
            sure,
            frame.stages_ms,
            frame.counts,
            None,
            covariance,
            alternatives([(f.q, f.t, -f.error) for f in found], q, t),
            self.method,
        )

    def _rank_on_edges(self, frame: Observation, q: Array, t: Array, region: Region) -> List[Hypothesis]:
        """The best by our support of the whole model, ``top`` of them."""
        assert self.craft is not None  # noqa: S101 - made in __init__ for every such config
        craft = self.craft
        field = edge_field(frame.image, region.grown(MARGIN, *frame.image.shape[::-1]), frame.noise, FINE_PX)
        table = views_for(craft, self.camera, region)
        cost = np.concatenate(
            [
                quick_cost(
                    q[k : k + 500],
                    t[k : k + 500],
                    craft.samples,
                    table,
                    field,
                    self.camera,
                    craft.centre_m,
                    10.0,
                    3,
                )
                for k in range(0, len(q), 500)
            ]
        )
        best = np.argsort(cost, kind="stable")[: self.config.top]
        return self._judge(frame, q[best], t[best], region)

    def _judge(self, frame: Observation, q: Array, t: Array, region: Region) -> List[Hypothesis]:
        assert self.craft is not None  # noqa: S101 - made in __init__ for every such config
        craft = self.craft
        field = edge_field(frame.image, region.grown(MARGIN, *frame.image.shape[::-1]), frame.noise, FINE_PX)
        out = []
        for k in range(len(q)):
            s = support(q[k], t[k], craft.samples, craft.occ, field, self.camera, craft.spacing_m)
            out.append(Hypothesis(PoseFit(q[k], t[k]), Source(region, field), s.total, s))
        return out

    def _finish_on_edges(self, frame: Observation, hypotheses: List[Hypothesis]) -> PoseResult:
        if not hypotheses or self.craft is None:
            return self._declined(frame, "no target found")
        hypotheses.sort(key=lambda h: -h.score)
        refined = refine_on_edges(self.craft, frame, hypotheses)
        chosen = select_by_edges(self.craft, hypotheses, refined)
        frame.mark("refine")
        return decided(frame, chosen.best.pose, chosen.evidence, chosen.alternatives, method=self.method)


def _picture_corners(groups: PointGroups, streams: Streams, shape: Tuple[int, ...]) -> Array:
    """(N, 2) corners and line ends inside a picture of ``shape``, near-duplicates dropped."""
    parts = [groups.of("proximity_pair")[:, 1], streams.lines.reshape(-1, 2), streams.corners]
    points = np.concatenate([np.zeros((0, 2)), *parts])
    last = np.array([shape[1] - 1.0, shape[0] - 1.0])
    points = points[((points >= BORDER_PX) & (points <= last - BORDER_PX)).all(axis=1)]
    same = np.abs(points[:, None] - points[None]).max(axis=2) <= 2.0
    kept = np.zeros(len(points), bool)
    for k in range(len(points)):
        kept[k] = not (same[k] & kept).any()
    return np.asarray(points[kept])
