"""The renderer: turns a SceneState into radiance by a list of passes, each with what it reads and writes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Self

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.render.device import Device
from flyaround.simulator.render.drawing import Drawing
from flyaround.simulator.render.drawing_path import PlainPath
from flyaround.simulator.render.frame_graph import FrameGraph, FrameResources, Pass
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
from flyaround.simulator.render.gl.timing import StageClock
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.rendered import Layer, Rendered
from flyaround.simulator.render.software.software_path import SoftwarePath

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import moderngl

    from flyaround.simulator.render.craft.label_pass import Surfaces
    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.gl.context import GlInfo
    from flyaround.simulator.runtime.arrays import Float32Array
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.illumination.irradiance import IrradianceField
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

_IMAGES = (RADIANCE, COVERAGE)


def sampling_passes(draw: Drawing) -> list[Pass]:
    """What the target's samples see, which depends on no light but the Sun's."""
    return [
        Pass("target.placement", draw.place_target, (SCENE, MODEL, VIEW), (TARGET, TARGET_TILES)),
        Pass("target.samples", draw.draw_samples, (SCENE, TARGET), (SAMPLES,), submits=True),
        Pass("target.shadow", draw.draw_shadow, (SCENE, VIEW, TARGET), (SHADOW,), submits=True),
        Pass("target.edges", draw.draw_edges, (SCENE, TARGET), (EDGE_SLOPES,), submits=True),
    ]


def shading_passes(draw: Drawing) -> list[Pass]:
    """The target's samples in the light of Sun, Earth and Moon, resolved to pixels."""
    sampled = (TARGET_TILES, SAMPLES, SHADOW, EDGE_SLOPES)
    return [
        Pass("target.light", draw.light_target, (SCENE, VIEW, TARGET), (TARGET_LIGHT,)),
        Pass(
            "target.shading",
            draw.shade_target,
            (SCENE, TARGET, *sampled, TARGET_LIGHT, *_IMAGES),
            _IMAGES,
            submits=True,
        ),
    ]


def view_passes(draw: Drawing) -> list[Pass]:
    """Where Moon and globe are in the image, and this frame's air."""
    return [
        Pass("moon.view", draw.find_moon, (SCENE,), (MOON,)),
        Pass("earth.view", draw.find_globe, (SCENE, VIEW), (EARTH_PASS, GLOBE_PASS, GLOBE, AIR)),
        Pass("earth.tiles", draw.cut_tiles, (SCENE, EARTH_PASS, GLOBE), (EARTH_TILES,)),
        Pass("earth.air", draw.fill_air_tables, (SCENE, EARTH_PASS, GLOBE, EARTH_TILES, AIR), (AIR_TABLES,)),
        Pass("globe.air", draw.fill_globe_air, (SCENE, GLOBE_PASS, GLOBE, AIR), (AIR_TABLES,)),
    ]


def earth_pass(draw: Drawing) -> Pass:
    """Ground, clouds and air: the first light of the sky behind the target."""
    reads = (SCENE, EARTH_PASS, EARTH_TILES, *_IMAGES)
    return Pass("earth.surface", draw.draw_earth, reads, (RADIANCE,), optional=(MOON,))


def sky_passes(draw: Drawing) -> list[Pass]:
    """All behind the target: each pass adds its light times the share that the target leaves open."""
    behind = (GLOBE, MOON)
    return [
        earth_pass(draw),
        Pass(
            "globe.surface",
            draw.draw_globe,
            (GLOBE_PASS, GLOBE, *_IMAGES),
            (RADIANCE,),
            optional=(AIR_TABLES,),
        ),
        Pass(
            "stars",
            draw.draw_stars,
            (SCENE, VIEW, *_IMAGES),
            (RADIANCE, STARLIGHT),
            optional=(*behind, AIR, TARGET),
        ),
        Pass(
            "moon", draw.draw_moon, (SCENE, MOON, *_IMAGES), (RADIANCE,), optional=(GLOBE, AIR_TABLES, TARGET)
        ),
        Pass("sun", draw.draw_sun, (SCENE, VIEW, *_IMAGES), (RADIANCE,), optional=(*behind, AIR_TABLES)),
    ]


def frame_passes(draw: Drawing, *, target: bool = True, first: Sequence[Pass] = ()) -> list[Pass]:
    """One picture, from the scene to its radiance.

    The target's samples come first: a software driver's threads draw them while the light of Earth and Moon, which
    they need not, is worked out. What they hide of the sky is never shaded.

    Parameters
    ----------
    target : draw it; else all that it hides, without it. first : done before anything of the Earth is needed.
    """
    return [
        _set_up(draw),
        _clear(draw),
        *(sampling_passes(draw) if target else ()),
        *first,
        _light_sky(draw),
        *view_passes(draw),
        *(shading_passes(draw) if target else ()),
        *sky_passes(draw),
        Pass("readback", draw.read_picture, (RADIANCE,), (PICTURE,), optional=(STARLIGHT,)),
    ]


