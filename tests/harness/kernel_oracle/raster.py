"""The rasteriser, shadows and hidden edges in numpy: what the compiled library must compute."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.hil.board.hybrid.model.shadow_map import BOUND, GRAZING, SPREAD
from flyaround.hil.board.hybrid.model.visibility import SKIN_M, hidden

if TYPE_CHECKING:
    from flyaround.hil.board.estimation.camera import CameraIntrinsics
    from flyaround.hil.board.estimation.faces import Faces
    from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
    from flyaround.hil.board.hybrid.geometry.shading import Shading
    from flyaround.hil.board.hybrid.geometry.wireframe import EdgeSamples, OccludingTriangles
    from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap, ShadowMapTable

Array = np.ndarray

# What OpenCV's polygon filling adds on every side [px]: with it the drawn area is the true one.
BORDER_PX = 0.48

# Width below which what is drawn is too wide all the same [px].
NARROW_PX = 1.2


def order_faces(faces: Faces, C_m: Array) -> Array:
    """Faces that look at the camera centre ``C_m`` (3,), the farthest first."""
    gain, base, ids, node = painting_places(faces)
    side = (faces.plane[:, :3] @ C_m > faces.plane[:, 3]).astype(np.float32)
    keep = (faces.normals @ C_m > faces.offset)[ids]
    ids, rank = ids[keep], (gain @ side + base)[node[keep]]
    middle = faces.middles[ids] - C_m
    far_first = -np.einsum("ij,ij->i", middle, middle)
    # within a leaf by distance; faces on the plane of a node lie beside each other
    return np.asarray(ids[np.lexsort((far_first, rank))])


def draw_faces(
    faces: Faces,
    order: Array,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    patch: ImagePatch,
    least_px: float = 0.5,
) -> Array:
    """(h * fine, w * fine) int32: number of the face seen + 1, 0 where there is none.

    Parameters
    ----------
    order : faces to draw, the farthest first. least_px : smaller ones are left to their neighbours [drawn px^2].
    """
    h, w = patch.gray.shape
    p = camera.pixels(faces.corners[order] @ R.T + t)
    p = (p - (patch.x0, patch.y0) + 0.5) * patch.scale - 0.5
    return fill_faces(p, order, (h * patch.fine, w * patch.fine), least_px, exact=patch.exact)


def fill_faces(
    p: Array, order: Array, shape: tuple[int, int], least_px: float, *, exact: bool = False
) -> Array:
    """Convex polygons ``p`` (P, 4, 2) filled one over the other with their number in ``order`` + 1.

    Parameters
    ----------
    exact : whether those narrower than a pixel get their true area.
    """
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    worth = np.abs(d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]) > 2.0 * least_px
    p, order = inset(shortened(p[worth]) if exact else p[worth]), order[worth]
    seen = np.zeros(shape, np.int32)
    polygons = np.rint(np.clip(p, -3000, 3000) * 16).astype(np.int32)
    fill, line = cv2.fillConvexPoly, cv2.LINE_8
    for polygon, number in zip(polygons, (order + 1).tolist()):  # noqa: B905 - Python 3.9 has no strict=
        fill(seen, polygon, number, line, 4)
    return seen


def shortened(p: Array) -> Array:
    """(P, 4, 2) convex polygons, narrow ones made shorter so that they cover what they should.

    OpenCV draws nothing narrower than a pixel. The rims of plates lie along the craft's outline as such strips: drawn
    a pixel wide each they make the craft larger by a tenth of a pixel all round, and its range longer.
    """
    (ax, ay), (bx, by) = (p[:, 2] - p[:, 0]).T, (p[:, 3] - p[:, 1]).T
    first, second = ax * ax + ay * ay, bx * bx + by * by
    squared = np.maximum(np.maximum(first, second), 1e-12)
    area = 0.5 * np.abs(ax * by - ay * bx)
    narrow = np.flatnonzero(area * area < NARROW_PX**2 * squared)
    if not len(narrow):
        return p
    some, length = p[narrow], np.sqrt(squared[narrow])
    width = area[narrow] / length
    longer = (first > second)[narrow]
    ux, uy = (
        np.where(longer, ax[narrow], bx[narrow]) / length,
        np.where(longer, ay[narrow], by[narrow]) / length,
    )
    # the width drawn after ``inset``, measured at all angles
    share = width / (0.98 + 0.19 * width) - 1.0
    along = some[..., 0] * ux[:, None] + some[..., 1] * uy[:, None]
    away = share[:, None] * (along - 0.25 * along.sum(axis=1, keepdims=True))
    out = p.copy()
    out[narrow, :, 0] += away * ux[:, None]
    out[narrow, :, 1] += away * uy[:, None]
    return out


def inset(p: Array) -> Array:
    """(P, 4, 2) convex polygons made smaller by what OpenCV adds to them: it fills the border's pixels too."""
    x, y = np.ascontiguousarray(p[..., 0]), np.ascontiguousarray(p[..., 1])
    ex, ey = x[:, [1, 2, 3, 0]] - x, y[:, [1, 2, 3, 0]] - y
    squared = ex * ex + ey * ey
    length = np.sqrt(squared)
    # unit normals to the left of each side, and of the side before it
    scale = 1.0 / np.maximum(length, 1e-9)
    ax, ay = -ey * scale, ex * scale
    bx, by = ax[:, [3, 0, 1, 2]], ay[:, [3, 0, 1, 2]]
    three = np.flatnonzero(squared[:, 2] < 1e-12)
    # a triangle's last corner is there twice: its two sides are the ones before and after both
    bx[three, 3], by[three, 3] = ax[three, 1], ay[three, 1]
    ax[three, 2], ay[three, 2] = ax[three, 3], ay[three, 3]
    d1, d2 = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    twice = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    far = np.sign(twice) * np.minimum(BORDER_PX, 0.4 * np.abs(twice) / np.maximum(length.sum(axis=1), 1e-9))
    share = far[:, None] / np.maximum(1 + ax * bx + ay * by, 0.3)
    out = np.empty_like(p)
    out[..., 0], out[..., 1] = x + (ax + bx) * share, y + (ay + by) * share
    return out


