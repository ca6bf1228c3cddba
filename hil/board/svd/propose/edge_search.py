"""Search of one region: poses from perceptual groups and from templates, aligned and judged."""

from __future__ import annotations

from typing import List, Tuple

import cv2
import numpy as np

from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.hypotheses.edge_support import quick_cost, support
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.image.edge_field import EdgeField, edge_field, shrink
from hil.board.svd.image.line_segments import cleaned_stream, lsd_stream, wge_stream
from hil.board.svd.image.observation import Observation
from hil.board.svd.image.region import Region
from hil.board.svd.image.segment_merging import merge_segments
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.model.view_tables import ViewTable
from hil.board.svd.propose.correspondences import pose_hypotheses, stretch_arms
from hil.board.svd.propose.perceptual_groups import Chains, Lines, image_triads, proximity_pairs
from hil.board.svd.propose.templates import match_views
from hil.board.svd.refine.edges import align_to_field

Array = np.ndarray

# A region is searched with this margin (share of its diagonal): parts in shadow make it too small.
MARGIN = 0.3

# Longest side of the two edge fields [px].
COARSE_PX, FINE_PX = 170, 360

# Poses kept of the templates and of the perceptual groups for the first alignment.
TEMPLATE_POSES, GROUP_POSES = 240, 160

# Poses judged with exact visibility, where edges decide in the end and where the picture looks at eight.
EDGES_DECIDE, PICTURE_DECIDES = 48, 14

# Turns [deg, camera axes] and scales of the range at which alignment is started again.
NEIGHBOURS = (
    ((10.0, 0.0, 0.0), 1.0),
    ((-10.0, 0.0, 0.0), 1.0),
    ((0.0, 10.0, 0.0), 1.0),
    ((0.0, -10.0, 0.0), 1.0),
    ((0.0, 0.0, 0.0), 1.07),
    ((0.0, 0.0, 0.0), 0.93),
)

# Half turns about the model's x and y: a box upside down is a box.
HALF_TURNS = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


def search_region(
    craft: PreparedTarget, figures: Chains, frame: Observation, region: Region
) -> List[Candidate]:
    """Candidates of one region, the best first; ``figures`` are the triads of the wireframe."""
    h, w = frame.image.shape
    box = region.grown(MARGIN, w, h)
    coarse = edge_field(
        frame.image, box, frame.noise, COARSE_PX, background=frame.background, likely=frame.likely
    )
    fine = edge_field(
        frame.image, box, frame.noise, FINE_PX, background=frame.background, likely=frame.likely
    )
    frame.count("edge_pixels", int(coarse.mask.sum()))
    frame.mark("edges")
    if int(coarse.mask.sum()) < 20:
        return []
    depth = (craft.camera.fx_px + craft.camera.fy_px) * craft.radius_m / region.diagonal_px
    table = min(craft.tables, key=lambda v: abs(np.log(depth / v.distance_m)))
    q, t, _ = match_views(table, coarse, region, craft.camera, craft.centre_m, TEMPLATE_POSES)
    frame.mark("templates")
    gq, gt = poses_from_lines(craft, figures, frame, region, fine, coarse, table)
    q, t = np.concatenate([q, gq]), np.concatenate([t, gt])
    if not len(q):
        return []
    q, t = _align(craft, q, t, table, coarse, (14.0, 11.0), 2)
    q, t = distinct(q, t, _cost(craft, q, t, table, coarse, 8.0, 2), 130)
    q, t = _align(craft, q, t, table, coarse, (9.0, 7.0, 6.0), 2)
    q, t = distinct(q, t, _cost(craft, q, t, table, coarse, 6.0), 50)
    q, t = _align(craft, q, t, table, fine, (10.0, 8.0, 6.0, 5.0))
    keep = EDGES_DECIDE if craft.model.faces is None else PICTURE_DECIDES
    q, t = distinct(q, t, _cost(craft, q, t, table, fine, 6.0), keep)
    frame.mark("align")
    out = _judge(craft, q, t, fine, region)
    frame.mark("score")
    if craft.model.faces is not None:
        # the whole picture tells them apart from here on, twins and all
        frame.count("candidates", len(out))
        return out
    # the near-symmetries of the craft: the twin of a good pose must have its chance
    tq, tt = twins(craft, out[:3])
    nq, nt = neighbours(craft, out[:4])
    q, t = np.concatenate([tq, nq]), np.concatenate([tt, nt])
    if len(q):
        q, t = _align(craft, q, t, table, fine, (10.0, 8.0, 6.0, 5.0, 4.0))
        q, t = distinct(q, t, _cost(craft, q, t, table, fine, 6.0), 18)
        out += _judge(craft, q, t, fine, region)
        out.sort(key=lambda c: -c.support.total)
    frame.mark("twins")
    frame.count("candidates", len(out))
    return out


