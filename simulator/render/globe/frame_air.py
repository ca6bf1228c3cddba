"""Light of the air in one frame: tables of in-scatter and transmittance, and the same values at points of the image.

Both are integrated on the GPU from the static tables of the atmosphere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.celestial.air_tables import GROUND_MU_MIN
from flyaround.simulator.render.frame_graph import Resource
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.programs import FULL_SCREEN
from flyaround.simulator.scene.illumination.atmosphere import optical_depth_to_top

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.celestial.air_tables import AirTables
    from flyaround.simulator.render.gl.programs import Program, ProgramLibrary
    from flyaround.simulator.render.globe.globe_view import GlobeView
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray, IntArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere

COLUMNS, ROWS, STEPS = 64, 96, 24
"""Size of a frame's table (for ground and for sky), and number of steps along each ray."""
TABLE_DEFINES = {"COLUMNS": COLUMNS, "ROWS": ROWS}
AIR_SAMPLERS: dict[int, tuple[str, ...]] = {
    1: ("t_air",),
    3: ("t_air_rayleigh", "t_air_mie", "t_air_transmittance"),
}
"""Samplers of a frame's tables, by number of bands."""
AIR: Resource[Atmosphere] = Resource("air")
AIR_TABLES: Resource[list[moderngl.Texture]] = Resource("air tables")
# texels drawn beyond the range in view, for filtering, and because extremes may lie between the sampled rays
_MARGIN = 2
_MIN_CORNERS = 7  # along a side: every other one makes the four nodes that a cubic needs


@lru_cache(maxsize=8)
def _coarse_grid(edges_px: bytes) -> tuple[FloatArray, IntArray, Float32Array]:
    """Thin out a grid, and prepare its cubic interpolation.

    Parameters
    ----------
    edges_px : bytes
        Positions (M,), float64.

    Returns
    -------
    coarse : (K,) array
        Every other position, and the last one.
    index : (4, M) array
        Indices in ``coarse`` of the four nodes of each position.
    weights : (4, M) array
        Lagrange weights of the nodes.
    """
    edges = np.frombuffer(edges_px)
    coarse = np.append(edges[:-1:2], edges[-1])
    first = np.clip(np.searchsorted(coarse, edges) - 2, 0, len(coarse) - 4)
    index = first + np.arange(4)[:, None]
    nodes = coarse[index]
    weights = [
        np.prod((edges - np.delete(nodes, k, 0)) / (nodes[k] - np.delete(nodes, k, 0)), axis=0)
        for k in range(4)
    ]
    return coarse, index, np.asarray(weights, np.float32)


def _interpolate_cubic(values: Float32Array, index: IntArray, weights: Float32Array) -> Float32Array:
    """Interpolate values (K, L, V) at coarse positions to (L, M, V) at all positions.

    Sums are written out, because the order of a BLAS product's sums is not fixed.
    """
    flat = values.reshape(len(values), -1)
    fine = weights[0][:, None] * flat[index[0]]
    for k in (1, 2, 3):
        fine += weights[k][:, None] * flat[index[k]]
    return np.ascontiguousarray(fine.reshape(-1, *values.shape[1:]).swapaxes(0, 1))