def painting_places(faces: Faces) -> tuple[Array, Array, Array, Array]:
    """Place of each node in the order, far to near: ``gain`` (N, N) times its sides plus ``base`` (N,).

    A node comes after its far subtree, and everything in its near one after both: how many that are depends
    on the side of each node above it alone, so that the whole tree is walked by one product of a matrix.
    Then the faces of all nodes, and the node of each.
    """
    n = len(faces.children)
    size, above = np.ones(n), np.full(n, -1)
    for node in range(n - 1, -1, -1):
        # children come after their parents in the list
        for child in faces.children[node]:
            if child >= 0:
                size[node] += size[child]
                above[child] = node
    sizes = np.append(size, 0.0)[faces.children]
    gain, base = np.zeros((n, n), np.float32), np.zeros(n, np.float32)
    for node in range(n):
        parent = above[node]
        if parent >= 0:
            gain[node], base[node] = gain[parent], base[parent]
            in_front = faces.children[parent, 0] == node
            # the parent's own share: what its far subtree holds
            gain[node, parent] = sizes[parent, 1] + 1 if in_front else -sizes[parent, 0] - 1
            base[node] += (0 if in_front else sizes[parent, 0] + 1) - sizes[parent, 0]
        gain[node, node] = sizes[node, 1] - sizes[node, 0]
        base[node] += sizes[node, 0]
    reached = np.flatnonzero((above >= 0) | (np.arange(n) == 0))
    ids = np.concatenate([faces.members[k] for k in reached])
    owner = np.repeat(reached, [len(faces.members[k]) for k in reached])
    return gain, base, ids, owner


