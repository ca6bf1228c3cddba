"""Check of the wireframe: edges by name and position, and their visibility against rays."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.check.geometry import in_lens, project_with_opencv
from flyaround.simulator.dataset.check.ray_casting import RayOracle, ray_oracle
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Edge, Target

# Distance in front of a visible edge up to which a surface does not contradict its label: absolute [m], and relative to
# the depth. Larger ones overlook wrong labels, smaller ones report edges that lie a little inside their surface.
HIDING_MARGIN_M, HIDING_MARGIN_SHARE = 5e-3, 2e-4

# The same from a rod's axis [radii], in addition.
ROD_ROOT_RADII = 2.5

# Minimum depth of a checked edge [m].
MIN_DEPTH_M = 0.05

# Minimum length of a checked interval [px].
MIN_INTERVAL_PX = 6.0
MAX_INTERVALS = 60  # stretches of edges that are tested per frame
# Margins of being visible within which either label is accepted: depth [m], and cosine of the angle to a face's normal.
VISIBILITY_MARGIN_M, FACING_MARGIN = 1e-3, 0.02

ROD_RADIUS_MARGIN = 1.15
"""Radii around a rod's axis within which a surface counts as the rod's own, even if it tapers."""

END_ON_COSINE = 0.985
"""Cosine of the angle between a rod and the line of sight, above which the rod's own cap hides it (10 degrees)."""


def check_wireframe(truth: Truth, target: Target) -> list[str]:
    """Check edges by name and position, and the midpoints of visible and hidden intervals against rays."""
    if "wireframe" not in truth.layers:
        return ["edges are listed though the wireframe was not asked for"] if truth.wireframe else []
    pose = Pose.from_arrays("camera", "target", truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m)
    in_front = [
        e for e in target.wireframe if pose.apply(np.array([e.a_m, e.b_m]))[:, 2].min() >= MIN_DEPTH_M
    ]
    if [e.name for e in in_front] != [w.name for w in truth.wireframe]:
        return ["the wireframe's edges are not the target's"]
    faults, caster = [], ray_oracle(target, pose)
    n_tested = 0
    order = np.random.default_rng([truth.seed, truth.frame_index, 0xED6E]).permutation(len(in_front))
    # all rods, which are few and thin; a different selection of the other edges in every frame
    for number in sorted(order.tolist(), key=lambda k: in_front[k].radius_m == 0):
        edge, wire = in_front[number], truth.wireframe[number]
        ends = np.array([edge.a_m, edge.b_m])
        projected = project_with_opencv(
            truth.camera, ends, truth.q_camera_from_target_wxyz, np.asarray(pose.t_m)
        )
        error = np.abs(projected - np.array(wire.ends_px))[in_lens(truth.camera, pose.apply(ends))]
        # rounding of float64 in JSON, which grows with the coordinate
        if np.any(error > 1e-6 * max(1.0, np.abs(projected).max() / 1e3)):
            faults.append(f"edge {wire.name} is {error.max():.3g} px from its projection")
            continue
        bounds = [0.0, *(x for interval in wire.visible for x in interval), 1.0]
        if bounds != sorted(bounds):
            faults.append(
                f"edge {wire.name} has stretches {wire.visible} that are not in order within 0 to 1"
            )
            continue
        length = float(np.hypot(*(projected[1] - projected[0])))
        for k, (a, b) in enumerate(itertools.pairwise(bounds)):
            if (b - a) * length < MIN_INTERVAL_PX or n_tested >= MAX_INTERVALS:
                continue
            n_tested += 1
            is_visible, middle = k % 2 == 1, (a + b) / 2
            if not _interval_agrees(caster, pose, edge, middle, is_visible=is_visible):
                word = "seen" if is_visible else "hidden"
                faults.append(f"edge {wire.name} is {word} at {middle:.3f} of it, which a ray contradicts")
    return faults


def _interval_agrees(caster: RayOracle, pose: Pose, edge: Edge, share: float, *, is_visible: bool) -> bool:
    """Return True if the point at a share of the projected edge is visible or hidden as labelled."""
    ends = pose.apply(np.array([edge.a_m, edge.b_m]))
    z = ends[:, 2]
    # shares of the projection, divided by depth, are shares of the edge
    along = share / z[1] / ((1 - share) / z[0] + share / z[1])
    point = ends[0] + along * (ends[1] - ends[0])
    hits = caster.hits(point[:2] / point[2])
    if edge.radius_m > 0:
        return _rod_agrees(hits.z_m, edge.radius_m, ends, point, is_visible=is_visible)
    nearest = float(hits.z_m[0]) if len(hits.z_m) else np.inf
    if is_visible:
        return nearest > point[2] - (HIDING_MARGIN_M + HIDING_MARGIN_SHARE * float(point[2]))
    # hidden: by a surface in front of it, or because all its faces face away
    facing = [float(pose.R @ np.asarray(n) @ -point) / float(np.linalg.norm(point)) for n in edge.normals]
    return nearest < point[2] - VISIBILITY_MARGIN_M or max(facing, default=1.0) < FACING_MARGIN


def _rod_agrees(
    hits_z_m: FloatArray, radius_m: float, ends: FloatArray, point: FloatArray, *, is_visible: bool
) -> bool:
    """Return True if a point of a rod's axis is visible or hidden as labelled, ignoring the rod's own surface.

    Surfaces in front of the axis are distinguished from the rod itself by their distance from the axis.
    """
    rod_axis = (ends[1] - ends[0]) / max(float(np.linalg.norm(ends[1] - ends[0])), 1e-12)
    if abs(float(rod_axis @ point)) > END_ON_COSINE * float(np.linalg.norm(point)):
        return True
    before = hits_z_m[hits_z_m < point[2] - VISIBILITY_MARGIN_M]
    points = before[:, None] * (point / point[2])
    distance_m = np.linalg.norm(np.cross(points - ends[0], rod_axis), axis=1)
    if is_visible:
        margin_m = HIDING_MARGIN_M + ROD_ROOT_RADII * radius_m + HIDING_MARGIN_SHARE * float(point[2])
        return not np.any(distance_m > margin_m)
    return bool(np.any(distance_m > ROD_RADIUS_MARGIN * radius_m + VISIBILITY_MARGIN_M))
