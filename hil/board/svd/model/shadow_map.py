"""Shadows that the craft casts on itself: it is painted once more, from the Sun."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.svd.geometry.faces import Faces
from flyaround.hil.board.svd.geometry.image_patch import ImagePatch
from flyaround.hil.board.svd.geometry.shading import Shading
from flyaround.hil.board.svd.geometry.vectors import cross, length
from flyaround.hil.board.svd.model.rasteriser import fill_faces, order_faces
from flyaround.hil.board.svd.native.backend import accelerated
from flyaround.hil.board.svd.native.raster import shadow_map as native

if TYPE_CHECKING:
    from flyaround.hil.board.svd.geometry.camera import CameraIntrinsics

Array = np.ndarray

# Side of the picture painted from the Sun [px].
MAP_PX = 256

# A face in light lies at most this far behind what the Sun sees, and twice the map's own pixel [m].
SKIN_M = 0.006

# Faces that the Sun grazes count as turned away: cosine.
GRAZING = 0.03

# Directions of the Sun that are tried, the side of each one's picture [px], and pixels that they are judged on.
DIRECTIONS, TABLE_PX, PIXELS = 240, 80, 700

# A pixel's deviation counts up to twice this: share of the deviation among all, and of the noise.
SPREAD, BOUND = 0.15, 4.0

# The Sun behind the craft lights nothing that is seen: least cosine between it and the way to the camera.
BEHIND = -0.6

AXES = np.eye(3)

# Least angle between two directions that are both proposed: cosine.
APART = float(np.cos(np.radians(15.0)))


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """The craft as the Sun sees it, an orthographic picture.

    Parameters
    ----------
    direction : (3,) unit vector to the Sun, target frame. axes : (2, 3) of the picture. origin : (2,) their values
        at its first pixel's middle [m]. pitch_m : of its pixels. height : (n, n) float32, of what is seen along
        ``direction`` [m], very low where nothing is. seen : (n, n) face + 1.
    """

    direction: Array
    axes: Array
    origin: Array
    pitch_m: float
    height: Array
    seen: Array

    @staticmethod
    def of(faces: Faces, direction: Array, n: int = MAP_PX) -> ShadowMap:
        """The craft painted from ``direction`` (3,), target frame."""
        s = direction / length(direction)
        e1 = cross(s, AXES[int(np.argmin(np.abs(s)))])
        e1 = e1 / length(e1)
        axes = np.stack([e1, cross(s, e1)])
        return ShadowMap(s, axes, *_seen_from_the_sun(faces, s, axes, n))

    @cached_property
    def packed(self) -> Tuple[Any, Tuple[Array, ...]]:
        """The picture as C takes it, and what keeps its arrays alive."""
        return native.packed_sun(
            np.vstack([self.axes, self.direction]), self.origin, self.pitch_m, self.height, self.seen
        )

    @accelerated(native.shadows)
    def shadows(
        self, faces: Faces, seen: Array, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
    ) -> Array:
        """(H, W) bool: drawn pixels that look at the Sun but lie behind something.

        Parameters
        ----------
        seen : drawn at the pose ``R``, ``t`` by ``draw_faces``. camera : a pinhole.
        """
        facing = np.concatenate([[False], faces.normals @ self.direction > GRAZING])
        where = np.flatnonzero(np.take(facing, seen))
        face, u, v, z = rays_to_faces(faces, seen, where, patch, camera, R, t)
        C = -R.T @ t
        frame = np.vstack([self.axes, self.direction])
        along = (frame @ R.T).astype(np.float32)
        a, b, c = ((k[0] * u + k[1] * v + k[2]) * z for k in along)
        start = frame @ C
        n = len(self.height)
        i = np.rint((a + np.float32(start[0] - self.origin[0])) / np.float32(self.pitch_m)).astype(np.intp)
        j = np.rint((b + np.float32(start[1] - self.origin[1])) / np.float32(self.pitch_m)).astype(np.intp)
        at = np.clip(j, 0, n - 1) * n + np.clip(i, 0, n - 1)
        over = np.take(self.height.ravel(), at) - (c + np.float32(start[2]))
        hidden = (over > SKIN_M + 2 * self.pitch_m) & (np.take(self.seen.ravel(), at) != face + 1)
        out = np.zeros(seen.size, bool)
        out[where[hidden]] = True
        return out.reshape(seen.shape)


@dataclass(frozen=True, eq=False)
class ShadowMapTable:
    """The craft as seen from all round, to find where the Sun stands by the shadows on the picture.

    Parameters
    ----------
    directions : (S, 3) unit vectors, target frame. frames : (3, S, 3) axes of each picture and its direction.
    origin : (S, 2), pitch_m : (S,), height : (S, n, n) float32, as in ShadowMap.
    painted : what ``sunlight`` has painted until now; no answer hangs on it.
    """

    directions: Array
    frames: Array
    origin: Array
    pitch_m: Array
    height: Array
    painted: Dict[Tuple[int, int], ShadowMap] = field(default_factory=dict)

    @staticmethod
    def of(faces: Faces, number: int = DIRECTIONS) -> ShadowMapTable:
        """Pictures from ``number`` directions spread evenly (Fibonacci lattice)."""
        i = np.arange(number) + 0.5
        z, turn = 1.0 - 2.0 * i / number, np.pi * (1.0 + np.sqrt(5.0)) * i
        r = np.sqrt(1.0 - z * z)
        directions = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1)
        suns = [ShadowMap.of(faces, d, TABLE_PX) for d in directions]
        return ShadowMapTable(
            directions,
            np.stack([np.vstack([s.axes, s.direction]) for s in suns], axis=1),
            np.array([s.origin for s in suns]),
            np.array([s.pitch_m for s in suns]),
            np.array([s.height for s in suns]),
        )

    def find(
        self,
        faces: Faces,
        shading: Shading,
        patch: ImagePatch,
        camera: CameraIntrinsics,
        R: Array,
        t: Array,
        number: int = 1,
        pixels: int = PIXELS,
    ) -> List[int]:
        """Which of the directions of the Sun explain the picture best by their shadows, the best first.

        Each group of faces has one brightness in light and one in shadow, both from the picture, so nothing
        is asked of materials; what tells directions apart is the shape of the shadows alone.

        Parameters
        ----------
        shading : drawn at the pose ``R``, ``t``. camera : a pinhole. number : directions at most; none where too
            little of the craft is seen. pixels : looked at, at most.
        """
        side = self.directions @ (-R.T @ t) / length(t)
        some = np.flatnonzero(side > BEHIND)
        costs = self._costs(faces, shading, patch, camera, R, t, some, pixels)
        if costs is None:
            return []
        out: List[int] = []
        for k in some[np.argsort(costs)].tolist():
            if all(self.directions[k] @ self.directions[better] < APART for better in out):
                out.append(k)
            if len(out) >= number:
                break
        return out

    def _costs(
        self,
        faces: Faces,
        shading: Shading,
        patch: ImagePatch,
        camera: CameraIntrinsics,
        R: Array,
        t: Array,
        some: Array,
        pixels: int,
    ) -> Optional[Array]:
        """(S,) what each of the directions ``some`` (S,) leaves unexplained; None where too little is seen."""
        # shot noise grows with the root of the light: in its root all noise is alike
        dim = max(2.0 * patch.full / 255.0, patch.sigma)
        if "darkest" not in patch.kept:
            patch.kept["darkest"] = float(np.min(patch.gray))
        darkest = patch.kept["darkest"]
        return self._unexplained(faces, shading, patch, camera, R, t, some, pixels, darkest, float(dim))

    @accelerated(native.sun_costs)
    def _unexplained(
        self,
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
    ) -> Optional[Array]:
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
        lit = self._lit(faces, face, X, some)
        value = np.sqrt(np.maximum(patch.gray[y, x] - darkest, 0.0) + dim)
        own = np.unique(faces.group[face], return_inverse=True)[1].ravel()
        return _cost(value, own, lit)

    @cached_property
    def packed(self) -> Tuple[Any, Tuple[Array, ...]]:
        """The table as C takes it, and what keeps its arrays alive."""
        return native.packed_table(self.frames, self.origin, self.pitch_m, self.height)

    def sunlight(self, faces: Faces, k: int, n: int) -> ShadowMap:
        """The craft painted ``n`` pixels wide from direction ``k``, once for all pictures."""
        if (k, n) not in self.painted:
            sun = ShadowMap.of(faces, self.directions[k], n)
            kind = np.uint16 if len(faces.corners) < np.iinfo(np.uint16).max else np.int32
            self.painted[k, n] = replace(sun, seen=sun.seen.astype(kind))
        return self.painted[k, n]

    def _lit(self, faces: Faces, face: Array, X: Array, some: Array) -> Array:
        """(S, P) bool: whether points ``X`` (P, 3) on faces (P,) are in the light of the directions ``some``."""
        n = self.height.shape[1]
        points = X.astype(np.float32)
        pitch = self.pitch_m[some, None]
        at = []
        for axis in (0, 1):
            along = self.frames[axis, some].astype(np.float32) @ points.T
            k = (along - self.origin[some, axis, None].astype(np.float32)) / pitch.astype(np.float32)
            at.append(np.clip(np.rint(k), 0, n - 1).astype(np.int32))
        index = at[1] * n + at[0] + (some * n * n).astype(np.int32)[:, None]
        over = np.take(self.height.ravel(), index) - self.frames[2, some].astype(np.float32) @ points.T
        facing = np.take(self.directions[some] @ faces.normals.T > GRAZING, face, axis=1)
        return np.asarray(facing & (over < (SKIN_M + 2 * pitch).astype(np.float32)))


@accelerated(native.seen_from_the_sun)
def _seen_from_the_sun(faces: Faces, s: Array, axes: Array, n: int) -> Tuple[Array, float, Array, Array]:
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
) -> Tuple[Array, Array, Array, Array]:
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
