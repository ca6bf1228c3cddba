"""Slender round pieces of a mesh (antennas, struts, booms) as an axis with a radius."""

from __future__ import annotations

import itertools

import numpy as np

from flyaround.simulator.geometry.topology import MeshBody, edge_table, face_bodies
from flyaround.simulator.geometry.triangles import face_vectors
from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, vec3
from flyaround.simulator.targets.model import Edge

MIN_SLENDERNESS = 5.0
"""Ratio of length to radius above which a round piece is a rod."""
MAX_ROUNDNESS_SPREAD = 0.25
"""Largest relative spread of the surface's distance from the axis. Tapered and faceted rods are below, bars above."""
MAX_RADIUS, MIN_LENGTH = 0.05, 0.03
"""Largest radius and least length of a rod, as shares of the craft."""
MIN_SIDE_SHARE = 0.6
"""Share of a piece's area that faces away from its axis; a disc or a ball has less."""
MIN_NORMAL_RATIO = 0.35
"""Smallest ratio of the second moments of the side's normals: 1 for a cylinder or a square bar, 0 for a thin strip."""
MAX_SURFACE_DISTANCE = 1.6
"""Distance from a rod's axis [radii] within which an edge lies on the rod, if it tapers to less than two thirds."""
MIN_FACES = 12  # faces of one rod, fewer of which are ignored


def find_rods(body: MeshBody, extent: float) -> list[Edge]:
    """Return the connected pieces that are rods."""
    count, label = face_bodies(body.triangles, edge_table(body.triangles))
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(count + 1))
    rods = []
    for first, last in itertools.pairwise(ends.tolist()):
        if last - first >= MIN_FACES:
            rod = _rod(body.positions_m[body.triangles[order[first:last]]], extent)
            if rod is not None:
                rods.append(rod)
    return rods


def _rod(corners: FloatArray, extent: float) -> Edge | None:
    twice_area = np.linalg.norm(face_vectors(corners), axis=1)
    middle = corners.mean(axis=1)
    weight = twice_area / twice_area.sum()
    center = weight @ middle
    weighted_offsets = (middle - center) * np.sqrt(weight)[:, None]
    axis = np.linalg.svd(weighted_offsets, full_matrices=False)[2][0]
    points = corners.reshape(-1, 3) - center
    position = points @ axis
    length = float(np.ptp(position))
    # leave out end caps, which do not constrain the radius
    normal = face_vectors(corners) / np.maximum(twice_area, 1e-300)[:, None]
    is_side = np.abs(normal @ axis) < 0.5
    if not is_side.any() or weight[is_side].sum() < MIN_SIDE_SHARE:
        return None
    from_axis = points - position[:, None] * axis
    distance = np.linalg.norm(from_axis, axis=1).reshape(-1, 3)[is_side].mean(axis=1)
    area_share = weight[is_side] / weight[is_side].sum()
    radius = float(area_share @ distance)
    if length < MIN_SLENDERNESS * radius or length < MIN_LENGTH * extent or radius > MAX_RADIUS * extent:
        return None
    if np.sqrt(area_share @ (distance - radius) ** 2) > MAX_ROUNDNESS_SPREAD * radius:
        return None
    # a round piece has normals in all directions about the axis, a flat bar does not
    normal_moments = np.einsum("ij,ik,i->jk", normal[is_side], normal[is_side], area_share)
    moments = np.linalg.eigvalsh(normal_moments)
    if moments[1] < MIN_NORMAL_RATIO * moments[2]:
        return None
    a, b = center + position.min() * axis, center + position.max() * axis
    return Edge(name="rod", a_m=vec3(a), b_m=vec3(b), radius_m=radius)


def along_rods(rods: list[Edge], a_m: FloatArray, b_m: FloatArray) -> BoolArray:
    """Return a mask (K,) of segments along the surface of a rod, which the rod's own outline represents."""
    is_on_any_rod = np.zeros(len(a_m), bool)
    for rod in rods:
        start = np.asarray(rod.a_m)
        chord = np.asarray(rod.b_m) - start
        length = float(np.linalg.norm(chord))
        is_on_rod = np.ones(len(a_m), bool)
        for p in (a_m, b_m):
            position = (p - start) @ chord / length
            distance = np.linalg.norm(p - start - position[:, None] * chord / length, axis=1)
            is_on_rod &= (
                (distance < MAX_SURFACE_DISTANCE * rod.radius_m)
                & (position > -rod.radius_m)
                & (position < length + rod.radius_m)
            )
        is_on_any_rod |= is_on_rod
    return is_on_any_rod
