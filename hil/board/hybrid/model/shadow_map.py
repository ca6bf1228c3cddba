"""Shadows that the craft casts on itself, by shadow maps (Williams 1978)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.estimation.vectors import cross, length, sphere_directions
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.native_faces import native_faces
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.image_formation import pinhole_view
from flyaround.hil.board.hybrid.model.rasteriser import fill_faces, order_faces
from flyaround.hil.board.hybrid.native.interface import STRUCTURES, contiguous
from flyaround.hil.board.hybrid.native.library import library

if TYPE_CHECKING:
    from flyaround.hil.board.estimation.camera import CameraIntrinsics

Array = np.ndarray

# Side of a shadow map [px].
MAP_PX = 256

# Least number of points on the craft for a search of the Sun.
LEAST_POINTS = 40

# Candidate directions of the Sun, side of each one's shadow map [px], and image pixels that they are compared on.
DIRECTIONS, TABLE_PX, PIXELS = 240, 80, 700

# Least cosine between the Sun and the direction to the camera: the Sun behind the craft lights nothing that is seen.
BEHIND = -0.6

AXES = np.eye(3)

NO_MEMORY = "no memory for the Sun's pictures"

# Largest cosine of the angle between two directions that are both proposed.
APART = float(np.cos(np.radians(15.0)))


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """Orthographic view of the craft from the Sun.

    Parameters
    ----------
    direction : (3,) array
        Unit vector to the Sun, target frame.
    axes : (2, 3) array
        Axes of the map, target frame.
    origin : (2,) array
        Coordinates of the first pixel's centre along them [m].
    pitch_m : float
        Size of a pixel [m].
    height : (n, n) array
        Height of the visible surface along ``direction``, float32 [m]; very low where there is none.
    seen : (n, n) array
        Face + 1.
    native : Structure
        The map in the layout of the native library.
    """

    direction: Array
    axes: Array
    origin: Array
    pitch_m: float
    height: Array
    seen: Array
    native: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(self.height)
        kind = "uint16" if self.seen.dtype == np.uint16 else "int32"
        seen = contiguous(self.seen, kind, (n, n))
        native = STRUCTURES["sun"](
            axes=np.vstack([self.axes, self.direction]),
            at=np.array([*self.origin, self.pitch_m]),
            height=contiguous(self.height, "float32", (n, n)),
            seen=seen,
            side=n,
            bytes=seen.itemsize,
        )
        object.__setattr__(self, "native", native)

    @staticmethod
    def of(faces: Faces, direction: Array, n: int = MAP_PX) -> ShadowMap:
        """Draw the map from ``direction`` (3,), target frame, ``n`` pixels wide."""
        s = direction / length(direction)
        e1 = cross(s, AXES[int(np.argmin(np.abs(s)))])
        e1 = e1 / length(e1)
        axes = np.stack([e1, cross(s, e1)])
        return ShadowMap(s, axes, *_seen_from_the_sun(faces, s, axes, n))

    def shadows(
        self, faces: Faces, seen: Array, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
    ) -> Array:
        """Return True for drawn pixels (H, W) that face the Sun but lie in shadow.

        Parameters
        ----------
        faces : Faces
            Faces of the target.
        seen : (H, W) array
            Faces drawn at the pose by ``draw_faces``.
        patch : ImagePatch
            Its patch.
        camera : CameraIntrinsics
            A pinhole.
        R, t : (3, 3), (3,) array
            The pose, camera from target.
        """
        h, w = seen.shape
        R, t, dark = contiguous(R, "float64", (3, 3)), contiguous(t, "float64", (3,)), np.zeros((h, w), bool)
        view = pinhole_view(camera, patch)
        if library().fly_shadows(native_faces(faces), self.native, view, R, t, seen, h, w, dark):
            raise MemoryError(NO_MEMORY)
        return dark


@dataclass(frozen=True, eq=False)
class ShadowMapTable:
    """Shadow maps from all directions, to find the Sun by the shadows on the image.

    Parameters
    ----------
    directions : (S, 3) array
        Unit vectors, target frame.
    frames : (3, S, 3) array
        Two axes and the direction of each map.
    origin, pitch_m, height : (S, 2), (S,), (S, n, n) array
        See `ShadowMap`.
    native : Structure
        The maps in the layout of the native library.
    painted : dict
        Cache of ``sunlight``.
    """

    directions: Array
    frames: Array
    origin: Array
    pitch_m: Array
    height: Array
    native: Any = field(init=False, repr=False)
    painted: Dict[Tuple[int, int], ShadowMap] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count, side = self.height.shape[:2]
        native = STRUCTURES["sun_table"](
            frames=contiguous(self.frames, "float64", (3, count, 3)),
            origin=contiguous(self.origin, "float64", (count, 2)),
            pitch=contiguous(self.pitch_m, "float64", (count,)),
            height=contiguous(self.height, "float32", (count, side, side)),
            directions=count,
            side=side,
        )
        object.__setattr__(self, "native", native)

    @staticmethod
    def of(faces: Faces, number: int = DIRECTIONS) -> ShadowMapTable:
        """Draw the maps of ``number`` directions on a Fibonacci lattice."""
        directions = sphere_directions(number)
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
        """Return the directions of the Sun whose shadows explain the image best, the best first.

        Each group of faces has one brightness in light and one in shadow, both measured on the image, so that no
        materials are needed: the shape of the shadows alone decides.

        Parameters
        ----------
        faces : Faces
            Faces of the target.
        shading : Shading
            View at the pose.
        patch : ImagePatch
            Reduced region of the image around the target.
        camera : CameraIntrinsics
            A pinhole.
        R, t : (3, 3), (3,) array
            The pose, camera from target.
        number : int
            Most directions to return; there are none if too little of the craft is visible.
        pixels : int
            Most image pixels to compare.
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
        """Return the residual (S,) of each of the directions ``some`` (S,); None if too little is visible."""
        # shot noise grows with the square root of the light: the root has uniform noise
        dim = max(2.0 * patch.full / 255.0, patch.sigma)
        good = shading.area > 0
        good[0] = False
        (h, w), f = patch.gray.shape, patch.fine
        kind = "uint8" if shading.centre.dtype == np.uint8 else "uint16"
        centre = contiguous(shading.centre, kind, (h, w))
        picture = STRUCTURES["sun_image"](
            seen=contiguous(shading.seen, "int32", (h * f, w * f)),
            centre=centre,
            good=good,
            gray=contiguous(patch.gray, "float32"),
            group=contiguous(faces.group, "int64"),
            h=h,
            w=w,
            fine=f,
            groups=faces.groups,
            labels=len(good),
            bytes=centre.itemsize,
            darkest=float(np.min(patch.gray)),
        )
        some, out = contiguous(some, "int64"), np.empty(len(some))
        R, t = contiguous(R, "float64", (3, 3)), contiguous(t, "float64", (3,))
        view = pinhole_view(camera, patch)
        points = library().fly_sun_costs(
            native_faces(faces), self.native, picture, view, R, t, float(dim), pixels, some, len(some), out
        )
        if points < 0:
            raise MemoryError(NO_MEMORY)
        return out if points >= LEAST_POINTS else None

    def sunlight(self, faces: Faces, k: int, n: int) -> ShadowMap:
        """Return the map of direction ``k``, ``n`` pixels wide, drawn once for all images."""
        if (k, n) not in self.painted:
            sun = ShadowMap.of(faces, self.directions[k], n)
            kind = np.uint16 if len(faces.corners) < np.iinfo(np.uint16).max else np.int32
            self.painted[k, n] = replace(sun, seen=sun.seen.astype(kind))
        return self.painted[k, n]


def _seen_from_the_sun(faces: Faces, s: Array, axes: Array, n: int) -> Tuple[Array, float, Array, Array]:
    """Return origin, pitch, heights (n, n) and faces + 1 (n, n) of the map along a direction (3,) with axes (2, 3)."""
    order, frame = order_faces(faces, s * 1e6), np.vstack([axes, s])
    p, at, height = np.empty((len(order), 4, 2)), np.empty(3), np.empty((n, n), np.float32)
    library().fly_shadow_map_polygons(native_faces(faces), order, len(order), frame, n, p, at)
    seen = fill_faces(p, order, (n, n), 0.5)
    if library().fly_shadow_map_heights(native_faces(faces), frame, at, seen, n, height):
        raise MemoryError(NO_MEMORY)
    return at[:2].copy(), float(at[2]), height, seen
