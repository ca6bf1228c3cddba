"""Published pipeline from an image to a pose and its acceptance; each stage is a function of its own module.

Sharma, Ventura & D'Amico (2018), sections on image processing and pose determination. Choices that the paper and the
thesis leave open are made in the stages' files and described in docs/svd.md.
"""

from __future__ import annotations

from typing import List, NamedTuple, Tuple

import numpy as np

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.estimator import Estimator
from flyaround.hil.board.estimation.record import StageRecord
from flyaround.hil.board.estimation.result import PoseResult, alternatives, differs
from flyaround.hil.board.estimation.target_model import BoardModel
from flyaround.hil.board.svd.correspondence import solve_all
from flyaround.hil.board.svd.ellipses import circle_poses, model_circles
from flyaround.hil.board.svd.line_streams import Streams, find_streams
from flyaround.hil.board.svd.perceptual_groups import PointGroups, image_point_groups
from flyaround.hil.board.svd.refinement import (
    CornerMap,
    corner_map,
    model_corners,
    plausible,
    refine_on_corners,
    reprojection,
)
from flyaround.hil.board.svd.region_of_interest import Region, cdf_box
from flyaround.hil.board.svd.settings import PublishedConfig
from flyaround.hil.board.svd.weak_gradients import eliminate_weak_gradients
from flyaround.hil.board.svd.wireframe_groups import model_point_groups

Array = np.ndarray

# Blur before weak gradient elimination [px], and smallest diagonal of a region that is searched [px].
BLUR_PX, SMALLEST_PX = 1.5, 24.0

# The papers decide by reprojection error: a pose is accepted if it explains at least this share of the image's corners,
# and the error of the next distinct pose is larger by at least this factor.
MIN_INLIERS, ERROR_RATIO = 0.5, 1.15

# Excess of the next distinct pose's error that gives full confidence, chosen by hand.
FULL_LEAD = 0.6

# Minimum number of matched corners for acceptance, because four points fit any planar figure.
MIN_CORNERS = 7

# Corners within this distance are one [px]: the ends of merged lines scatter by as much.
SAME_CORNER_PX = 2.0

# Distance from the image border within which line ends are ignored, because the border cuts lines [px].
MIN_BORDER_PX = 2.5

# Number of poses compared for distinctness, and their minimum differences [rad, share of the range]. Poses that differ
# by less count as one.
RANKED_POSES, DISTINCT_RAD, DISTINCT_SHARE = 400, 0.05, 0.02


class ScoredPose(NamedTuple):
    """A pose after Gauss-Newton on corners.

    Parameters
    ----------
    error : float
        Mean reprojection error over its truncation distance.
    q : (4,) array
        Attitude quaternion, camera from target.
    t : (3,) array
        Target position, camera frame [m].
    covariance : (6, 6) array
        Covariance of rotation [rad] and translation [m], camera axes.
    inliers : float
        Share of the image's corners matched by corners of the model.
    met : float
        Number of matched corners.
    """

    error: float
    q: Array
    t: Array
    covariance: Array
    inliers: float
    met: float


