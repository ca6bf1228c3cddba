"""Occluding contours of a target from all sides, which the wireframe's edges do not cover on curved bodies.

For a few hundred directions, the outer contour is sampled as points on the mesh, each with its outward normal and the
surface's radius of curvature along the line of sight. Seen from another direction, the contour of a smooth body slides
over it; sphere, cylinder and sharp edge all obey `p' = p + radius (n' - n)`, so a few views suffice.

References
----------
Koenderink (1984), What does the occluding contour tell us about solid shape? Perception 13 (radial curvature).
Cipolla and Giblin (2000), Visual Motion of Curves and Surfaces, section 3 (motion of the contour with the camera).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.spatial import cKDTree

from flyaround.simulator.geometry.directions import sphere_directions
from flyaround.simulator.runtime.arrays import BoolArray, ByteArray, FloatArray, IntArray

if TYPE_CHECKING:
    from flyaround.simulator.targets.model import Target

# Number of viewing directions, and of contour points for each. More follow the outline better, and enlarge the model.
VIEWS, POINTS = 200, 72

RANGE_RADII = 10.0
"""Range of the views [radii of the target]; the board corrects for other ranges."""

# Side of the rendered views [px].
SIZE_PX = 384

FILL_SHARE = 0.92
"""Share of the image covered by the target's bounding sphere."""

MAX_MATCH_PX = 1.6
"""Largest distance between a contour pixel and the mesh point that represents it [px]."""

CREASE_COSINE = float(np.cos(np.deg2rad(20.0)))
"""Cosine of the angle between corner normals beyond which two faces form a sharp edge."""

EDGE_STEP_PX = 0.7
"""Largest distance between points along an edge [px], half a pixel's diagonal: rounding leaves no gap."""

CANDIDATES = 12
"""Mesh points near a contour pixel among which the outermost is taken: some eight lie within MAX_MATCH_PX."""

TANGENT_PX = 3
"""Pixels to each side from which a contour's tangent follows; between neighbours it has eight directions only."""

# Structuring element of the morphological operations: 8-neighbourhood.
KERNEL = np.ones((3, 3), np.uint8)

MAX_RADIUS = 1.0
"""Largest radius of curvature [radii of the target]: flatter surfaces end at an edge first."""


@dataclass(frozen=True, eq=False, kw_only=True)
class OccludingContours:
    """Occluding contours from V directions, with N points each.

    Parameters
    ----------
    center_m : (3,) array
        Centre of the target [m].
    range_m : float
        Distance of the camera from the centre [m].
    directions : (V, 3) array
        Unit vectors from the centre to the camera, model frame.
    points_m : (V, N, 3) array
        Points evenly spaced along the contour [m].
    normals : (V, N, 3) array
        Outward unit normals, perpendicular to the line of sight.
    radius_m : (V, N) array
        Radius of curvature along the line of sight [m]; 0 at sharp edges.
    """

    center_m: FloatArray
    range_m: float
    directions: FloatArray
    points_m: FloatArray
    normals: FloatArray
    radius_m: FloatArray


@dataclass(frozen=True, eq=False)
class _Surface:
    """Surface as one mesh: triangles and the edges between them.

    ``corner_normals`` (F, 3, 3); ``ends`` (E, 2), vertices of each edge; ``faces`` (E, 2), its adjacent faces (twice
    the same at a ``rim``); ``smooth`` (E,), True if the faces' corner normals agree along the edge.
    """

    positions_m: FloatArray
    triangles: IntArray
    corner_normals: FloatArray
    face_normals: FloatArray
    face_offsets_m: FloatArray
    ends: IntArray
    faces: IntArray
    rim: BoolArray
    smooth: BoolArray


def outlines_of(target: Target, views: int = VIEWS, points: int = POINTS) -> OccludingContours:
    """Return the contours of a target from ``views`` directions spread evenly over the sphere."""
    surface = _surface(target)
    low, high = surface.positions_m.min(axis=0), surface.positions_m.max(axis=0)
    center = (low + high) / 2
    radius = float(np.linalg.norm(surface.positions_m - center, axis=1).max())
    directions = sphere_directions(views)
    rows = [_view(surface, center, radius, d, points) for d in directions]
    return OccludingContours(
        center_m=center,
        range_m=RANGE_RADII * radius,
        directions=directions,
        points_m=np.stack([r[0] for r in rows]),
        normals=np.stack([r[1] for r in rows]),
        radius_m=np.stack([r[2] for r in rows]),
    )