def _set_up(draw: Drawing) -> Pass:
    return Pass("setup", draw.set_up, (SCENE,), (VIEW,), optional=(GIVEN_IRRADIANCE,))


def _clear(draw: Drawing) -> Pass:
    return Pass("clear", draw.clear, (SCENE,), _IMAGES)


def _light_sky(draw: Drawing) -> Pass:
    return Pass(
        "earth_and_moon_shine", draw.light_sky, (SCENE, VIEW, TARGET), (VIEW,), optional=(GIVEN_IRRADIANCE,)
    )


def _check_finite(
    radiance: Float32Array, scene: SceneState, target: Target, coverage: Callable[[], Float32Array]
) -> None:
    """Raise UserError if a pixel's radiance is infinite or not a number.

    Parameters
    ----------
    radiance : (H, W) or (H, W, n). coverage : reads (H, W), the share of each pixel that the target covers.
    """
    if np.isfinite(radiance.sum()):  # one pass; no sum of finite radiance overflows
        return
    bad = ~np.isfinite(radiance).reshape(*radiance.shape[:2], -1).all(axis=2)
    bodies = f"target {target.name}" if np.any(coverage()[bad] != 0) else "the sky"
    row, column = np.argwhere(bad)[0]
    raise UserError(
        f"{int(bad.sum())} pixels of {bodies} have no finite radiance in frame {scene.frame_index} at quality "
        f"{scene.quality} (the first in row {row}, column {column}); please report it with the target's file, and draw "
        "it with another --quality meanwhile"
    )