def seen_from_the_sun(faces: Faces, s: Array, axes: Array, n: int) -> tuple[Array, float, Array, Array]:
    """Origin, pitch, heights (n, n) and faces + 1 (n, n) of the map along a direction (3,) with axes (2, 3)."""
    order = order_faces(faces, s * 1e6)
    p = faces.corners[order] @ axes.T
    low, high = p.min(axis=(0, 1)), p.max(axis=(0, 1))
    pitch = float((high - low).max() / (n - 4))
    origin = low - 1.5 * pitch
    seen = fill_faces((p - origin) / pitch, order, (n, n), 0.5)
    # the plane n.X = d at X = axes' point + height * s
    slope = faces.normals @ s
    slope = np.where(slope > 1e-3, slope, np.inf)
    top = np.concatenate([[-1e3], faces.offset / slope]).astype(np.float32)
    fall = -(faces.normals @ axes.T) / slope[:, None]
    fall = np.concatenate([[[0.0, 0.0]], fall]).astype(np.float32)
    x = (origin[0] + pitch * np.arange(n)).astype(np.float32)
    y = (origin[1] + pitch * np.arange(n)).astype(np.float32)
    height = np.take(top, seen) + np.take(fall[:, 0], seen) * x + np.take(fall[:, 1], seen) * y[:, None]
    return origin, pitch, height, seen