class FrameAir:
    """Light of an atmosphere seen from one camera position.

    It depends on two angles, so a table with one texel per pair of angles replaces integration per pixel.

    Parameters
    ----------
    context : Context
        OpenGL context.
    programs : ProgramLibrary
        Programs of the context.
    bands : int
        Number of bands, 1 or 3.
    tables : AirTables
        Static tables of the atmosphere.
    """

    def __init__(
        self, context: moderngl.Context, programs: ProgramLibrary, bands: int, tables: AirTables
    ) -> None:
        self._context = context
        size = (COLUMNS, 2 * ROWS)
        self.tables = [context.texture(size, 4, dtype="f4") for _ in range(1 if bands == 1 else 3)]
        components = 1 if bands == 1 else 3
        rows, columns, _ = tables.transmittance.shape
        self._transmittance = context.texture(
            (columns, rows), components, tables.transmittance.tobytes(), dtype="f4", alignment=1
        )
        self.ground = context.texture(
            (len(tables.ground), 1), components, tables.ground.tobytes(), dtype="f4", alignment=1
        )
        heights, suns, _ = tables.multiple.shape
        self._multiple = context.texture(
            (suns, heights), components, tables.multiple.tobytes(), dtype="f4", alignment=1
        )
        for texture in (*self.tables, self._transmittance, self.ground, self._multiple):
            texture.filter = (context.LINEAR, context.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        self._framebuffer = context.framebuffer(self.tables)
        self._program = programs.get(
            FULL_SCREEN,
            "atmosphere/table.frag",
            {"BANDS": bands, "STEPS": STEPS, "GROUND_MU_MIN": GROUND_MU_MIN, **TABLE_DEFINES},
            ("t_transmittance", "t_ground", "t_multiple"),
        )
        self._array = context.vertex_array(self._program.gl, [])
        self._programs, self._bands = programs, bands
        self._corners: dict[bool, _CornerProgram] = {}  # keyed by whether the lens distorts

    def run(self, earth: GlobeView) -> None:
        """Compute the part of the table that the image can show."""
        draw_to(self._framebuffer)
        # cleared, so that no frame depends on the previous one
        self._framebuffer.clear(0.0, 0.0, 0.0, 0.0)
        self._context.enable_only(self._context.NOTHING)
        self._bind(self._program)
        c0, c1 = _texels(((earth.azimuth[0] + 1) / 2, (earth.azimuth[1] + 1) / 2), COLUMNS)
        for rows, first in ((earth.ground_rows, 0), (earth.sky_rows, ROWS)):
            if rows is None:
                continue
            r0, r1 = _texels(rows, ROWS)
            self._framebuffer.viewport = (c0, first + r0, c1 - c0, r1 - r0)
            self._array.render(vertices=3)

    def make_complete(self) -> None:
        """Make a framebuffer current for transform feedback, because a headless driver may have no default one."""
        draw_to(self._framebuffer)

    @property
    def static_tables(self) -> dict[str, moderngl.Texture]:
        """Static tables of the atmosphere, by sampler."""
        return {
            "t_transmittance": self._transmittance,
            "t_ground": self.ground,
            "t_multiple": self._multiple,
        }

    def _bind(self, program: Program) -> None:
        program.bind_textures(**self.static_tables)

    def release(self) -> None:
        """Free the tables and the resources that fill them."""
        for corners in self._corners.values():
            corners.release()
        self._array.release()
        release(
            self._context, self._framebuffer, *self.tables, self._transmittance, self.ground, self._multiple
        )

    def corners(
        self, columns_px: FloatArray, rows_px: FloatArray, *, all_ground: bool = False
    ) -> Float32Array:
        """Compute the air in front of the ground at the corners of a grid in the image.

        Parameters
        ----------
        columns_px : (M,) array
            Columns of the corners [px].
        rows_px : (N,) array
            Rows of the corners [px].
        all_ground : bool, optional
            True if every ray meets the ground, well away from the limb. The air is then computed at every other corner
            of each row and column, and interpolated by cubics between them.

        Returns
        -------
        (N, M, V) array
            Radiance over the Sun's irradiance [sr-1]. V = 3 for one band: radiance, transmittance, irradiance on level
            ground. V = 6 for three bands: radiance and transmittance of each. Values of rays that miss the ground are
            undefined.
        """
        program = self._corner_program()
        if not all_ground or min(len(columns_px), len(rows_px)) < _MIN_CORNERS:
            return program.run(columns_px, rows_px)
        x_px, x_index, x_weights = _coarse_grid(columns_px.tobytes())
        y_px, y_index, y_weights = _coarse_grid(rows_px.tobytes())
        by_row = _interpolate_cubic(program.run(x_px, y_px), y_index, y_weights)
        return _interpolate_cubic(by_row, x_index, x_weights)

    def at_points(self, points_px: Float32Array) -> Float32Array:
        """Compute the values (K, V) of `corners` at points (K, 2) of the image [px]."""
        if not len(points_px):
            return np.empty((0, 3 if self._bands == 1 else 6), np.float32)
        return self._corner_program().at_points(points_px)

    def _corner_program(self) -> _CornerProgram:
        lens = self._programs.lens
        if lens not in self._corners:
            self._corners[lens] = _CornerProgram(self._context, self._programs, self._bands)
        self.make_complete()
        self._bind(self._corners[lens].program)
        return self._corners[lens]


@dataclass(frozen=True, eq=False)
class Air:
    """One atmosphere: its static tables, and the tables of a frame."""

    tables: AirTables
    frame: FrameAir

    @cached_property
    def zenith_depth(self) -> float:
        """Optical depth of the zenith seen from the ground, averaged over the bands."""
        air = self.tables.air
        return float(optical_depth_to_top(air, np.array(air.radius_m), np.array(1.0)).mean())


class _CornerProgram:
    """Program that integrates the air's light at points of the image by transform feedback, with its buffers."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary, bands: int) -> None:
        self._values = 3 if bands == 1 else 6
        self._context = context
        self.program = programs.get(
            "earth/tile_corners.vert",
            None,
            {"BANDS": bands, "STEPS": STEPS, "GROUND_MU_MIN": GROUND_MU_MIN},
            ("t_transmittance", "t_ground", "t_multiple"),
            varyings=("v_air",) if bands == 1 else ("v_haze", "v_through"),
        )
        self._corner_buffer = context.buffer(reserve=8, dynamic=True)
        self._air_buffer = context.buffer(reserve=8, dynamic=True)
        self._array = context.vertex_array(
            self.program.gl, [(self._corner_buffer, "2f", "in_pixel")], mode=context.POINTS
        )
        self._grid: tuple[bytes, bytes] = (b"", b"")

    def release(self) -> None:
        """Free the buffers."""
        for resource in (self._array, self._corner_buffer, self._air_buffer):
            resource.release()

    def run(self, columns_px: FloatArray, rows_px: FloatArray) -> Float32Array:
        """Return values (N, M, V) at a grid; its points are uploaded only when the grid changes."""
        grid = columns_px.tobytes(), rows_px.tobytes()
        if grid != self._grid:
            self._upload(np.stack(np.meshgrid(columns_px, rows_px), axis=-1).astype(np.float32))
            self._grid = grid
        return self._read_air(len(rows_px) * len(columns_px)).reshape(len(rows_px), len(columns_px), -1)

    def at_points(self, points_px: Float32Array) -> Float32Array:
        """Return values (K, V) at points (K, 2)."""
        self._upload(points_px)
        self._grid = (b"", b"")
        return self._read_air(len(points_px))

    def _upload(self, corners_px: Float32Array) -> None:
        self._corner_buffer.orphan(corners_px.nbytes)
        self._corner_buffer.write(np.ascontiguousarray(corners_px))
        self._air_buffer.orphan(corners_px.size // 2 * self._values * 4)

    def _read_air(self, count: int) -> Float32Array:
        self._array.transform(self._air_buffer, vertices=count)
        return np.frombuffer(self._air_buffer.read(), np.float32).reshape(count, self._values)


def _texels(span: tuple[float, float], count: int) -> tuple[int, int]:
    """Return the half-open range of texels that a range of a texture coordinate 0..1 may touch."""
    low = math.floor(span[0] * (count - 1)) - _MARGIN
    high = math.ceil(span[1] * (count - 1)) + _MARGIN + 1
    return max(low, 0), min(high, count)