class Renderer:
    """Draws scenes headless, one at a time, from the thread that made it.

    Parameters
    ----------
    device_index : EGL device, ``None`` for the default one.
    context : an existing OpenGL >= 4.1 context to draw with instead; it is not released on close.
    timed : wait for the driver after every pass, so that ``stage_ms`` is each pass's own time. Without it the passes
        queue up, nothing stalls, and their time shows in the read-back. May be changed between frames.
    prefetched : `prefetch_earth_maps` of the first scenes to be drawn, for a quicker first frame.
    software_path : have Python find what need not be drawn, or may be interpolated. A software driver takes a fraction
        of the time then, and a GPU would wait for it. ``None``: where a software driver draws.

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
        prefetched: Mapping[Bands, EarthMaps] | None = None,
        software_path: bool | None = None,
    ) -> None:
        self.timed = timed
        self._device = device = Device(device_index, context)
        self.takes_software_path = device.info.is_software if software_path is None else software_path
        self._path = SoftwarePath(device) if self.takes_software_path else PlainPath()
        self._draw = Drawing(device, self._path, prefetched)
        self._graphs: dict[str, FrameGraph] = {}
        device.check("start-up")

    @property
    def info(self) -> GlInfo:
        """What draws; recorded beside every image."""
        return self._device.info

    def make_current(self) -> None:
        """Take the thread's OpenGL for this renderer's own context: another renderer may have been made since."""
        self._device.make_current()

    def render(
        self,
        scene: SceneState,
        target: Target,
        *,
        labels: bool = False,
        sky: IrradianceField | None = None,
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
            If ``target`` is not the one the scene was made for, or a pixel's radiance is not a number.
        """
        if layer == "craft":
            return self._render_craft(scene, target, sky)
        frame = self._begin(scene, target, sky)
        self._draw.prefetch_maps(scene)
        maps = self._draw.maps_of(scene.bands)
        with_target = layer == "all"
        if not with_target:
            frame[TARGET] = None
        if maps is None:
            stage_ms = self._run(
                f"frame {layer}", lambda: frame_passes(self._draw, target=with_target), frame
            )
        else:
            first = self._first_frame_passes(target=with_target)
            stage_ms = self._run("", lambda: frame_passes(self._draw, target=with_target, first=first), frame)
        picture = frame[PICTURE]
        _check_finite(picture, scene, target, frame[COVERAGE].read_coverage)
        coverage = depth = None
        inside = 1.0
        if labels:
            clock = StageClock(self._device.context, finish=self.timed)
            coverage = frame[COVERAGE].read_coverage()
            depth = self._draw.target.start_surfaces(scene, target, layers=False)().depth_m
            inside = self._draw.target.silhouette_inside(scene, target)
            clock.lap("labels")
            stage_ms |= clock.stage_ms
        self._device.check("a frame")
        return Rendered(picture, coverage, depth, inside, stage_ms)

    def start_surfaces(
        self, scene: SceneState, target: Target, *, layers: bool = False
    ) -> Callable[[], Surfaces]:
        """What of the target lies at each pixel's centre, without drawing the picture.

        The driver is drawing it when this returns; calling the result, once, waits for the end and reads it back.

        Parameters
        ----------
        layers : normals and parts too, not depth alone.
        """
        self._device.prepare(scene)
        finish = self._draw.target.start_surfaces(scene, target, layers=layers)

        def surfaces() -> Surfaces:
            self.make_current()
            seen = finish()
            self._device.check("the labels of a frame")
            return seen

        return surfaces

    def surfaces(self, scene: SceneState, target: Target, *, layers: bool = False) -> Surfaces:
        """`start_surfaces`, waited for."""
        return self.start_surfaces(scene, target, layers=layers)()

    def silhouette_inside(self, scene: SceneState, target: Target) -> float:
        """Share of the target's whole silhouette that falls on the image."""
        self._device.prepare(scene)
        return self._draw.target.silhouette_inside(scene, target)

    def _render_craft(self, scene: SceneState, target: Target, sky: IrradianceField | None) -> Rendered:
        frame, draw = self._begin(scene, target, sky), self._draw
        if sky is None:
            draw.prefetch_maps(scene)

        def passes() -> list[Pass]:
            return [
                _set_up(draw),
                *sampling_passes(draw),
                _light_sky(draw),
                _clear(draw),
                *shading_passes(draw),
            ]

        stage_ms = self._run("craft", passes, frame)
        clock = StageClock(self._device.context, finish=self.timed)
        drawn = frame.find(TARGET)
        part = PixelRect(0, 0, 0, 0) if drawn is None else drawn.rect
        light, share, window = frame[RADIANCE].read_part(part)
        clock.lap("readback")
        _check_finite(light, scene, target, lambda: share)
        self._device.check("a craft")
        return Rendered(light, share, None, 1.0, stage_ms | clock.stage_ms, window)

    def _begin(self, scene: SceneState, target: Target, sky: IrradianceField | None) -> FrameResources:
        """What a frame's passes are given."""
        if scene.target.sha256 != target.sha256:
            raise UserError(
                f"the scene was made for target {scene.target.name} ({scene.target.sha256[:12]}) and is drawn with "
                f"{target.name} ({target.sha256[:12]}); use the same version of the target file"
            )
        self._device.prepare(scene)
        frame = FrameResources()
        frame[SCENE], frame[MODEL], frame[GIVEN_IRRADIANCE] = scene, target, sky
        return frame

    def _run(self, kept_as: str, passes: Callable[[], list[Pass]], frame: FrameResources) -> dict[str, float]:
        """Run passes; a graph with a name is checked once and kept."""
        graph = self._graphs.get(kept_as)
        if graph is None:
            graph = FrameGraph(self._path.adapt(passes()), frame)
        if kept_as:
            self._graphs[kept_as] = graph
        return graph.run(self._device.context, frame, timed=self.timed)

    def _first_frame_passes(self, *, target: bool) -> list[Pass]:
        """Have the driver compile while the first frame's maps are decoded; what that draws is cleared."""
        draw = self._draw
        sampled = (TARGET, TARGET_TILES, SAMPLES, SHADOW, EDGE_SLOPES)
        shading = Pass("target.programs", draw.compile_shading, (SCENE, *sampled, *_IMAGES), _IMAGES)
        return [
            Pass("earth.programs", self._compile_earth, (SCENE, VIEW, *_IMAGES), _IMAGES, optional=(TARGET,)),
            *((shading,) if target else ()),
            Pass("clear.again", draw.clear, (SCENE,), _IMAGES),
        ]

    def _compile_earth(self, r: PassResources) -> None:
        """A second's work: some tiles are drawn from stand-ins of the maps."""
        passes = self._path.adapt([*view_passes(self._draw), earth_pass(self._draw)])
        frame = FrameResources()
        frame[SCENE], frame[VIEW], frame[TARGET] = r[SCENE], r[VIEW], r.find(TARGET)
        frame[RADIANCE], frame[COVERAGE] = r[RADIANCE], r[COVERAGE]
        with self._draw.stand_in_earth(r[SCENE]):
            FrameGraph(passes, frame).run(self._device.context, frame)

    def close(self) -> None:
        """Free what the renderer made, and its context."""
        self.make_current()
        self._draw.release()
        self._device.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
