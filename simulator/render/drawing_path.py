"""How a driver is spared work, if at all: one interface, and the plain path, which spares it nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from flyaround.simulator.render.craft.mesh_array import Culling, NoCulling
from flyaround.simulator.render.earth.earth_pass import EarthPass

if TYPE_CHECKING:
    from collections.abc import Sequence

    import moderngl

    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.frame_graph import Pass
    from flyaround.simulator.render.gl.programs import ProgramLibrary
    from flyaround.simulator.scene.illumination.bands import Bands


class DrawingPath(Protocol):
    """What may differ between drivers: how much Python finds out before they draw, and by which passes."""

    @property
    def culling(self) -> Culling:
        """Which of the target's triangles and tiles are drawn."""

    @property
    def smooth_moon(self) -> bool:
        """Whether the Moon's ground is interpolated between the corners of tiles."""

    def earth_pass(
        self,
        context: moderngl.Context,
        programs: ProgramLibrary,
        bands: Bands,
        prefetched: EarthMaps,
        *,
        precompiles: bool = False,
    ) -> EarthPass:
        """What draws the Earth; parameters as of `EarthPass`."""

    def adapt(self, passes: Sequence[Pass]) -> list[Pass]:
        """The passes of the plain path, some in another way, with others between them."""


class PlainPath:
    """What a GPU runs: whole meshes, uniform tiles, every pixel shaded."""

    culling = NoCulling()
    earth_pass = EarthPass
    smooth_moon = False

    def adapt(self, passes: Sequence[Pass]) -> list[Pass]:
        """The passes as they are."""
        return list(passes)
