"""The renderer: owns one OpenGL context and turns a SceneState into radiance; composes the passes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from simulator.errors import UserError
from simulator.render.earth.earth_pass import EarthPass, ice_day
from simulator.render.earth.earth_view import earth_view
from simulator.render.earth.map_textures import begin_earth_maps, stand_ins
from simulator.render.frame_images import FrameImages
from simulator.render.gl.context import create_context, describe
from simulator.render.gl.fences import keep_fences
from simulator.render.gl.lens_rays import RayTextures
from simulator.render.gl.programs import RAYS_UNIT, ProgramLibrary
from simulator.render.gl.shared_blocks import Blocks
from simulator.render.gl.timing import StageClock
from simulator.render.irradiance import no_light
from simulator.render.moon.moon_pass import MoonPass
from simulator.render.moon.moon_view import moon_view
from simulator.render.projection import PixelRect
from simulator.render.rendered import Craft, Layer, Rendered
from simulator.render.sky.star_pass import Spread, StarPass
from simulator.render.sky.sun_pass import SunPass
from simulator.render.software.quad_packing import LEAST_SHARE, QuadPackingPass
from simulator.render.software.tiles import earth_tiles, uniform_tiles
from simulator.render.target.target_passes import TargetPasses
from simulator.render.uniform_values import earth_values, frame_values, moon_values
from simulator.render.view import build_view, sky_light
from simulator.scene.illumination.bands import bands_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import moderngl

    from simulator.render.earth.earth_view import EarthView
    from simulator.render.earth.map_textures import EarthMaps
    from simulator.render.gl.context import GlInfo
    from simulator.render.irradiance import SkyLight
    from simulator.render.moon.moon_view import MoonView
    from simulator.render.software.tiles import ScreenTiles
    from simulator.render.target.label_pass import Surfaces
    from simulator.render.view import View
    from simulator.runtime.arrays import Float32Array, FloatArray
    from simulator.scene.illumination.atmosphere import Atmosphere
    from simulator.scene.state import Bands, SceneState
    from simulator.targets.model import Target


@dataclass(frozen=True, eq=False)
class Sky:
    """What is behind the target.

    Parameters
    ----------
    moon, earth : as the camera sees them, ``None`` when the scene has none. air : of the Earth.
    tables : this frame's air, ``None`` where nothing asks for it. tiles : of the image that Earth and air touch,
        ``None`` with neither in the image. corners : of the tiles and of the fine ones, the air in front of the ground.
    """

    moon: MoonView | None = None
    earth: EarthView | None = None
    air: Atmosphere | None = None
    tables: list[moderngl.Texture] | None = None
    tiles: ScreenTiles | None = None
    corners: tuple[Float32Array, Float32Array] | None = None

    @property
    def fills(self) -> bool:
        """Whether the Earth fills the image: rays that all meet the ground see nothing behind it."""
        return self.earth is not None and self.earth.rect is not None and self.earth.sky_rows is None

    @property
    def added_to(self) -> PixelRect | None:
        """Pixels where the Earth is added to the target's light; it is written to all its others."""
        return None if self.tiles is None else self.tiles.covered()


def _refuse_another(scene: SceneState, target: Target) -> None:
    if scene.target.sha256 != target.sha256:
        raise UserError(
            f"the scene was made for target {scene.target.name} ({scene.target.sha256[:12]}) and is drawn with "
            f"{target.name} ({target.sha256[:12]}); use the same version of the target file"
        )


