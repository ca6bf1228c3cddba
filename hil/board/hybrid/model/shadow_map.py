"""Shadows that the craft casts on itself: it is painted once more, from the Sun."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.estimation.vectors import cross, length
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

# Side of the picture painted from the Sun [px].
MAP_PX = 256

# Faces that the Sun grazes count as turned away: cosine.
GRAZING = 0.03

# Fewer points on the craft say nothing of shadows.
LEAST_POINTS = 40

# Directions of the Sun that are tried, the side of each one's picture [px], and pixels that they are judged on.
DIRECTIONS, TABLE_PX, PIXELS = 240, 80, 700

# A pixel's deviation counts up to twice this: share of the deviation among all, and of the noise.
SPREAD, BOUND = 0.15, 4.0

# The Sun behind the craft lights nothing that is seen: least cosine between it and the way to the camera.
BEHIND = -0.6

AXES = np.eye(3)

NO_MEMORY = "no memory for the Sun's pictures"

# Least angle between two directions that are both proposed: cosine.
APART = float(np.cos(np.radians(15.0)))


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """The craft as the Sun sees it, an orthographic picture.

    Parameters
    ----------
    direction : (3,) unit vector to the Sun, target frame. axes : (2, 3) of the picture. origin : (2,) their values
        at its first pixel's middle [m]. pitch_m : of its pixels. height : (n, n) float32, of what is seen along
        ``direction`` [m], very low where nothing is. seen : (n, n) face + 1. native : as the library takes it.
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
        """The craft painted from ``direction`` (3,), target frame."""
        s = direction / length(direction)
        e1 = cross(s, AXES[int(np.argmin(np.abs(s)))])
        e1 = e1 / length(e1)
        axes = np.stack([e1, cross(s, e1)])
        return ShadowMap(s, axes, *_seen_from_the_sun(faces, s, axes, n))

    def shadows(
        self, faces: Faces, seen: Array, patch: ImagePatch, camera: CameraIntrinsics, R: Array, t: Array
    ) -> Array:
        """(H, W) bool: drawn pixels that look at the Sun but lie behind something.

        Parameters
        ----------
        seen : drawn at the pose ``R``, ``t`` by ``draw_faces``. camera : a pinhole.
        """
        h, w = seen.shape
        R, t, dark = contiguous(R, "float64", (3, 3)), contiguous(t, "float64", (3,)), np.zeros((h, w), bool)
        view = pinhole_view(camera, patch)
        if library().fly_shadows(native_faces(faces), self.native, view, R, t, seen, h, w, dark):
            raise MemoryError(NO_MEMORY)
        return dark


@dataclass(frozen=True, eq=False)
class ShadowMapTable:
    """The craft as seen from all round, to find where the Sun stands by the shadows on the picture.

    Parameters
    ----------
    directions : (S, 3) unit vectors, target frame. frames : (3, S, 3) axes of each picture and its direction.
    origin : (S, 2), pitch_m : (S,), height : (S, n, n) float32, as in ShadowMap.
    native : as the library takes it. painted : what ``sunlight`` has painted until now; no answer hangs on it.
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
        """The craft painted ``n`` pixels wide from direction ``k``, once for all pictures."""
        if (k, n) not in self.painted:
            sun = ShadowMap.of(faces, self.directions[k], n)
            kind = np.uint16 if len(faces.corners) < np.iinfo(np.uint16).max else np.int32
            self.painted[k, n] = replace(sun, seen=sun.seen.astype(kind))
        return self.painted[k, n]


def _seen_from_the_sun(faces: Faces, s: Array, axes: Array, n: int) -> Tuple[Array, float, Array, Array]:
    """Origin, pitch, heights (n, n) and faces + 1 (n, n) of the map along a direction (3,) with axes (2, 3)."""
    order, frame = order_faces(faces, s * 1e6), np.vstack([axes, s])
    p, at, height = np.empty((len(order), 4, 2)), np.empty(3), np.empty((n, n), np.float32)
    library().fly_shadow_map_polygons(native_faces(faces), order, len(order), frame, n, p, at)
    seen = fill_faces(p, order, (n, n), 0.5)
    if library().fly_shadow_map_heights(native_faces(faces), frame, at, seen, n, height):
        raise MemoryError(NO_MEMORY)
    return at[:2].copy(), float(at[2]), height, seen