def _surface(target: Target) -> _Surface:
    """Return the surface with vertices welded by position within each part; touching bodies keep their own edges."""
    positions, triangles, normals, start = [], [], [], 0
    for part in target.parts:
        p = part.positions_m.astype(float)
        _, first, vertex_index = np.unique(np.round(p, 6), axis=0, return_index=True, return_inverse=True)
        positions.append(p[first])
        triangles.append(vertex_index.ravel()[part.triangles] + start)
        normals.append(part.normals.astype(float)[part.triangles])
        start += len(first)
    p, t, n = (np.concatenate(x) for x in (positions, triangles, normals))
    a, b = t.ravel(), np.roll(t, -1, axis=1).ravel()
    low, high = np.minimum(a, b), np.maximum(a, b)
    order = np.argsort(low * len(p) + high, kind="stable")
    key = (low * len(p) + high)[order]
    begin = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    count = np.diff(np.append(begin, len(key)))
    h0 = order[begin]
    h1 = np.where(count == 2, order[np.minimum(begin + 1, len(order) - 1)], h0)
    # corner normals at the start of a half-edge, and at the same position in the other face
    flat = n.reshape(-1, 3)
    across = np.where(a[h1] == a[h0], h1, 3 * (h1 // 3) + (h1 + 1) % 3)
    smooth = (np.einsum("ij,ij->i", flat[h0], flat[across]) > CREASE_COSINE) & (count == 2)
    normal = np.cross(p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]])
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    return _Surface(
        p,
        t,
        n,
        unit,
        np.einsum("ij,ij->i", unit, p[t[:, 0]]),
        np.stack([low[h0], high[h0]], axis=1),
        # Fortran order, because the columns are gathered separately
        np.asfortranarray(np.stack([h0 // 3, h1 // 3], axis=1)),
        h0 == h1,
        smooth,
    )


def _view(
    s: _Surface, center: FloatArray, radius: float, direction: FloatArray, count: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points, normals and radii of the contour from one direction."""
    eye = center + RANGE_RADII * radius * direction
    front = s.face_normals @ eye > s.face_offsets_m
    edge = np.flatnonzero((front[s.faces[:, 0]] != front[s.faces[:, 1]]) | s.rim)
    ends = s.positions_m[s.ends[edge]]
    axes = _camera(direction)
    focal = FILL_SHARE * SIZE_PX / 2 * np.sqrt(RANGE_RADII**2 - 1)
    pixels = _project(ends.reshape(-1, 3), eye, axes, focal).reshape(-1, 2, 2)
    # points along the edges, ends included
    steps = np.ceil(np.hypot(*(pixels[:, 1] - pixels[:, 0]).T) / EDGE_STEP_PX).astype(int) + 1
    owner = np.repeat(np.arange(len(edge)), steps)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(steps) - steps, steps)) / (steps[owner] - 1 + 1e-9)
    xy = pixels[owner, 0] + share[:, None] * (pixels[owner, 1] - pixels[owner, 0])
    filled = _fill_silhouette(xy)
    places, inward = _sample_outline(filled, count)
    border = cv2.dilate(filled, KERNEL) - cv2.erode(filled, KERNEL, iterations=2)
    x, y = np.rint(xy).astype(int).T
    outline = np.flatnonzero(border[y, x])
    owner, share, xy = owner[outline], share[outline], xy[outline]
    # the outermost mesh point near each contour pixel
    neighbours = cKDTree(xy).query(places, k=min(CANDIDATES, len(xy)))
    distance, near = (np.asarray(x).reshape(count, -1) for x in neighbours)
    depth = np.einsum("ijk,ik->ij", xy[near] - places[:, None], inward)
    limit = np.maximum(MAX_MATCH_PX, distance[:, :1] + 1e-9)
    pick = near[np.arange(count), np.argmin(np.where(distance <= limit, depth, np.inf), axis=1)]
    point = ends[owner[pick], 0] + share[pick, None] * (ends[owner[pick], 1] - ends[owner[pick], 0])
    normal, curvature_radius = _shape(s, edge[owner[pick]], front, point, share[pick], eye)
    return point, normal, np.clip(curvature_radius, 0.0, MAX_RADIUS * radius)


def _camera(direction: FloatArray) -> FloatArray:
    """Return axes (2, 3) perpendicular to a direction, right-handed with it."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    x = np.cross(helper, direction)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(direction, x)])


def _project(points: FloatArray, eye: FloatArray, axes: FloatArray, focal: float) -> FloatArray:
    """Return pixels (N, 2) of points in the square image, with the target's centre at its centre."""
    ray = points - eye
    depth = -ray @ np.cross(axes[0], axes[1])
    return np.asarray((ray @ axes.T) * (focal / depth)[:, None] + (SIZE_PX - 1) / 2)


def _fill_silhouette(xy: FloatArray) -> ByteArray:
    """Return the silhouette: all pixels that the edge points (P, 2) separate from the image border."""
    image = np.zeros((SIZE_PX, SIZE_PX), np.uint8)
    x, y = np.rint(xy).astype(int).T
    image[y, x] = 1
    mask = np.zeros((SIZE_PX + 2, SIZE_PX + 2), np.uint8)
    cv2.floodFill(image, mask, (0, 0), 2)
    return np.asarray((image != 2).astype(np.uint8))


def _sample_outline(filled: ByteArray, count: int) -> tuple[FloatArray, FloatArray]:
    """Return pixels (count, 2) evenly spaced along the contours, and unit vectors inwards (count, 2)."""
    outlines, _ = cv2.findContours(filled, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    loops = [c.reshape(-1, 2).astype(float) for c in outlines]
    length = [float(np.hypot(*(np.roll(c, -1, axis=0) - c).T).sum()) for c in loops]
    along = (np.arange(count) + 0.5) * sum(length) / count
    places, inwards, start = [], [], 0.0
    for loop, size in zip(loops, length, strict=True):
        step = np.hypot(*(np.roll(loop, -1, axis=0) - loop).T)
        indices = along[(along >= start) & (along < start + size)] - start
        k = np.searchsorted(np.cumsum(step) - step, indices, side="right") - 1
        places.append(loop[k])
        start += size
        # OpenCV traces outer contours with the inside on the left in image axes: rotate the tangent by 90 degrees
        tangent = np.roll(loop, -TANGENT_PX, axis=0)[k] - np.roll(loop, TANGENT_PX, axis=0)[k]
        inwards.append(np.stack([tangent[:, 1], -tangent[:, 0]], axis=1))
    inward = np.concatenate(inwards)[:count]
    return np.concatenate(places)[:count], inward / np.maximum(
        np.linalg.norm(inward, axis=1, keepdims=True), 1e-12
    )


def _shape(
    s: _Surface, edge: IntArray, front: BoolArray, point: FloatArray, share: FloatArray, eye: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return outward normals perpendicular to the line of sight, and radii of curvature along it, at contour points."""
    sight = eye - point
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    faces = s.faces[edge]
    nearer = np.where(front[faces[:, 0]], faces[:, 0], faces[:, 1])
    along = s.positions_m[s.ends[edge, 1]] - s.positions_m[s.ends[edge, 0]]
    sharp = np.cross(along, sight)
    # the visible face is inside the contour
    inside = s.positions_m[s.triangles[nearer]].mean(axis=1) - point
    sharp *= -np.sign(np.einsum("ij,ij->i", sharp, inside))[:, None]
    smooth = s.smooth[edge]
    normal = np.where(smooth[:, None], _blend_normals(s, edge, share), sharp)
    normal -= np.einsum("ij,ij->i", normal, sight)[:, None] * sight
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(size > 1e-12, normal / np.maximum(size, 1e-12), 0.0)
    curvature = np.mean([_curvature(s, faces[:, k], sight) for k in (0, 1)], axis=0)
    with np.errstate(divide="ignore"):
        radius = np.where(smooth & (curvature > 0), 1 / np.maximum(curvature, 1e-12), 0.0)
    return normal, np.asarray(radius)


def _blend_normals(s: _Surface, edge: IntArray, share: FloatArray) -> FloatArray:
    """Return the mean of both faces' normals, interpolated to the points."""
    total = np.zeros((len(edge), 3))
    for k in (0, 1):
        face = s.faces[edge, k]
        corners, normals = s.triangles[face], s.corner_normals[face]
        for end, weight in ((0, 1 - share), (1, share)):
            corner = np.argmax(corners == s.ends[edge, end][:, None], axis=1)
            total += weight[:, None] * normals[np.arange(len(edge)), corner]
    return total


def _curvature(s: _Surface, face: IntArray, sight: FloatArray) -> FloatArray:
    """Return the normal curvature [1/m] along the line of sight, from the corner normals of each face."""
    p, n = s.positions_m[s.triangles[face]], s.corner_normals[face]
    e1, e2 = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    g11, g12, g22 = (np.einsum("ij,ij->i", a, b) for a, b in ((e1, e1), (e1, e2), (e2, e2)))
    s1, s2 = np.einsum("ij,ij->i", sight, e1), np.einsum("ij,ij->i", sight, e2)
    area2 = np.maximum(g11 * g22 - g12 * g12, 1e-30)
    a, b = (g22 * s1 - g12 * s2) / area2, (g11 * s2 - g12 * s1) / area2
    tangent = a[:, None] * e1 + b[:, None] * e2
    change = a[:, None] * (n[:, 1] - n[:, 0]) + b[:, None] * (n[:, 2] - n[:, 0])
    length2 = np.maximum(np.einsum("ij,ij->i", tangent, tangent), 1e-30)
    return np.asarray(np.einsum("ij,ij->i", tangent, change) / length2)
