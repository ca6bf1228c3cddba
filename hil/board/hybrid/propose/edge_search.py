"""Pose hypotheses of one region from its edges: perceptual groups with PnP, and viewpoint templates.

The numbers of poses were tuned on development frames: docs/lab/2026-11-estimator.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.hypotheses.edge_support import quick_cost
from flyaround.hil.board.hybrid.image.edge_field import EdgeField, edge_field, shrink
from flyaround.hil.board.hybrid.image.line_segments import lsd_stream, thin_edge_stream, wge_stream
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.model.view_tables import ViewTable
from flyaround.hil.board.hybrid.propose.correspondences import pose_hypotheses, stretch_arms
from flyaround.hil.board.hybrid.propose.templates import match_views
from flyaround.hil.board.svd.perceptual_groups import Chains, Lines, image_triads, proximity_pairs
from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.board.svd.segment_merging import merge_segments

Array = np.ndarray

# Margin of a search region [share of its diagonal], because a region misses parts in shadow.
MARGIN = 0.3

# Longest side of the two edge fields [px].
COARSE_PX, FINE_PX = 170, 360

# Number of template poses and of perceptual-group poses kept for the first alignment.
TEMPLATE_POSES, GROUP_POSES = 240, 160

# Maximum number of lines, because the number of perceptual groups grows with its square.
MAX_LINES = 45

# Distance within which line ends meet in a corner, and minimum length of an LSD line [shares of the region's diagonal].
CORNER_REACH, MIN_LENGTH = 0.08, 0.04

# Minimum number of edge pixels of a region.
MIN_EDGE_PIXELS = 20

# Thousands of poses are ranked in two steps, each with its stride through the edge samples and number of poses kept.
RANKINGS = ((10, 1200), (3, GROUP_POSES))

# Distance at which the cost of an edge saturates during the ranking [field px].
RANK_CAP_PX = 12.0


@dataclass(frozen=True, eq=False)
class RegionEdges:
    """Edges of a region, and the target's views at the range that fits its size.

    Parameters
    ----------
    region : Region
        Image region.
    coarse : EdgeField
        Edges at the coarse scale.
    fine : EdgeField
        Edges at the fine scale.
    views : ViewTable
        Views at the range that follows from the region's size.
    """

    region: Region
    coarse: EdgeField
    fine: EdgeField
    views: ViewTable


def region_edges(target: PreparedTarget, frame: Observation, region: Region) -> Optional[RegionEdges]:
    """Return the edges of a region at two scales; None if there are too few."""
    h, w = frame.image.shape
    box = region.grown(MARGIN, w, h)
    coarse, fine = (
        edge_field(
            frame.image,
            box,
            frame.noise,
            px,
            background=frame.background,
            craft_probability=frame.craft_probability,
        )
        for px in (COARSE_PX, FINE_PX)
    )
    frame.count("edge_pixels", int(coarse.mask.sum()))
    frame.mark("edges")
    if int(coarse.mask.sum()) < MIN_EDGE_PIXELS:
        return None
    return RegionEdges(region, coarse, fine, views_for(target, target.camera, region))


def views_for(target: PreparedTarget, camera: CameraIntrinsics, region: Region) -> ViewTable:
    """Return the views nearest to the range that follows from a region's size."""
    depth = (camera.fx_px + camera.fy_px) * target.radius_m / region.diagonal_px
    return min(target.tables, key=lambda v: abs(np.log(depth / v.distance_m)))


def template_poses(target: PreparedTarget, frame: Observation, edges: RegionEdges) -> Tuple[Array, Array]:
    """Return poses q (N, 4), t (N, 3) of the viewpoint templates that fit a region best."""
    q, t, _ = match_views(
        edges.views, edges.coarse, edges.region, target.camera, target.centre_m, TEMPLATE_POSES
    )
    frame.mark("templates")
    return q, t


def group_poses(
    target: PreparedTarget, figures: Chains, frame: Observation, edges: RegionEdges
) -> Tuple[Array, Array]:
    """Return poses q (N, 4), t (N, 3) of perceptual groups of line segments, ranked on the coarse edges.

    Parameters
    ----------
    target : PreparedTarget
        Target with its precomputed tables.
    figures : Chains
        Triads of the wireframe, see ``model_triads``.
    frame : Observation
        Image with its noise and background.
    edges : RegionEdges
        Edges of the region.
    """
    region, fine, coarse = edges.region, edges.fine, edges.coarse
    h, w = frame.image.shape
    small, _ = shrink(frame.image, *region.grown(MARGIN, w, h), FINE_PX)
    diagonal = region.diagonal_px / fine.factor
    streams = [
        merge_segments(wge_stream(small, diagonal), diagonal),
        merge_segments(thin_edge_stream(fine.mask, diagonal), diagonal),
        lsd_stream(cv2.GaussianBlur(small, (0, 0), 1.0), MIN_LENGTH * diagonal),
    ]
    frame.keep("streams", dict(zip(("WGE stream", "S&H stream", "LSD stream"), streams)))  # noqa: B905 - 3.9
    frame.keep("stream_field", fine)
    frame.mark("lines")
    lines = Lines.from_segments(merge_segments(np.concatenate(streams), diagonal, keep=MAX_LINES))
    frame.mark("merge")
    chains = image_triads(lines, proximity_pairs(lines, CORNER_REACH * diagonal))
    frame.keep("merged", lines)
    frame.keep("chains", chains)
    frame.count("lines", len(lines.length))
    frame.count("triads", len(chains.closed))
    frame.mark("groups")
    q, t = pose_hypotheses(
        stretch_arms(chains), figures.points, target.camera, region, target.centre_m, target.radius_m, fine
    )
    frame.count("hypotheses", len(q))
    frame.mark("pnp")
    for stride, keep in RANKINGS:
        if len(q) > keep:
            cost = quick_cost(target, q, t, edges.views, coarse, RANK_CAP_PX, stride)
            top = np.argpartition(cost, keep)[:keep]
            q, t = q[top], t[top]
    frame.mark("correspondences")
    return q, t
