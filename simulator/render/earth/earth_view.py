"""Passes that prepare the Earth: its view, light on the target, tiles and air, and the compilation of its programs."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from flyaround.simulator.celestial.earth_albedo import globe_and_moon_shine, moon_on_plates
from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.earth.earth_pass import EARTH, Earth
from flyaround.simulator.render.earth.map_textures import placeholder_maps, prefetch_earth_maps, shows_earth
from flyaround.simulator.render.earth.screen_tiles import EARTH_TILES, uniform_tiles
from flyaround.simulator.render.earth.shine import ShineSampler
from flyaround.simulator.render.frame_graph import FrameGraph, FrameResources, Pass, Resource
from flyaround.simulator.render.frame_images import COVERAGE, IMAGES, RADIANCE
from flyaround.simulator.render.globe.frame_air import AIR, AIR_TABLES
from flyaround.simulator.render.globe.globe_pass import PLAIN_GLOBE, PlainGlobe
from flyaround.simulator.render.globe.globe_view import GLOBE, globe_values, globe_view
from flyaround.simulator.render.view import GIVEN_IRRADIANCE, SCENE, VIEW, frame_values

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState


class Earths:
    """The Earth for each set of bands. Its maps are prefetched on other threads, and uploaded at first use.

    Parameters
    ----------
    device : Device
        OpenGL context and shared state.
    prefetched : mapping, optional
        Results of `prefetch_earth_maps` for the first scenes.
    """

    def __init__(self, device: Device, prefetched: Mapping[Bands, EarthMaps] | None = None) -> None:
        self._device = device
        self._uploaded: dict[Bands, Earth] = {}
        self._prefetched: dict[Bands, EarthMaps] = dict(prefetched or {})

    def prefetch(self, scene: SceneState) -> None:
        """Start decoding the maps that a scene needs, unless they are decoded or uploaded."""
        bands = scene.bands
        if shows_earth(scene) and bands not in self._uploaded and bands not in self._prefetched:
            self._prefetched[bands] = prefetch_earth_maps(bands, scene.environment, scene.epoch_utc)

    def pending(self, bands: Bands) -> EarthMaps | None:
        """Return the maps that are being decoded; ``None`` if they are uploaded or were not requested."""
        return self._prefetched.get(bands)

    def get(self, bands: Bands) -> Earth:
        """Return the Earth for a set of bands. The first call waits for the maps and uploads them."""
        if bands not in self._uploaded:
            self._uploaded[bands] = self._upload(bands, self._prefetched.pop(bands))
        return self._uploaded[bands]

    def _upload(self, bands: Bands, maps: EarthMaps, *, precompiles: bool = False) -> Earth:
        device = self._device
        earth = Earth(device.context, device.programs, bands, maps, precompiles=precompiles)
        device.check("uploading the Earth's maps")
        return earth

    @contextmanager
    def placeholder(self, scene: SceneState) -> Iterator[None]:
        """Replace the Earth by one with small black maps inside the context; it draws one tile of each kind."""
        maps = placeholder_maps(scene.bands, scene.environment, scene.epoch_utc)
        self._uploaded[scene.bands] = self._upload(scene.bands, maps, precompiles=True)
        try:
            yield
        finally:
            self._uploaded.pop(scene.bands).release()

    def release(self) -> None:
        """Free all Earths."""
        for earth in self._uploaded.values():
            earth.release()


class GlobeViewPass(Pass):
    """Finds the globe and its air in the image, and uploads the globe's resources at first use."""

    name = "earth.view"
    reads = (SCENE, VIEW)
    writes = (EARTH, PLAIN_GLOBE, GLOBE, AIR)

    def __init__(self, device: Device, earths: Earths) -> None:
        self._device, self._earths = device, earths
        self._globes: dict[tuple[str, Bands], PlainGlobe] = {}

    def run(self, r: PassResources) -> None:
        """Find the globe, if the scene has it."""
        scene, environment, body = r[SCENE], r[SCENE].environment, r[SCENE].globe.body
        if not environment.draws(body):
            return
        if shows_earth(scene):
            r[EARTH] = earth = self._earths.get(scene.bands)
            air = earth.air(environment).tables.air
        else:
            key = body.name, scene.bands
            if key not in self._globes:
                self._globes[key] = PlainGlobe(self._device, body, scene.bands)
            r[PLAIN_GLOBE] = self._globes[key]
            air = self._globes[key].air.tables.air
        r[AIR] = visible_air = air if environment.atmosphere and body.air is not None else None
        r[GLOBE] = globe = globe_view(r[VIEW], scene.camera, visible_air)
        values = globe_values(r[VIEW], globe, air, airglow=environment.airglow)
        self._device.blocks.globe.write(values)

    def release(self) -> None:
        """Free the globes."""
        for globe in self._globes.values():
            globe.release()


