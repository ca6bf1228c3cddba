"""What places on a craft see of it in directions all around: depth maps peeled surface by surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from simulator.render.context import release
from simulator.render.light_view import WIDER, light_matrix
from simulator.render.skylight import spiral

if TYPE_CHECKING:
    from collections.abc import Iterator

    import moderngl

    from simulator.arrays import BoolArray, Float32Array, FloatArray, IntArray
    from simulator.render.mesh import Mesh
    from simulator.render.programs import ProgramLibrary

OPEN_DIRECTIONS = 128
HIT_AXES = 48
MAP_PX, COARSE_PX = 512, 256
SIMPLE_TRIANGLES = 2000  # fewer need the coarse map only
LAYERS = 10  # surfaces behind each other, at most
LIFT_PX = 0.8  # of the map: a place is looked from so far off its face, which then does not hide it


Int32Array = np.typing.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Seen:
    """What lies in each direction of each place.

    Parameters
    ----------
    open_directions : (D, 3) unit vectors, target frame. is_open : (N, D) nothing of the craft lies there.
    hit_directions : (H, 3). triangles : (N, H) met first, -1 for none. distances_m : (N, H) to there.
    """

    open_directions: FloatArray
    is_open: BoolArray
    hit_directions: FloatArray
    triangles: Int32Array
    distances_m: Float32Array


class Peeler:
    """A craft's maps along parallel rays.

    Parameters
    ----------
    places_m, normals : (N, 3) on the mesh, target frame: what looks around.
    """

    def __init__(
        self,
        context: moderngl.Context,
        programs: ProgramLibrary,
        mesh: Mesh,
        places_m: FloatArray,
        normals: FloatArray,
    ) -> None:
        self._context, self._mesh = context, mesh
        self._size = COARSE_PX if len(mesh.triangles) < SIMPLE_TRIANGLES else MAP_PX
        self._program = programs.get("target/shadow.vert", "target/peel.frag", {}, ("t_before",))
        self._array = mesh.vertex_array(context, self._program.gl)
        size = (self._size, self._size)
        self._triangle = context.texture(size, 1, dtype="u4")
        self._depths = [context.depth_texture(size) for _ in range(2)]
        for depth in self._depths:
            depth.compare_func = ""
            depth.filter = (context.NEAREST, context.NEAREST)
        self._targets = [context.framebuffer([self._triangle], depth) for depth in self._depths]
        self.box_m = 2 * mesh.radius_m * WIDER
        self._places = np.asarray(places_m + normals * (LIFT_PX * self.box_m / self._size), np.float32)

    def look_around(self) -> Seen:
        """The outermost surface along many directions, and all of them along some axes, each of which serves two."""
        directions = spiral(OPEN_DIRECTIONS)
        is_open = np.zeros((len(directions), len(self._places)), bool)
        for k, direction in enumerate(directions):
            z, layers = self._layers(direction, 1)
            for met, at in layers:
                is_open[k] = (met < 0) | (at >= z)
        axes = spiral(2 * HIT_AXES)[:HIT_AXES]  # a hemisphere
        triangles = np.full((2 * HIT_AXES, len(self._places)), -1, np.int32)
        distance = np.zeros(triangles.shape, np.float32)
        for k, axis in enumerate(axes):
            z, layers = self._layers(axis, LAYERS)
            for met, at in layers:
                # towards the axis the last surface before the place counts, away from it the first behind
                before = (met >= 0) & (at < z)
                triangles[k, before], distance[k, before] = met[before], (z - at)[before] * self.box_m
                after = (met >= 0) & (at > z) & (triangles[HIT_AXES + k] < 0)
                triangles[HIT_AXES + k, after] = met[after]
                distance[HIT_AXES + k, after] = (at - z)[after] * self.box_m
        return Seen(directions, is_open.T, np.concatenate([axes, -axes]), triangles.T, distance.T)

    def _layers(
        self, towards: FloatArray, most: int
    ) -> tuple[Float32Array, Iterator[tuple[Int32Array, Float32Array]]]:
        """Depth (N,) of the places seen from a direction, and triangle and depth of each surface at their pixels."""
        matrix = light_matrix(self._mesh.center_m, self._mesh.radius_m, -towards)
        clip = self._places @ matrix[:3, :3].T.astype(np.float32) + matrix[:3, 3].astype(np.float32)
        column, row = np.clip(((clip[:, :2].T * 0.5 + 0.5) * self._size).astype(int), 0, self._size - 1)
        return clip[:, 2] * 0.5 + 0.5, self._peeled(matrix, row * self._size + column, most)

    def _peeled(
        self, matrix: FloatArray, pixel: IntArray, most: int
    ) -> Iterator[tuple[Int32Array, Float32Array]]:
        self._program.set("u_light_clip_from_target", tuple(matrix.T.ravel().tolist()))
        self._targets[1].clear(depth=0.0)
        for layer in range(most):
            self._context.enable_only(self._context.DEPTH_TEST)
            target, depth = self._targets[layer % 2], self._depths[layer % 2]
            target.use()
            target.clear()
            self._program.bind_textures(t_before=self._depths[1 - layer % 2])
            self._array.render()
            found = np.frombuffer(self._triangle.read(alignment=1), np.uint32)
            if layer and not found.any():
                return
            at = np.frombuffer(depth.read(alignment=1), np.float32)
            yield found[pixel].astype(np.int32) - 1, at[pixel]

    def release(self) -> None:
        """Free the maps."""
        self._array.release()
        release(self._context, *self._targets, self._triangle, *self._depths)
