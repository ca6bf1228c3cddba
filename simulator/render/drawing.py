"""What each pass of a frame does: takes its resources, and has the body that they belong to draw."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING

from flyaround.simulator.render.craft.target_passes import TargetPasses
from flyaround.simulator.render.earth.albedo import globe_and_moon_shine
from flyaround.simulator.render.earth.earth_pass import EarthFrame
from flyaround.simulator.render.earth.map_textures import prefetch_earth_maps, shows_earth, stand_ins
from flyaround.simulator.render.earth.screen_tiles import uniform_tiles
from flyaround.simulator.render.frame_resources import (
    AIR,
    AIR_TABLES,
    COVERAGE,
    EARTH_PASS,
    EARTH_TILES,
    EDGE_SLOPES,
    GIVEN_IRRADIANCE,
    GLOBE,
    GLOBE_PASS,
    MODEL,
    MOON,
    PICTURE,
    RADIANCE,
    SAMPLES,
    SCENE,
    SHADOW,
    STARLIGHT,
    TARGET,
    TARGET_LIGHT,
    TARGET_TILES,
    VIEW,
)
from flyaround.simulator.render.globe.globe_pass import GlobePass
from flyaround.simulator.render.globe.globe_view import globe_values, globe_view
from flyaround.simulator.render.moon.moon_pass import MoonPass
from flyaround.simulator.render.moon.moon_tiles import moon_tiles
from flyaround.simulator.render.moon.moon_view import moon_values, moon_view
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.sky.star_pass import StarPass
from flyaround.simulator.render.sky.sun_pass import SunPass
from flyaround.simulator.render.view import build_view, frame_values

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import moderngl

    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.drawing_path import DrawingPath
    from flyaround.simulator.render.earth.earth_pass import EarthPass
    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.world.ephemeris.body import Body


class Drawing:
    """The bodies of one renderer, uploaded when they are first drawn, and the functions of its passes.

    Parameters
    ----------
    prefetched : `prefetch_earth_maps` of the first scenes to be drawn.
    """

    def __init__(
        self, device: Device, path: DrawingPath, prefetched: Mapping[Bands, EarthMaps] | None = None
    ) -> None:
        self._device, self._path = device, path
        self._targets: dict[bool, TargetPasses] = {}
        self._stars = StarPass(device.context, device.programs)
        self._sun = SunPass(device.context, device.programs)
        self._moon: MoonPass | None = None
        self._earths: dict[Bands, EarthPass] = {}
        self._globes: dict[tuple[str, Bands], GlobePass] = {}
        # of the first scene that needs them, until they are uploaded
        self._prefetched: dict[Bands, EarthMaps] = dict(prefetched or {})

    # what is uploaded

    @property
    def target(self) -> TargetPasses:
        """The spacecraft's passes for the lens at hand: programs and vertex arrays with it and without are apart."""
        device, lens = self._device, self._device.programs.lens
        if lens not in self._targets:
            self._targets[lens] = TargetPasses(
                device.context, device.programs, device.blocks, self._path.culling
            )
        return self._targets[lens]

    def earth(self, bands: Bands) -> EarthPass:
        """The Earth for some bands; waits for its maps when it is first drawn."""
        if bands not in self._earths:
            prefetched = self._prefetched.pop(bands)
            self._earths[bands] = self._path.earth_pass(
                self._device.context, self._device.programs, bands, prefetched
            )
            self._device.check("uploading the Earth's maps")
        return self._earths[bands]

    def globe(self, body: Body, bands: Bands) -> GlobePass:
        """What draws a body without passes of its own, for some bands."""
        if (body.name, bands) not in self._globes:
            self._globes[body.name, bands] = GlobePass(
                self._device.context, self._device.programs, body, bands
            )
            self._device.check(f"uploading the map of {body.title}")
        return self._globes[body.name, bands]

    def prefetch_maps(self, scene: SceneState) -> None:
        """Have a first frame's Earth decoded while its craft is made ready."""
        if shows_earth(scene) and scene.bands not in self._earths and scene.bands not in self._prefetched:
            self._prefetched[scene.bands] = prefetch_earth_maps(
                scene.bands, scene.environment, scene.epoch_utc
            )

    def maps_of(self, bands: Bands) -> EarthMaps | None:
        """The maps that are being decoded for some bands; ``None`` once they are uploaded, or if nothing asked."""
        return self._prefetched.get(bands)

    @contextmanager
    def stand_in_earth(self, scene: SceneState) -> Iterator[None]:
        """An Earth of small black maps, for a while: it draws one tile of each kind."""
        device, maps = self._device, stand_ins(scene.bands, scene.environment, scene.epoch_utc)
        earth = self._path.earth_pass(device.context, device.programs, scene.bands, maps, precompiles=True)
        self._earths[scene.bands] = earth
        try:
            yield
        finally:
            del self._earths[scene.bands]
            earth.release()

    def release(self) -> None:
        """Free everything."""
        for target in self._targets.values():
            target.release()
        for earth in self._earths.values():
            earth.release()
        for globe in self._globes.values():
            globe.release()
        if self._moon is not None:
            self._moon.release()

    # the passes

    def set_up(self, r: PassResources) -> None:
        """Work out the view, without light of Earth and Moon on the target yet."""
        scene, given = r[SCENE], r.find(GIVEN_IRRADIANCE)
        r[VIEW] = view = build_view(scene, given)
        self._device.blocks.frame.write(frame_values(scene, view))

    def clear(self, r: PassResources) -> None:
        """Empty the frame's images."""
        images = self._device.images_for(r[SCENE])
        images.clear(PixelRect(0, 0, *images.size))
        r[RADIANCE] = r[COVERAGE] = images

    def place_target(self, r: PassResources) -> None:
        """Find where the target is drawn, and how densely it is sampled."""
        r[TARGET] = target = self.target.place(r[SCENE], r[VIEW], r[MODEL])
        r[TARGET_TILES] = None if target is None else target.tiles_px

    def draw_samples(self, r: PassResources) -> None:
        """Draw what the target's samples see."""
        r[SAMPLES] = self.target.draw_samples(r[SCENE], r[TARGET])

    def draw_shadow(self, r: PassResources) -> None:
        """Draw what of the target the Sun sees."""
        r[SHADOW] = self.target.draw_shadow(r[SCENE], r[VIEW], r[TARGET])

    def draw_edges(self, r: PassResources) -> None:
        """Draw how the target's edges share out their pixels."""
        r[EDGE_SLOPES] = self.target.draw_edges(r[SCENE], r[TARGET])

    def light_sky(self, r: PassResources) -> None:
        """Work out the light of Earth and Moon on the target, from maps that a first frame waits for here."""
        scene, view = r[SCENE], r[VIEW]
        if r.find(GIVEN_IRRADIANCE) is None:
            prefetched = self.maps_of(scene.bands)
            if prefetched is not None:
                prefetched.albedo.result()
            view = replace(view, sky=globe_and_moon_shine(scene))
        r[VIEW] = view
        self._device.blocks.frame.write(frame_values(scene, view))

    def find_moon(self, r: PassResources) -> None:
        """Find the Moon in the image."""
        if r[SCENE].environment.moon:
            r[MOON] = moon = moon_view(r[SCENE])
            self._device.blocks.moon.write(moon_values(moon))

    def find_globe(self, r: PassResources) -> None:
        """Find the globe in the image, and the air about it."""
        scene, environment, body = r[SCENE], r[SCENE].environment, r[SCENE].globe.body
        if not environment.draws(body):
            return
        if shows_earth(scene):
            r[EARTH_PASS] = earth_pass = self.earth(scene.bands)
            air = earth_pass.air(environment.atmosphere_thickness_km).tables.air
        else:
            r[GLOBE_PASS] = globe_pass = self.globe(body, scene.bands)
            air = globe_pass.air.tables.air
        r[AIR] = seen = air if environment.atmosphere and body.air is not None else None
        r[GLOBE] = globe = globe_view(r[VIEW], scene.camera, seen)
        self._device.blocks.globe.write(globe_values(r[VIEW], globe, air))

    def cut_tiles(self, r: PassResources) -> None:
        """Cut what the Earth may touch into tiles, all alike."""
        if r[GLOBE].rect is not None:
            r[EARTH_TILES] = uniform_tiles(r[GLOBE], r[SCENE].camera)

    def fill_air_tables(self, r: PassResources) -> None:
        """Draw this frame's tables of the air's light and transmittance."""
        air = r[EARTH_PASS].air(r[SCENE].environment.atmosphere_thickness_km).frame
        air.run(r[GLOBE])
        r[AIR_TABLES] = air.tables

    def fill_globe_air(self, r: PassResources) -> None:
        """Draw this frame's tables of another body's air."""
        air = r[GLOBE_PASS].air.frame
        air.run(r[GLOBE])
        r[AIR_TABLES] = air.tables

    def light_target(self, r: PassResources) -> None:
        """Work out the light that the target's parts give each other."""
        r[TARGET_LIGHT] = r[TARGET].loaded.interreflection.update(r[SCENE].bands, r[VIEW])

    def shade_target(self, r: PassResources) -> None:
        """Shade the target's pixels."""
        light = r[TARGET_LIGHT]
        self._shade(r, {"t_sky_visibility": light.visibility, "t_interreflection": light.interreflection})

    def _shade(
        self, r: PassResources, light: Mapping[str, moderngl.Texture], *, one_tile: bool = False
    ) -> None:
        tiles = r[TARGET_TILES][:1] if one_tile else r[TARGET_TILES]
        textures = {"t_slope": r[EDGE_SLOPES], **light}
        self.target.shade(
            r[SCENE], r[TARGET], tiles, r[SAMPLES], r[SHADOW], textures, r[RADIANCE], one_tile=one_tile
        )

    def draw_earth(self, r: PassResources) -> None:
        """Add ground, clouds and air."""
        r[EARTH_PASS].run(earth_frame(r))

    def draw_globe(self, r: PassResources) -> None:
        """Add another body's ground and air."""
        r[GLOBE_PASS].run(r[RADIANCE], r[GLOBE], r.find(AIR_TABLES))

    def draw_stars(self, r: PassResources) -> None:
        """Add stars and planets: those that the target may hide now, the others when the picture is read."""
        environment, earth, target = r[SCENE].environment, r.find(GLOBE), r.find(TARGET)
        if (earth is not None and earth.fills_image) or not (environment.stars or environment.planets):
            return
        r[STARLIGHT] = self._stars.run(
            r[SCENE],
            r[VIEW],
            r[RADIANCE],
            earth,
            r.find(AIR),
            r.find(MOON),
            None if target is None else target.rect,
        )

    def draw_moon(self, r: PassResources) -> None:
        """Add the Moon."""
        moon, earth = r[MOON], r.find(GLOBE)
        if moon.rect is None or (earth is not None and earth.fills_image and not moon.in_front):
            return
        if self._moon is None:
            self._moon = MoonPass(self._device.context, self._device.programs)
            self._device.check("uploading the Moon's map")
        fine = r[SCENE].quality == "high"
        air, target = r.find(AIR_TABLES), r.find(TARGET)
        tiles = None
        if self._path.smooth_moon and not fine:
            tiles = moon_tiles(moon, r[SCENE].camera, None if target is None else target.rect)
        self._moon.run(r[RADIANCE], moon, earth=earth is not None, air=air, fine=fine, tiles=tiles)

    def draw_sun(self, r: PassResources) -> None:
        """Add the Sun's disc."""
        earth, moon = r.find(GLOBE), r.find(MOON)
        if (earth is not None and earth.fills_image) or not r[SCENE].environment.sun:
            return
        self._sun.run(
            r[RADIANCE],
            r[VIEW],
            r[SCENE].camera,
            earth=earth is not None,
            air=r.find(AIR_TABLES),
            moon=moon is not None and moon.rect is not None,
        )

    def read_picture(self, r: PassResources) -> None:
        """Wait for the driver and take the picture."""
        radiance = r[RADIANCE].read_radiance()
        starlight = r.find(STARLIGHT)
        if starlight is not None:
            starlight.add_to(radiance)
        r[PICTURE] = radiance

    def compile_shading(self, r: PassResources) -> None:
        """Have the driver compile the target's shading while its light is baked, by drawing a tile to be cleared."""
        if len(r[TARGET_TILES]):
            self._shade(r, r[TARGET].loaded.interreflection.stand_ins(r[SCENE].bands), one_tile=True)


def earth_frame(r: PassResources) -> EarthFrame:
    """What the Earth is drawn from, of a pass that declared it."""
    moon = r.find(MOON)
    return EarthFrame(r[RADIANCE], r[EARTH_TILES], r[SCENE], moon is not None and moon.in_front)