class ShinePass(Pass):
    """Computes the irradiance of globe and Moon on the target, from the Earth as it is drawn."""

    name = "earth_and_moon_shine"
    reads = (SCENE, VIEW, TARGET)
    optional = (GIVEN_IRRADIANCE, EARTH, GLOBE)
    writes = (VIEW,)

    def __init__(self, device: Device, earths: Earths) -> None:
        self._block, self._earths = device.blocks.frame, earths
        self._sampler = ShineSampler(device)

    def run(self, r: PassResources) -> None:
        """Complete the view and write its uniforms."""
        scene, view, earth, globe = r[SCENE], r[VIEW], r.find(EARTH), r.find(GLOBE)
        if r.find(GIVEN_IRRADIANCE) is None:
            if earth is not None and globe is not None and scene.environment.earthshine:
                sky = self._sampler.field(scene, view, globe, earth, moon_on_plates(scene))
            else:
                pending = self._earths.pending(scene.bands)
                if pending is not None:
                    pending.albedo.result()
                sky = globe_and_moon_shine(scene)
            view = replace(view, sky=sky)
        r[VIEW] = view
        self._block.write(frame_values(scene, view))

    def release(self) -> None:
        """Free the sampler's buffers."""
        self._sampler.release()


class EarthTilesPass(Pass):
    """Divides the part of the image that the Earth may touch into tiles, all of one kind."""

    name = "earth.tiles"
    reads: tuple[Resource[object], ...] = (SCENE, EARTH, GLOBE)
    writes = (EARTH_TILES,)

    def run(self, r: PassResources) -> None:
        """Make the tiles, if the Earth is in the image."""
        if r[GLOBE].rect is not None:
            r[EARTH_TILES] = uniform_tiles(r[GLOBE], r[SCENE].camera)


class EarthAirPass(Pass):
    """Computes this frame's tables of the Earth's air: in-scatter and transmittance."""

    name = "earth.air"
    reads = (SCENE, EARTH, GLOBE, EARTH_TILES, AIR)
    writes: tuple[Resource[object], ...] = (AIR_TABLES,)

    def run(self, r: PassResources) -> None:
        """Fill the tables."""
        air = r[EARTH].air(r[SCENE].environment).frame
        air.run(r[GLOBE])
        r[AIR_TABLES] = air.tables


class EarthProgramsPass(Pass):
    """Compiles the Earth's programs by drawing small maps, while the maps of the first frame are decoded.

    Parameters
    ----------
    device : Device
        OpenGL context and programs.
    earths : Earths
        The Earth for each set of bands.
    passes : sequence of Pass
        Passes that prepare and draw the Earth. Their output must be cleared.
    """

    name = "earth.programs"
    reads = (SCENE, VIEW, *IMAGES)
    optional = (TARGET,)
    writes = IMAGES

    def __init__(self, device: Device, earths: Earths, passes: Sequence[Pass]) -> None:
        self._context, self._earths, self._passes = device.context, earths, passes

    def run(self, r: PassResources) -> None:
        """Draw one tile of each kind."""
        frame = FrameResources()
        frame[SCENE], frame[VIEW], frame[TARGET] = r[SCENE], r[VIEW], r.find(TARGET)
        frame[RADIANCE], frame[COVERAGE], frame[GIVEN_IRRADIANCE] = r[RADIANCE], r[COVERAGE], None
        with self._earths.placeholder(r[SCENE]):
            FrameGraph(self._passes, frame).run(self._context, frame)
