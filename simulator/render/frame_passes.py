"""The passes of a renderer in the order in which they run, and the set of passes for a GPU."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.craft.edge_pass import EdgePass
from flyaround.simulator.render.craft.gbuffer_pass import GBufferPass
from flyaround.simulator.render.craft.label_raster import LabelRaster
from flyaround.simulator.render.craft.mesh_array import NoCulling
from flyaround.simulator.render.craft.placement import PlacementPass
from flyaround.simulator.render.craft.resident_targets import ResidentTargets
from flyaround.simulator.render.craft.shade_pass import LightPass, ShadePass
from flyaround.simulator.render.craft.shadow_pass import ShadowPass
from flyaround.simulator.render.earth.earth_pass import EarthPass
from flyaround.simulator.render.earth.earth_view import (
    EarthAirPass,
    EarthProgramsPass,
    EarthTilesPass,
    GlobeViewPass,
    ShinePass,
)
from flyaround.simulator.render.frame_images import ClearPass, ReadBackPass
from flyaround.simulator.render.globe.globe_pass import GlobeAirPass, GlobePass
from flyaround.simulator.render.moon.moon_pass import MoonPass
from flyaround.simulator.render.moon.moon_view import MoonViewPass
from flyaround.simulator.render.sky.star_pass import StarPass
from flyaround.simulator.render.sky.sun_pass import SunPass
from flyaround.simulator.render.view import SetUpPass

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.render.craft.mesh_array import Culling
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.earth.earth_view import Earths
    from flyaround.simulator.render.frame_graph import Pass


class FramePasses:
    """The passes of one renderer, and the label raster of the same targets.

    Parameters
    ----------
    device : Device
        OpenGL context and shared state.
    earths : Earths
        Maps of the Earth.
    culling : Culling
        Selection of the target's triangles and tiles.
    clear : ClearPass
        Pass that clears the images.
    globe : GlobeViewPass
        Pass that finds the globe in the image.
    views : sequence of Pass
        Passes that prepare the Moon's view, the globe's tiles and the frame's air.
    sky : sequence of Pass
        Passes that draw what is behind the target. Each adds its light times one minus the coverage.
    earth_programs : sequence of Pass
        Passes that prepare and draw the Earth, run once in advance to compile its programs.
    read_back : ReadBackPass
        Pass that reads the image.
    """

    def __init__(
        self,
        device: Device,
        earths: Earths,
        culling: Culling,
        *,
        clear: ClearPass,
        globe: GlobeViewPass,
        views: Sequence[Pass],
        sky: Sequence[Pass],
        earth_programs: Sequence[Pass],
        read_back: ReadBackPass,
    ) -> None:
        self._targets = ResidentTargets(device, culling)
        self.labels = LabelRaster(device, self._targets)
        self._set_up, self._shine = SetUpPass(device.blocks.frame), ShinePass(device, earths)
        self._clear, self._clear_all = clear, ClearPass(device.images_for)
        self._first = (
            EarthProgramsPass(device, earths, (globe, self._shine, *earth_programs)),
            ClearPass(device.images_for, "clear.again"),
        )
        self._sampling = (
            PlacementPass(device, self._targets),
            GBufferPass(device),
            ShadowPass(device),
            EdgePass(device),
        )
        self._shading = (LightPass(), ShadePass(device))
        self._globe, self._views, self._sky, self._read_back = globe, views, sky, read_back

    def frame(self, *, target: bool = True, first: bool = False) -> list[Pass]:
        """Return the passes from a scene to its image.

        The target's samples come first. A software driver draws them while the CPU computes the light of Earth and
        Moon, and pixels of the sky behind the target need not be shaded.

        Parameters
        ----------
        target : bool, optional
            False for the background alone.
        first : bool, optional
            True to also compile the Earth's programs while its maps are decoded; their output is cleared.
        """
        return [
            self._set_up,
            self._clear,
            *(self._sampling if target else ()),
            *(self._first if first else ()),
            self._globe,
            *self._views,
            self._shine,
            *(self._shading if target else ()),
            *self._sky,
            self._read_back,
        ]

    def craft(self, *, has_sky_light: bool = False) -> list[Pass]:
        """Return the passes that draw only the target.

        Parameters
        ----------
        has_sky_light : bool, optional
            True if the light of Earth and Moon on the target is given, so the globe is not needed.
        """
        globe = () if has_sky_light else (self._globe,)
        return [self._set_up, *self._sampling, *globe, self._shine, self._clear_all, *self._shading]

    def release(self) -> None:
        """Free the passes' resources on the GPU."""
        for current in self.frame():
            current.release()
        self.labels.release()
        self._targets.release()


def gpu_passes(device: Device, earths: Earths) -> FramePasses:
    """Return the passes for a GPU: whole meshes, uniform tiles, every pixel shaded."""
    earth = EarthPass(device.context)
    view_passes = (MoonViewPass(device.blocks.moon), EarthTilesPass(), EarthAirPass())
    return FramePasses(
        device,
        earths,
        NoCulling(),
        clear=ClearPass(device.images_for),
        globe=GlobeViewPass(device, earths),
        views=(*view_passes, GlobeAirPass()),
        sky=(earth, GlobePass(device), StarPass(device), MoonPass(device), SunPass(device)),
        earth_programs=(*view_passes, earth),
        read_back=ReadBackPass(),
    )
