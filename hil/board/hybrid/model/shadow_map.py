"""Shadows that the target casts on itself, by shadow maps (Williams 1978)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Dict, List, Optional, Tuple

import numpy as np

from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.estimation.vectors import cross, length, sphere_directions
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.geometry.native_faces import native_faces
from flyaround.hil.board.hybrid.geometry.shading import Shading
from flyaround.hil.board.hybrid.model.image_formation import pinhole_view
from flyaround.hil.board.hybrid.model.rasteriser import fill_faces, order_faces
from flyaround.hil.board.hybrid.native.interface import STRUCTURES, Structure, contiguous
from flyaround.hil.board.hybrid.native.library import library

if TYPE_CHECKING:
    from flyaround.hil.board.estimation.camera import CameraIntrinsics

Array = np.ndarray

# Number of candidate Sun directions, about 13 deg apart (docs/lab/2026-11-estimator.md), and side of their maps [px].
N_DIRECTIONS = 240
TABLE_PX = 80

# Minimum number of pixels on the target for a search of the Sun direction.
MIN_PIXELS = 40

# Minimum cosine between Sun and camera directions: a Sun behind the target lights no visible face.
MIN_SUN_COSINE = -0.6

# Maximum cosine between two proposed Sun directions; a smaller angle would propose neighbouring candidates.
MAX_SUN_COSINE = float(np.cos(np.radians(15.0)))

# Coordinate axes; the one most nearly perpendicular to a Sun direction spans its map.
AXES = np.eye(3)

OUT_OF_MEMORY = "out of memory while rendering shadow maps"


@dataclass(frozen=True, eq=False)
class ShadowMap:
    """Orthographic depth map of the target, seen from the Sun.

    Parameters
    ----------
    direction : (3,) array
        Unit vector to the Sun, target frame.
    axes : (2, 3) array
        Axes of the map, target frame.
    origin : (2,) array
        Coordinates of the first pixel's centre along the axes [m].
    pitch_m : float
        Pixel size [m].
    height : (n, n) array
        Height of the visible surface along ``direction``, float32 [m]; very low where there is none.
    visible_face : (n, n) array
        Index of the visible face plus 1.
    """

    direction: Array
    axes: Array
    origin: Array
    pitch_m: float
    height: Array
    visible_face: Array

    @cached_property
    def native(self) -> Structure:
        """C structure of the map for the native library."""
        n = len(self.height)
        kind = "uint16" if self.visible_face.dtype == np.uint16 else "int32"
        visible_face = contiguous(self.visible_face, kind, (n, n))
        return STRUCTURES["sun"](
            axes=np.vstack([self.axes, self.direction]),
            at=np.array([*self.origin, self.pitch_m]),
            height=contiguous(self.height, "float32", (n, n)),
            seen=visible_face,
            side=n,
            bytes=visible_face.itemsize,
        )

    @staticmethod
    def from_faces(faces: Faces, direction: Array, n: int) -> ShadowMap:
        """Render the map of ``direction`` (3,), target frame, ``n`` pixels wide."""
        s = direction / length(direction)
        e1 = cross(s, AXES[int(np.argmin(np.abs(s)))])
        e1 = e1 / length(e1)
        axes = np.stack([e1, cross(s, e1)])
        return ShadowMap(s, axes, *_render_from_sun(faces, s, axes, n))

    def shadows(
        self,
        faces: Faces,
        visible_face: Array,
        patch: ImagePatch,
        camera: CameraIntrinsics,
        R: Array,
        t: Array,
    ) -> Array:
        """Return True for rendered pixels (H, W) that face the Sun but lie in shadow.

        Parameters
        ----------
        faces : Faces
            Faces of the target.
        visible_face : (H, W) array
            Visible faces at the pose, from ``draw_faces``.
        patch : ImagePatch
            Patch on which they were rendered.
        camera : CameraIntrinsics
            Pinhole camera.
        R : (3, 3) array
            Rotation, camera from target.
        t : (3,) array
            Target position, camera frame [m].

        Raises
        ------
        MemoryError
            If the library is out of memory.
        """
        h, w = visible_face.shape
        R, t, dark = contiguous(R, "float64", (3, 3)), contiguous(t, "float64", (3,)), np.zeros((h, w), bool)
        view = pinhole_view(camera, patch)
        if library().fly_shadows(native_faces(faces), self.native, view, R, t, visible_face, h, w, dark):
            raise MemoryError(OUT_OF_MEMORY)
        return dark


@dataclass(frozen=True, eq=False)
class ShadowMapTable:
    """Shadow maps for directions over the whole sphere, for estimating the Sun direction from the shadows in an image.

    Parameters
    ----------
    directions : (S, 3) array
        Unit vectors to the Sun, target frame.
    frames : (3, S, 3) array
        Two axes and the direction of each map.
    origin : (S, 2) array
        Coordinates of each map's first pixel along its axes [m].
    pitch_m : (S,) array
        Pixel size of each map [m].
    height : (S, n, n) array
        Height of the visible surface along each direction, float32 [m].
    rendered_maps : dict, optional
        Cache of ``sunlight``.
    """

    directions: Array
    frames: Array
    origin: Array
    pitch_m: Array
    height: Array
    rendered_maps: Dict[Tuple[int, int], ShadowMap] = field(default_factory=dict)

    @cached_property
    def native(self) -> Structure:
        """C structure of the table for the native library."""
        count, side = self.height.shape[:2]
        return STRUCTURES["sun_table"](
            frames=contiguous(self.frames, "float64", (3, count, 3)),
            origin=contiguous(self.origin, "float64", (count, 2)),
            pitch=contiguous(self.pitch_m, "float64", (count,)),
            height=contiguous(self.height, "float32", (count, side, side)),
            directions=count,
            side=side,
        )

    @staticmethod
    def from_faces(faces: Faces, number: int = N_DIRECTIONS) -> ShadowMapTable:
        """Render the maps of ``number`` directions on a Fibonacci lattice."""
        directions = sphere_directions(number)
        suns = [ShadowMap.from_faces(faces, d, TABLE_PX) for d in directions]
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
        number: int,
        pixels: int,
    ) -> List[int]:
        """Return the Sun directions whose shadows explain the image best, best first.

        Each group of faces has one lit and one shadowed brightness, both measured on the image. No material properties
        are needed, because the shape of the shadows alone decides.

        Parameters
        ----------
        faces : Faces
            Faces of the target.
        shading : Shading
            Synthetic view at the pose.
        patch : ImagePatch
            Reduced region of the image around the target.
        camera : CameraIntrinsics
            Pinhole camera.
        R : (3, 3) array
            Rotation, camera from target.
        t : (3,) array
            Target position, camera frame [m].
        number : int
            Maximum number of directions returned.
        pixels : int
            Maximum number of image pixels compared.

        Returns
        -------
        list of int
            Indices into ``directions``; empty if too little of the target is visible.
        """
        side = self.directions @ (-R.T @ t) / length(t)
        candidates = np.flatnonzero(side > MIN_SUN_COSINE)
        costs = self._costs(faces, shading, patch, camera, R, t, candidates, pixels)
        if costs is None:
            return []
        out: List[int] = []
        for k in candidates[np.argsort(costs)].tolist():
            if all(self.directions[k] @ self.directions[better] < MAX_SUN_COSINE for better in out):
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
        candidates: Array,
        pixels: int,
    ) -> Optional[Array]:
        """Return the residual (S,) of each of the directions ``candidates`` (S,); None if too little is visible."""
        # variance-stabilising transform: shot noise is uniform on the square root of brightness
        dim = max(2.0 * patch.full_scale / 255.0, patch.sigma)
        is_measured = shading.area > 0
        is_measured[0] = False
        (h, w), f = patch.gray.shape, patch.fine
        centre = contiguous(shading.centre, "uint8", (h, w))
        picture = STRUCTURES["sun_image"](
            seen=contiguous(shading.visible_face, "int32", (h * f, w * f)),
            centre=centre,
            good=is_measured,
            gray=contiguous(patch.gray, "float32"),
            group=contiguous(faces.group, "int64"),
            h=h,
            w=w,
            fine=f,
            groups=faces.groups,
            labels=len(is_measured),
            bytes=centre.itemsize,
            darkest=float(np.min(patch.gray)),
        )
        candidates, out = contiguous(candidates, "int64"), np.empty(len(candidates))
        R, t = contiguous(R, "float64", (3, 3)), contiguous(t, "float64", (3,))
        view = pinhole_view(camera, patch)
        points = library().fly_sun_costs(
            native_faces(faces),
            self.native,
            picture,
            view,
            R,
            t,
            float(dim),
            pixels,
            candidates,
            len(candidates),
            out,
        )
        if points < 0:
            raise MemoryError(OUT_OF_MEMORY)
        return out if points >= MIN_PIXELS else None

    def sunlight(self, faces: Faces, k: int, n: int) -> ShadowMap:
        """Return the map of direction ``k``, ``n`` pixels wide, cached for all images."""
        if (k, n) not in self.rendered_maps:
            sun = ShadowMap.from_faces(faces, self.directions[k], n)
            kind = np.uint16 if len(faces.corners) < np.iinfo(np.uint16).max else np.int32
            self.rendered_maps[k, n] = replace(sun, visible_face=sun.visible_face.astype(kind))
        return self.rendered_maps[k, n]


def _render_from_sun(faces: Faces, s: Array, axes: Array, n: int) -> Tuple[Array, float, Array, Array]:
    """Render a shadow map along the direction ``s`` (3,) with image axes (2, 3).

    Returns
    -------
    tuple
        Origin (2,) [m], pitch [m], heights (n, n) [m], and indices of the visible faces plus 1 (n, n).
    """
    order, frame = order_faces(faces, s * 1e6), np.vstack([axes, s])
    p, at, height = np.empty((len(order), 4, 2)), np.empty(3), np.empty((n, n), np.float32)
    library().fly_shadow_map_polygons(native_faces(faces), order, len(order), frame, n, p, at)
    visible_face = fill_faces(p, order, (n, n), 0.5)
    if library().fly_shadow_map_heights(native_faces(faces), frame, at, visible_face, n, height):
        raise MemoryError(OUT_OF_MEMORY)
    return at[:2].copy(), float(at[2]), height, visible_face