class PublishedEstimator(Estimator):
    """Published method; keeps no state between images.

    Parameters
    ----------
    model : BoardModel
        Model of the target.
    camera : CameraIntrinsics
        Intrinsics of every image.
    config : PublishedConfig
        Settings of the variant.
    """

    def __init__(self, model: BoardModel, camera: CameraIntrinsics, config: PublishedConfig) -> None:
        super().__init__(model, camera)
        self.config, self.method = config, config.name
        self.groups = model_point_groups(model)
        self.corners = model_corners(model)
        self.circles = model_circles(model) if "ellipse" in config.streams else ()

    def _estimate(self, frame: StageRecord) -> PoseResult:
        image = np.asarray(frame.image, np.float32)
        wge = eliminate_weak_gradients(image, BLUR_PX)
        frame.keep("image_gradient", wge)
        frame.mark("weak_gradients")
        region = cdf_box(wge.strong)
        frame.keep("regions", [region])
        frame.count("regions", 1)
        frame.mark("regions")
        if region.diagonal_px < SMALLEST_PX:
            return self._declined(frame, "no target found")
        streams = find_streams(image, wge, region, self.config)
        frame.keep("published_streams", streams)
        frame.keep("published_region", streams.region)
        frame.count("lines", len(streams.lines))
        frame.count("ellipses", len(streams.ellipses))
        frame.mark("lines")
        return self.from_streams(frame, streams)

    def from_streams(self, frame: StageRecord, streams: Streams) -> PoseResult:
        """Return the pose from the features of an image: every stage after the line streams."""
        groups = image_point_groups(streams.lines, streams.region.diagonal_px)
        frame.keep("point_groups", groups)
        for kind, points in groups.by_kind.items():
            frame.count(kind, len(points))
        frame.mark("groups")
        q, t = self._poses(frame, groups, streams)
        frame.keep_poses("pnp", q, t)
        corners = image_corners(groups, streams, frame.image.shape)
        if not len(q) or not len(corners):
            return self._declined(frame, "no target found")
        image = corner_map(corners, streams.region)
        q, t = self._rank(q, t, image)
        frame.keep_poses("rank", q, t)
        frame.mark("rank")
        refined = self._refine(q, t, image, streams.region)
        frame.keep_poses("refine", np.array([f.q for f in refined]), np.array([f.t for f in refined]))
        frame.mark("refine")
        return self._decide(frame, refined)

    def _poses(self, frame: StageRecord, groups: PointGroups, streams: Streams) -> Tuple[Array, Array]:
        """Return plausible poses q (N, 4), t (N, 3) of pairs of groups, and of pairs of circles and ellipses."""
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

    def _rank(self, q: Array, t: Array, image: CornerMap) -> Tuple[Array, Array]:
        """Return the best distinct poses, by reprojection error (2018) or by inliers (RANSAC, thesis)."""
        error, inliers = reprojection(q, t, self.corners, self.camera, image)
        key = error / image.cap_px - (inliers if self.config.ransac else 0.0)
        indices: List[int] = []
        for k in np.argsort(key, kind="stable")[:RANKED_POSES]:
            if all(
                quat.angle_rad(q[c], q[k]) > DISTINCT_RAD
                or np.linalg.norm(t[c] - t[k]) > DISTINCT_SHARE * t[k, 2]
                for c in indices
            ):
                indices.append(int(k))
            if len(indices) >= self.config.top:
                break
        return q[indices], t[indices]

    def _refine(self, q: Array, t: Array, image: CornerMap, region: Region) -> List[ScoredPose]:
        """Return each pose after Gauss-Newton; poses that diverged are dropped."""
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

    def _decide(self, frame: StageRecord, refined: List[ScoredPose]) -> PoseResult:
        """Return the pose of least reprojection error, accepted if the error is small and the pose unambiguous."""
        if not refined:
            return self._declined(frame, "no target found")
        best = min(refined, key=lambda f: f.error)
        rival = min((f.error for f in refined if differs(f.q, f.t, best.q, best.t)), default=1.0)
        lead = (rival / max(best.error, 1e-6) - 1.0) / FULL_LEAD
        reason = ""
        if best.inliers < MIN_INLIERS or best.met < MIN_CORNERS:
            reason = "too few of the picture's corners are matched"
        elif rival < ERROR_RATIO * best.error:
            reason = "ambiguous: another pose explains the corners equally well"
        frame.mark("decision")
        return PoseResult(
            not reason,
            reason,
            best.q,
            best.t,
            float(np.clip(best.inliers * min(1.0, lead), 0.0, 1.0)),
            frame.stages_ms,
            frame.counts,
            covariance=best.covariance,
            alternatives=alternatives([(f.q, f.t, -f.error) for f in refined], best.q, best.t),
            method=self.method,
        )


def image_corners(groups: PointGroups, streams: Streams, shape: Tuple[int, ...]) -> Array:
    """Return corners and line ends (N, 2) inside an image of ``shape``, without near-duplicates."""
    parts = [groups.of_kind("proximity_pair")[:, 1], streams.lines.reshape(-1, 2), streams.corners]
    points = np.concatenate([np.zeros((0, 2)), *parts])
    last = np.array([shape[1] - 1.0, shape[0] - 1.0])
    points = points[((points >= MIN_BORDER_PX) & (points <= last - MIN_BORDER_PX)).all(axis=1)]
    is_equal = np.abs(points[:, None] - points[None]).max(axis=2) <= SAME_CORNER_PX
    isolated = np.zeros(len(points), bool)
    for k in range(len(points)):
        isolated[k] = not (is_equal[k] & isolated).any()
    return np.asarray(points[isolated])