def poses_from_lines(
    craft: PreparedTarget,
    figures: Chains,
    frame: Observation,
    region: Region,
    fine: EdgeField,
    coarse: EdgeField,
    table: ViewTable,
) -> Tuple[Array, Array]:
    """Poses from perceptual groups of line segments, the best by the coarse field: q (N, 4), t (N, 3)."""
    h, w = frame.image.shape
    small, _ = shrink(frame.image, *region.grown(MARGIN, w, h), FINE_PX)
    diagonal = region.diagonal_px / fine.factor
    streams = [
        merge_segments(wge_stream(small, diagonal), diagonal),
        merge_segments(cleaned_stream(fine.mask, diagonal), diagonal),
        lsd_stream(cv2.GaussianBlur(small, (0, 0), 1.0), 0.04 * diagonal),
    ]
    frame.keep("streams", dict(zip(("WGE stream", "S&H stream", "LSD stream"), streams)))  # noqa: B905 - 3.9
    frame.keep("stream_field", fine)
    frame.mark("lines")
    lines = Lines.of(merge_segments(np.concatenate(streams), diagonal, keep=45))
    frame.mark("merge")
    chains = image_triads(lines, proximity_pairs(lines, 0.08 * diagonal))
    frame.keep("merged", lines)
    frame.keep("chains", chains)
    frame.count("lines", len(lines.length))
    frame.count("triads", len(chains.closed))
    frame.mark("groups")
    q, t = pose_hypotheses(
        stretch_arms(chains), figures.points, craft.camera, region, craft.centre_m, craft.radius_m, fine
    )
    frame.count("hypotheses", len(q))
    frame.mark("pnp")
    # thousands at a glance, the better ones at a second look
    for every, keep in ((10, 1200), (3, GROUP_POSES)):
        if len(q) > keep:
            top = np.argpartition(_cost(craft, q, t, table, coarse, 12.0, every), keep)[:keep]
            q, t = q[top], t[top]
    frame.mark("correspond")
    return q, t


def neighbours(craft: PreparedTarget, best: List[Candidate], share: float = 1.0) -> Tuple[Array, Array]:
    """Starts around good poses: edges lie in pairs, and an alignment may have locked on the wrong one."""
    q, t = [], []
    for c in best:
        centre = quat.matrix(c.q) @ craft.centre_m + c.t
        for turn, scale in NEIGHBOURS:
            q.append(quat.normalise(quat.multiply(quat.from_rotvec(share * np.radians(turn)), c.q)))
            t.append(centre * (1 + share * (scale - 1)) - quat.matrix(q[-1]) @ craft.centre_m)
    return np.array(q).reshape(-1, 4), np.array(t).reshape(-1, 3)


def distinct(q: Array, t: Array, cost: Array, keep: int) -> Tuple[Array, Array]:
    """The cheapest ``keep`` poses, near-duplicates dropped."""
    chosen: List[int] = []
    for i in np.argsort(cost):
        if not np.isfinite(cost[i]):
            continue
        if chosen:
            near = quat.angle_rad(q[chosen], q[i]) < 0.07
            near &= np.linalg.norm(t[chosen] - t[i], axis=1) < 0.03 * abs(t[i, 2])
            if near.any():
                continue
        chosen.append(int(i))
        if len(chosen) >= keep:
            break
    return q[chosen], t[chosen]


def twins(craft: PreparedTarget, best: List[Candidate]) -> Tuple[Array, Array]:
    """The poses a craft could be mistaken for: its near-symmetries, half turns, and the half turn of the picture."""
    q, t = [], []
    for c in best:
        centre = quat.matrix(c.q) @ craft.centre_m + c.t
        sight = np.concatenate([[0.0], centre / np.linalg.norm(centre)])
        others = [quat.multiply(c.q, s) for s in (*craft.model.symmetry_wxyz, *HALF_TURNS)]
        for other in (*others, quat.multiply(sight, c.q)):
            q.append(quat.normalise(other))
            # the twin's centre stays where it was seen
            t.append(centre - quat.matrix(q[-1]) @ craft.centre_m)
    return np.array(q).reshape(-1, 4), np.array(t).reshape(-1, 3)


def _align(
    craft: PreparedTarget,
    q: Array,
    t: Array,
    table: ViewTable,
    field: EdgeField,
    reach: Tuple[float, ...],
    every: int = 1,
) -> Tuple[Array, Array]:
    return align_to_field(
        q, t, craft.samples, table, field, craft.camera, craft.centre_m, craft.radius_m, reach, every
    )


def _cost(
    craft: PreparedTarget,
    q: Array,
    t: Array,
    table: ViewTable,
    field: EdgeField,
    cap_px: float,
    every: int = 1,
) -> Array:
    return quick_cost(q, t, craft.samples, table, field, craft.camera, craft.centre_m, cap_px, every)


def _judge(craft: PreparedTarget, q: Array, t: Array, field: EdgeField, region: Region) -> List[Candidate]:
    out = []
    for k in range(len(q)):
        s = support(q[k], t[k], craft.samples, craft.occ, field, craft.camera, craft.spacing_m)
        out.append(Candidate(q[k], t[k], s, field, region))
    out.sort(key=lambda c: -c.support.total)
    return out