def shadows(
    sun: ShadowMap, faces: Faces, seen: Array, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> Array:
    """(H, W) bool: drawn pixels that look at the Sun but lie behind something.

    Parameters
    ----------
    seen : drawn at the pose ``R``, ``t`` by ``draw_faces``. camera : a pinhole.
    """
    facing = np.concatenate([[False], faces.normals @ sun.direction > GRAZING])
    where = np.flatnonzero(np.take(facing, seen))
    face, u, v, z = rays_to_faces(faces, seen, where, patch, camera, R, t)
    C = -R.T @ t
    frame = np.vstack([sun.axes, sun.direction])
    along = (frame @ R.T).astype(np.float32)
    a, b, c = ((k[0] * u + k[1] * v + k[2]) * z for k in along)
    start = frame @ C
    n = len(sun.height)
    i = np.rint((a + np.float32(start[0] - sun.origin[0])) / np.float32(sun.pitch_m)).astype(np.intp)
    j = np.rint((b + np.float32(start[1] - sun.origin[1])) / np.float32(sun.pitch_m)).astype(np.intp)
    at = np.clip(j, 0, n - 1) * n + np.clip(i, 0, n - 1)
    over = np.take(sun.height.ravel(), at) - (c + np.float32(start[2]))
    hidden = (over > SKIN_M + 2 * sun.pitch_m) & (np.take(sun.seen.ravel(), at) != face + 1)
    out = np.zeros(seen.size, bool)
    out[where[hidden]] = True
    return out.reshape(seen.shape)


def sun_costs(
    table: ShadowMapTable,
    faces: Faces,
    shading: Shading,
    patch: ImagePatch,
    camera: CameraIntrinsics,
    R: Array,
    t: Array,
    some: Array,
    pixels: int,
    darkest: float,
    dim: float,
) -> Array | None:
    """The same, given the least value of the patch and a brightness that is as good as none."""
    f, wide = patch.fine, shading.seen.shape[1]
    y, x = np.nonzero(shading.area[shading.centre] * (shading.centre > 0) > 0)
    if len(y) > pixels:
        few = np.linspace(0, len(y) - 1, pixels).astype(int)
        y, x = y[few], x[few]
    if len(y) < 40:
        return None
    where = (y * f + f // 2) * wide + x * f + f // 2
    face, u, v, z = rays_to_faces(faces, shading.seen, where, patch, camera, R, t)
    X = (np.stack([u * z, v * z, z], axis=-1) - t) @ R
    lit = _lit(table, faces, face, X, some)
    value = np.sqrt(np.maximum(patch.gray[y, x] - darkest, 0.0) + dim)
    own = np.unique(faces.group[face], return_inverse=True)[1].ravel()
    return _cost(value, own, lit)


def _lit(table: ShadowMapTable, faces: Faces, face: Array, X: Array, some: Array) -> Array:
    """(S, P) bool: whether points ``X`` (P, 3) on faces (P,) are in the light of the directions ``some``."""
    n = table.height.shape[1]
    points = X.astype(np.float32)
    pitch = table.pitch_m[some, None]
    at = []
    for axis in (0, 1):
        along = table.frames[axis, some].astype(np.float32) @ points.T
        k = (along - table.origin[some, axis, None].astype(np.float32)) / pitch.astype(np.float32)
        at.append(np.clip(np.rint(k), 0, n - 1).astype(np.int32))
    index = at[1] * n + at[0] + (some * n * n).astype(np.int32)[:, None]
    over = np.take(table.height.ravel(), index) - table.frames[2, some].astype(np.float32) @ points.T
    facing = np.take(table.directions[some] @ faces.normals.T > GRAZING, face, axis=1)
    return np.asarray(facing & (over < (SKIN_M + 2 * pitch).astype(np.float32)))


def _cost(value: Array, own: Array, lit: Array) -> Array:
    """(S,) what two levels for each group leave of values (P,), for each of S divisions ``lit`` (S, P)."""
    # sums by group are products of matrices: values are single, for all that is asked of them is an order
    value, light = value.astype(np.float32), lit.astype(np.float32)
    member = (own[:, None] == np.arange(int(own.max()) + 1)).astype(np.float32)
    number, total = light @ member, light @ (member * value[:, None])
    all_number, all_total = member.sum(axis=0), value @ member
    floor = float(np.quantile(value, 0.1))
    bright = total / np.maximum(number, 1.0)
    dark = (all_total - total + floor) / (all_number - number + 1.0)
    # a shadow brighter than the light is none
    mean = all_total / all_number
    wrong = (number > 0) & (number < all_number) & (bright < dark)
    bright, dark = np.where(wrong, mean, np.maximum(bright, floor)), np.where(wrong, mean, dark)
    level = np.where(lit, np.take(bright, own, axis=1), np.take(dark, own, axis=1))
    scale = SPREAD * float(np.std(value)) + 0.2
    away = (value - level) * np.float32(1.0 / scale)
    return np.asarray(np.minimum(away * away, np.float32(BOUND)).mean(axis=1))


def rays_to_faces(
    faces: Faces, seen: Array, where: Array, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
) -> tuple[Array, Array, Array, Array]:
    """Face, normalised coordinates and depth of drawn pixels ``where`` (flat indices), all (N,).

    Parameters
    ----------
    camera : a pinhole. R, t : camera from target.
    """
    face = np.take(seen.ravel(), where) - 1
    # a remainder costs ten times what this does
    y = where // seen.shape[1]
    x = where - y * seen.shape[1]
    u, v = (a.astype(np.float32) for a in patch.rays(camera))
    u, v = np.take(u, x), np.take(v, y)
    # a plane n.X = d in the camera's frame has the inverse depth n.ray / d
    n_c = faces.normals @ R.T
    d_c = faces.offset + n_c @ t
    inverse = (n_c / np.where(np.abs(d_c) > 1e-9, d_c, 1e-9)[:, None]).astype(np.float32)
    near = np.take(inverse[:, 0], face) * u + np.take(inverse[:, 1], face) * v + np.take(inverse[:, 2], face)
    return face, u, v, 1.0 / np.maximum(near, np.float32(0.2 / max(t[2], 1e-3)))


def visible_samples(samples: EdgeSamples, occ: OccludingTriangles, C_m: Array) -> tuple[Array, Array]:
    """(S,) visible and (S,) outline flags from camera centre ``C_m`` (3,), target frame."""
    idx = np.arange(len(samples))[None]
    X = samples.outline(idx, C_m[None])[0][0]
    visible, outline = facing(samples, C_m, X)
    where = np.flatnonzero(visible)
    # a round member's own skin is as thick as itself
    skin = SKIN_M + 1.5 * np.abs(samples.radius_m[where])
    visible[where[hidden(occ, C_m, X[where], skin)]] = False
    return visible, outline


def facing(samples: EdgeSamples, C_m: Array, X_m: Array) -> tuple[Array, Array]:
    """Whether each sample can face the camera, and whether it is an outline (one face seen, one not)."""
    d = C_m - X_m
    d = d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9)
    dots = np.einsum("skj,sj->sk", samples.normals, d)
    seen = (dots > 0.02).sum(axis=1)
    visible = (seen > 0) | (samples.faces == 0)
    outline = (samples.faces == 0) | ((samples.faces == 2) & (seen == 1))
    return visible, outline


def mean_pixel(seen: Array) -> Array:
    """(2,) mean column and row of the pixels that show the target; NaN where none does."""
    rows, columns = np.nonzero(seen)
    return np.array([columns.mean(), rows.mean()]) if len(rows) else np.full(2, np.nan)