class Renderer:
    """Draws scenes headless, one at a time, from the thread that made it.

    Parameters
    ----------
    device_index : EGL device, ``None`` for the default one.
    context : an existing OpenGL >= 4.1 context to draw with instead; it is not released on close.
    timed : wait for the driver after every pass, so that ``stage_ms`` is each pass's own time. Without it the passes
        queue up, nothing stalls, and their time shows in the read-back. May be changed between frames.
    begun : `begin_earth_maps` of the first scenes to be drawn, for a quicker first frame.
    thrifty : have Python find what need not be drawn, or may be interpolated. A software driver takes a fraction of the
        time then, and a GPU would wait for it. ``None``: where a software driver draws.

    Raises
    ------
    UserError
        If no sufficient OpenGL is found; the message says how to get one.
    """

    def __init__(
        self,
        *,
        device_index: int | None = None,
        context: moderngl.Context | None = None,
        timed: bool = False,
        begun: Mapping[Bands, EarthMaps] | None = None,
        thrifty: bool | None = None,
    ) -> None:
        self.timed = timed
        self._owns_context = context is None
        self._gl = create_context(device_index) if context is None else context
        self.info: GlInfo = describe(self._gl)
        if self.info.is_software:
            keep_fences(self._gl)
        self._thrifty = self.info.is_software if thrifty is None else thrifty
        self._blocks = Blocks.create(self._gl)
        self._programs = ProgramLibrary(self._gl, self._blocks.all())
        self._targets: dict[bool, TargetPasses] = {}
        self._rays = RayTextures(self._gl)
        self._target_passes()
        self._stars = StarPass(self._gl, self._programs)
        self._sun = SunPass(self._gl, self._programs)
        self._quads = QuadPackingPass(self._gl, self._programs)
        self._images: FrameImages | None = None
        self._filled = False  # by the Earth, in the last frame: nothing was to be cleared
        self._moon: MoonPass | None = None
        self._earths: dict[Bands, EarthPass] = {}
        # of the first scene that needs them, until they are uploaded
        self._begun: dict[Bands, EarthMaps] = dict(begun or {})
        self.check("start-up")

    def make_current(self) -> None:
        """Take the thread's OpenGL for this renderer's own context: another renderer may have been made since."""
        if self._owns_context:
            self._gl.__enter__()  # type: ignore[no-untyped-call]

    def check(self, what: str) -> None:
        """Raise when OpenGL recorded an error: moderngl itself stays silent about most of them."""
        error = self._gl.error
        if error != "GL_NO_ERROR":
            raise RuntimeError(f"OpenGL reports {error} after {what} on {self.info.renderer}")

    def render(
        self,
        scene: SceneState,
        target: Target,
        *,
        labels: bool = False,
        sky: SkyLight | None = None,
        layer: Layer = "all",
    ) -> Rendered:
        """Draw one scene.

        Parameters
        ----------
        target : the model that ``scene.target`` names.
        labels : also return coverage, depth and the share of the silhouette inside the image.
        sky : light on the target in place of the scene's Earth-shine and Moon-shine, for proofs.
        layer : ``craft`` gives radiance (already times the coverage) and coverage of the ``window`` that it may touch;
            with ``sky`` behind it, times one minus the coverage, they add up to the whole picture.

        Raises
        ------
        UserError
            If ``target`` is not the one the scene was made for.
        """
        if layer == "craft":
            craft = self.begin_craft(scene, target, sky=sky)
            craft.shade()
            return craft.read()
        _refuse_another(scene, target)
        clock = StageClock(self._gl, finish=self.timed)
        passes = self._prepare(scene)
        self._begin_maps(scene)
        bands = len(bands_of(scene.bands))
        # what Earth and Moon light is worked out while the driver draws the samples, which need none of it; in the
        # first frame the maps that it depends on are still being decoded
        view = build_view(scene, no_light(bands) if sky is None else sky)
        self._blocks.frame.write(frame_values(scene, view))
        clock.lap("setup")
        images = self._images_for(scene)
        # a driver's threads empty the images while the first pass is being prepared, where that was right before
        early = not (self._filled and self._thrifty) and scene.bands not in self._begun
        if early:
            images.clear(PixelRect(0, 0, *images.size))
        sampled = None if layer == "sky" else passes.sample(scene, view, target, clock)
        tiles_px = None if sampled is None else sampled.tiles_px
        begun = self._begun.get(scene.bands)
        if begun is not None:
            self._compile_ahead(scene, view, images, tiles_px, clock)
            if sampled is not None:
                passes.compile_ahead(sampled, scene.bands, images)
        if sampled is not None and sky is None:
            if begun is not None:
                begun.albedo.result()
            view = replace(view, sky=sky_light(scene))
            self._blocks.frame.write(frame_values(scene, view))
        clock.lap("skylight")
        behind = self._prepare_sky(scene, view, tiles_px, self._earth_pass, clock)
        self._filled = behind.fills
        if not early:
            images.clear(behind.added_to if behind.fills else PixelRect(0, 0, *images.size))
        if sampled is not None:
            passes.shade(sampled, view, scene.bands, images)
            clock.lap("target.shading")
        hidden = None if sampled is None else sampled.rect
        images.mark_covered(hidden)
        quads, starlight = self._draw_sky(scene, view, images, behind, hidden, clock)
        radiance = images.read_radiance(quads=quads)
        if starlight is not None:
            starlight.add_to(radiance)
        clock.lap("readback")
        coverage = depth = None
        inside = 1.0
        if labels:
            coverage = images.read_coverage()
            depth = passes.begin_surfaces(scene, target, layers=False)().depth_m
            inside = passes.silhouette_inside(scene, target)
            clock.lap("labels")
        self.check("a frame")
        if begun is not None:
            begun.later.start()
        return Rendered(radiance, coverage, depth, inside, clock.stage_ms)

    def begin_craft(self, scene: SceneState, target: Target, *, sky: SkyLight | None = None) -> Craft:
        """Have the driver draw a craft's samples, alone; parameters as of `render`."""
        _refuse_another(scene, target)
        clock = StageClock(self._gl, finish=self.timed)
        passes = self._prepare(scene)
        if sky is None:
            self._begin_maps(scene)
        bands = len(bands_of(scene.bands))
        view = build_view(scene, no_light(bands) if sky is None else sky)
        self._blocks.frame.write(frame_values(scene, view))
        clock.lap("setup")
        sampled = passes.sample(scene, view, target, clock)
        stages = [clock.stage_ms]

        def shade() -> None:
            clock = StageClock(self._gl, finish=self.timed)
            stages.append(clock.stage_ms)
            self._prepare(scene)
            lit = replace(view, sky=sky_light(scene)) if sky is None and sampled is not None else view
            self._blocks.frame.write(frame_values(scene, lit))
            clock.lap("skylight")
            images = self._images_for(scene)
            images.clear(PixelRect(0, 0, *images.size))
            if sampled is not None:
                passes.shade(sampled, lit, scene.bands, images)
            images.mark_covered(None if sampled is None else sampled.rect)
            clock.lap("target.shading")

        def read() -> Rendered:
            self.make_current()
            clock = StageClock(self._gl, finish=self.timed)
            part = PixelRect(0, 0, 0, 0) if sampled is None else sampled.rect
            light, share, window = self._images_for(scene).read_part(part)
            clock.lap("readback")
            self.check("a craft")
            spent: dict[str, float] = {}
            for stage in (*stages, clock.stage_ms):
                for name, ms in stage.items():
                    spent[name] = spent.get(name, 0.0) + ms
            return Rendered(light, share, None, 1.0, spent, window)

        return Craft(shade, read)

    def begin_surfaces(
        self, scene: SceneState, target: Target, *, layers: bool = False
    ) -> Callable[[], Surfaces]:
        """What of the target lies at each pixel's centre, without drawing the picture.

        The driver is drawing it when this returns; calling the result, once, waits for the end and reads it back.

        Parameters
        ----------
        layers : normals and parts too, not depth alone.
        """
        finish = self._prepare(scene).begin_surfaces(scene, target, layers=layers)

        def surfaces() -> Surfaces:
            self.make_current()
            seen = finish()
            self.check("the labels of a frame")
            return seen

        return surfaces

    def surfaces(self, scene: SceneState, target: Target, *, layers: bool = False) -> Surfaces:
        """`begin_surfaces`, waited for."""
        return self.begin_surfaces(scene, target, layers=layers)()

    def silhouette_inside(self, scene: SceneState, target: Target) -> float:
        """Share of the target's whole silhouette that falls on the image."""
        return self._prepare(scene).silhouette_inside(scene, target)

    def _prepare(self, scene: SceneState) -> TargetPasses:
        """Bind what every pass reads, and choose the spacecraft's passes for the scene's lens."""
        self.make_current()
        for block in self._blocks.all():
            block.bind()
        self._programs.lens = not scene.camera.distortion.is_none
        if self._programs.lens:
            self._rays.of(scene.camera).use(RAYS_UNIT)
        return self._target_passes()

    def _begin_maps(self, scene: SceneState) -> None:
        """Have a first frame's Earth decoded while its craft is made ready."""
        if scene.environment.earth and scene.bands not in self._earths and scene.bands not in self._begun:
            self._begun[scene.bands] = begin_earth_maps(scene.bands, scene.environment, scene.epoch_utc)

    def _compile_ahead(
        self,
        scene: SceneState,
        view: View,
        images: FrameImages,
        hidden_px: FloatArray | None,
        clock: StageClock,
    ) -> None:
        """Have the driver compile what draws the Earth, a second's work, while the first frame's maps are decoded.

        Some tiles are drawn from stand-ins of the maps. All that they touch is cleared or drawn again.
        """
        maps = stand_ins(scene.bands, scene.environment, scene.epoch_utc)
        earth = EarthPass(self._gl, self._programs, scene.bands, maps, thrifty=self._thrifty)
        sky = self._prepare_sky(scene, view, hidden_px, lambda _: earth, clock)
        if sky.tiles is not None:
            behind = sky.moon is not None and sky.moon.in_front
            quads = self._packs_quads(images, sky)
            earth.run(images, sky.tiles, sky.corners, scene, behind=behind, quads=quads, ahead=True)
        earth.release()
        clock.lap("earth.programs")

    def _prepare_sky(
        self,
        scene: SceneState,
        view: View,
        hidden_px: FloatArray | None,
        pass_of: Callable[[Bands], EarthPass],
        clock: StageClock,
    ) -> Sky:
        """What of Earth, air and Moon is in view, their blocks, and this frame's air; draws nothing into the images."""
        environment = scene.environment
        moon = moon_view(scene) if environment.moon else None
        if moon is not None:
            self._blocks.moon.write(moon_values(moon))
        if not environment.earth:
            return Sky(moon=moon)
        in_use = pass_of(scene.bands).air(environment.atmosphere_thickness_km)
        air = in_use.tables.air if environment.atmosphere else None
        earth = earth_view(view, scene.camera, air)
        self._blocks.earth.write(earth_values(view, earth, in_use.tables.air))
        if earth.rect is None:
            clock.lap("earth.setup")
            return Sky(moon=moon, earth=earth, air=air)
        if self._thrifty:
            tiles = earth_tiles(earth, scene.camera, hidden_px, ice_day(scene))
        else:
            tiles = uniform_tiles(earth, scene.camera)
        clock.lap("earth.setup")
        tables, corners = None, None
        if air is not None:
            # a view of nothing but smooth ground asks for the air at its tiles' corners only
            if not (tiles.all_smooth and earth.sky_rows is None) or (moon is not None and moon.in_front):
                in_use.frame.run(earth)
                tables = in_use.frame.tables
            if tiles.smooth_share > 0:
                even = not len(tiles.others_px) and not len(tiles.halved[0])
                at_tiles = in_use.frame.corners(*tiles.corners_px, all_ground=even)
                corners = at_tiles, in_use.frame.at(tiles.fine_corners_px.reshape(-1, 2))
        clock.lap("earth.air")
        return Sky(moon, earth, air, tables, tiles, corners)

    def _draw_sky(
        self,
        scene: SceneState,
        view: View,
        images: FrameImages,
        sky: Sky,
        hidden: PixelRect | None,
        clock: StageClock,
    ) -> tuple[bool, Spread | None]:
        """Everything behind the target: each pass adds its light times the share that the target leaves open.

        Parameters
        ----------
        hidden : pixels that the target may cover.

        Returns
        -------
        Whether the picture is kept four pixels to a texel, and light to be added when it is read.
        """
        starlight = None
        environment, earth, moon = scene.environment, sky.earth, sky.moon
        behind = moon is not None and moon.in_front
        quads = self._packs_quads(images, sky)
        if sky.tiles is not None:
            self._earth_pass(scene.bands).run(
                images, sky.tiles, sky.corners, scene, behind=behind, quads=quads
            )
            clock.lap("earth.surface")
        if (environment.stars or environment.planets) and not sky.fills:
            starlight = self._stars.run(scene, view, images, earth, sky.air, moon, hidden)
            clock.lap("stars")
        if moon is not None and moon.rect is not None and (not sky.fills or moon.in_front):
            if self._moon is None:
                self._moon = MoonPass(self._gl, self._programs)
                self.check("uploading the Moon's map")
            self._moon.run(
                images, moon, earth=earth is not None, air=sky.tables, fine=scene.quality == "high"
            )
            clock.lap("moon")
        if environment.sun and not sky.fills:
            hides = moon is not None and moon.rect is not None
            self._sun.run(images, view, scene.camera, earth=earth is not None, air=sky.tables, moon=hides)
            clock.lap("sun")
        if quads and sky.tiles is not None:
            self._quads.run(images, sky.tiles, sky.tiles.others_px)
            clock.lap("earth.quad_packing")
        return quads, starlight

    @staticmethod
    def _packs_quads(images: FrameImages, sky: Sky) -> bool:
        """Whether the Earth's smooth tiles are drawn four pixels to a texel."""
        behind = sky.moon is not None and sky.moon.in_front
        many = sky.tiles is not None and sky.tiles.smooth_share > LEAST_SHARE
        return images.can_pack_quads and not behind and many

    def _target_passes(self) -> TargetPasses:
        """The spacecraft's passes for the lens at hand: programs and vertex arrays with it and without are apart."""
        lens = self._programs.lens
        if lens not in self._targets:
            self._targets[lens] = TargetPasses(self._gl, self._programs, self._blocks, thrifty=self._thrifty)
        return self._targets[lens]

    def _earth_pass(self, bands: Bands) -> EarthPass:
        if bands not in self._earths:
            self._earths[bands] = EarthPass(
                self._gl, self._programs, bands, self._begun.pop(bands), thrifty=self._thrifty
            )
            self.check("uploading the Earth's maps")
        return self._earths[bands]

    def _images_for(self, scene: SceneState) -> FrameImages:
        width, height = scene.camera.width_px, scene.camera.height_px
        bands = len(bands_of(scene.bands))
        if self._images is None or (self._images.size, self._images.bands) != ((width, height), bands):
            if self._images is not None:
                self._images.release()
            self._images = FrameImages(self._gl, width, height, bands)
            self.check(f"allocating images of {width} x {height}")
        return self._images

    def close(self) -> None:
        """Free what the renderer made, and its context."""
        self.make_current()
        if self._images is not None:
            self._images.release()
            self._images = None
        for passes in self._targets.values():
            passes.release()
        for earth in self._earths.values():
            earth.release()
        if self._moon is not None:
            self._moon.release()
        self._rays.release()
        if self._owns_context:
            # EGL keeps a context, and all its textures, for as long as it is a thread's current one
            self._gl.__exit__(None, None, None)  # type: ignore[no-untyped-call]
            self._gl.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
