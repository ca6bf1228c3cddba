"""Air pass: this frame's table of in-scatter and transmittance. Reads the static tables; writes the frame's."""

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

COLUMNS, ROWS, STEPS = 64, 96, 24  # size of a frame's table of air light, and the steps along each ray
TABLE_DEFINES = {"COLUMNS": COLUMNS, "ROWS": ROWS}
AIR_SAMPLERS: dict[int, tuple[str, ...]] = {
    1: ("t_air",),
    3: ("t_air_rayleigh", "t_air_mie", "t_air_transmittance"),
}
"""Component counts of a frame's tables, by number of bands."""
AIR: Resource[Atmosphere] = Resource("air")
AIR_TABLES: Resource[list[moderngl.Texture]] = Resource("air tables")
# texels beyond the range in view, for filtering and for extremes between the rays that were tried
_MARGIN = 2
_FEWEST_CORNERS = 7  # along a side: every other corner makes the four of a cubic


@lru_cache(maxsize=8)
def _every_other(edges_px: bytes) -> tuple[FloatArray, IntArray, Float32Array]:
    """Return every other of M positions (float64) and the last; indices and weights (4, M) of the cubics for all M."""
    edges = np.frombuffer(edges_px)
    coarse = np.append(edges[:-1:2], edges[-1])
    first = np.clip(np.searchsorted(coarse, edges) - 2, 0, len(coarse) - 4)
    which = first + np.arange(4)[:, None]
    at = coarse[which]
    # Lagrange
    weights = [
        np.prod((edges - np.delete(at, k, 0)) / (at[k] - np.delete(at, k, 0)), axis=0) for k in range(4)
    ]
    return coarse, which, np.asarray(weights, np.float32)


def _cubic(values: Float32Array, which: IntArray, weights: Float32Array) -> Float32Array:
    """Interpolate values of K coarse positions (K, L, V) to all M, (L, M, V); BLAS would not fix the order of sums."""
    flat = values.reshape(len(values), -1)
    fine = weights[0][:, None] * flat[which[0]]
    for k in (1, 2, 3):
        fine += weights[k][:, None] * flat[which[k]]
    return np.ascontiguousarray(fine.reshape(-1, *values.shape[1:]).swapaxes(0, 1))


class FrameAir:
    """Table of the air's light from one camera position, which depends on two angles: one texel per pair."""

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
        self._corners: dict[bool, _Corners] = {}  # keyed by whether the lens distorts

    def run(self, earth: GlobeView) -> None:
        """Fill the part of the table that the image can see."""
        draw_to(self._framebuffer)
        # the rest stays black, so that no frame depends on the previous one
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
        """Make a framebuffer current for vertices that draw nothing: a headless driver may have no default one."""
        draw_to(self._framebuffer)

    @property
    def static_tables(self) -> dict[str, moderngl.Texture]:
        """Return the static tables, by sampler."""
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
        """Return the air in front of the ground at the corners of a grid in the image, over the Sun's irradiance.

        Parameters
        ----------
        columns_px : (M,) array
            Columns of the corners.
        rows_px : (N,) array
            Rows of the corners.
        all_ground : bool, optional
            True if every ray meets the ground, well away from the limb. The air is then computed at every other corner
            each way, with cubics between.

        Returns
        -------
        (N, M, 3) array
            Radiance [sr-1], transmittance, irradiance on level ground; for three bands (N, M, 6): radiance and
            transmittance of each. Values of rays that miss the ground are meaningless.
        """
        program = self._corner_program()
        if not all_ground or min(len(columns_px), len(rows_px)) < _FEWEST_CORNERS:
            return program.run(columns_px, rows_px)
        x_px, across, across_weights = _every_other(columns_px.tobytes())
        y_px, down, down_weights = _every_other(rows_px.tobytes())
        return _cubic(_cubic(program.run(x_px, y_px), down, down_weights), across, across_weights)

    def at(self, points_px: Float32Array) -> Float32Array:
        """Return `corners` at any points (K, 2): (K, 3) or (K, 6)."""
        if not len(points_px):
            return np.empty((0, 3 if self._bands == 1 else 6), np.float32)
        return self._corner_program().at(points_px)

    def _corner_program(self) -> _Corners:
        lens = self._programs.lens
        if lens not in self._corners:
            self._corners[lens] = _Corners(self._context, self._programs, self._bands)
        self.make_complete()
        self._bind(self._corners[lens].program)
        return self._corners[lens]


@dataclass(frozen=True, eq=False)
class Air:
    """One atmosphere: its static tables and the pass that makes each frame's."""

    tables: AirTables
    frame: FrameAir

    @cached_property
    def zenith_depth(self) -> float:
        """Optical depth at the zenith, seen from the ground, averaged over the bands."""
        air = self.tables.air
        return float(optical_depth_to_top(air, np.array(air.radius_m), np.array(1.0)).mean())


class _Corners:
    """The program that integrates through the air, and its buffers."""

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
        self._in = context.buffer(reserve=8, dynamic=True)
        self._out = context.buffer(reserve=8, dynamic=True)
        self._array = context.vertex_array(
            self.program.gl, [(self._in, "2f", "in_pixel")], mode=context.POINTS
        )
        self._grid: tuple[bytes, bytes] = (b"", b"")

    def release(self) -> None:
        """Free the buffers."""
        for one in (self._array, self._in, self._out):
            one.release()

    def run(self, columns_px: FloatArray, rows_px: FloatArray) -> Float32Array:
        grid = columns_px.tobytes(), rows_px.tobytes()
        if grid != self._grid:
            self._fill(np.stack(np.meshgrid(columns_px, rows_px), axis=-1).astype(np.float32))
            self._grid = grid
        return self._air(len(rows_px) * len(columns_px)).reshape(len(rows_px), len(columns_px), -1)

    def at(self, points_px: Float32Array) -> Float32Array:
        self._fill(points_px)
        self._grid = (b"", b"")
        return self._air(len(points_px))

    def _fill(self, corners_px: Float32Array) -> None:
        self._in.orphan(corners_px.nbytes)
        self._in.write(np.ascontiguousarray(corners_px))
        self._out.orphan(corners_px.size // 2 * self._values * 4)

    def _air(self, count: int) -> Float32Array:
        self._array.transform(self._out, vertices=count)
        return np.frombuffer(self._out.read(), np.float32).reshape(count, self._values)


def _texels(span: tuple[float, float], count: int) -> tuple[int, int]:
    """Return the half-open range of texels that a range 0..1 of a coordinate can touch."""
    low = math.floor(span[0] * (count - 1)) - _MARGIN
    high = math.ceil(span[1] * (count - 1)) + _MARGIN + 1
    return max(low, 0), min(high, count)
