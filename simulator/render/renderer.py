"""The renderer: draws a SceneState to an image of radiance by a list of passes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Self

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.device import Device
from flyaround.simulator.render.earth.earth_view import Earths
from flyaround.simulator.render.frame_graph import FrameGraph, FrameResources
from flyaround.simulator.render.frame_images import COVERAGE, PICTURE, RADIANCE
from flyaround.simulator.render.frame_passes import gpu_passes
from flyaround.simulator.render.gl.timing import StageClock
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.software.software_path import software_passes
from flyaround.simulator.render.view import GIVEN_IRRADIANCE, MODEL, SCENE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import moderngl

    from flyaround.simulator.render.craft.label_raster import Surfaces
    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.frame_graph import Pass
    from flyaround.simulator.render.gl.context import GlInfo
    from flyaround.simulator.runtime.arrays import Float32Array
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.illumination.irradiance import IrradianceField
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target


Layer = Literal["all", "craft", "sky"]
"""Layers to draw: everything; only the target, in the scene's light; or only the background."""


@dataclass(frozen=True, eq=False)
class Rendered:
    """One noise-free image.

    Parameters
    ----------
    radiance : (H, W) array
        Radiance, row 0 at the top [W m-2 sr-1 in the band]; (H, W, 3) for three bands.
    coverage : (H, W) array or None
        Fraction of each pixel that the target covers; only with labels.
    depth_m : (H, W) array or None
        Camera z of the target's nearest surface at the pixel's centre, NaN outside; only with labels.
    silhouette_inside : float
        Fraction of the area of the target's silhouette that is inside the image; only with labels.
    stage_ms : dict
        Time per pass [ms].
    window : tuple of slice, optional
        Rows and columns of radiance and coverage; the whole image except for the layer ``craft``.
    """

    radiance: Float32Array
    coverage: Float32Array | None
    depth_m: Float32Array | None
    silhouette_inside: float
    stage_ms: dict[str, float]
    window: tuple[slice, slice] = (slice(None), slice(None))


def _check_finite(
    radiance: Float32Array, scene: SceneState, target: Target, coverage: Callable[[], Float32Array]
) -> None:
    """Raise UserError if a pixel's radiance is infinite or not a number, naming the target if it covers the pixel."""
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
    """Headless renderer of scenes, one at a time, in the thread that created it.

    Parameters
    ----------
    device_index : int, optional
        Index of the EGL device, ``None`` for the default one.
    context : Context, optional
        Existing OpenGL >= 4.1 context to use instead; `close` does not release it.
    timed : bool, optional
        True to wait for the driver after every pass, so that ``stage_ms`` holds the time of each. Otherwise the passes
        only queue commands, and the read-back takes the time. May be changed between frames.
    prefetched : mapping, optional
        Results of `prefetch_earth_maps` for the first scenes, for a quicker first frame.
    software_path : bool, optional
        True to cull and interpolate on the CPU, which a software driver needs and a GPU would wait for. ``None``
        chooses by the driver.

    Raises
    ------
    UserError
        If there is no OpenGL >= 4.1; the message says how to get one.
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
        self.device = device = Device(device_index, context)
        self.uses_software_path = device.info.is_software if software_path is None else software_path
        self._earths = Earths(device, prefetched)
        self._passes = (software_passes if self.uses_software_path else gpu_passes)(device, self._earths)
        self._graphs: dict[str, FrameGraph] = {}
        device.check("start-up")

    @property
    def info(self) -> GlInfo:
        """The OpenGL driver, to be recorded with every image."""
        return self.device.info

    def make_current(self) -> None:
        """Make this renderer's context current in this thread; another renderer may have been created since."""
        self.device.make_current()

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
        scene : SceneState
            Scene to render.
        target : Target
            The target that ``scene.target`` names.
        labels : bool, optional
            True to also return coverage, depth and the fraction of the silhouette inside the image.
        sky : IrradianceField, optional
            Irradiance on the target that replaces the scene's Earth-shine and Moon-shine, for validation.
        layer : Layer, optional
            ``craft`` returns premultiplied radiance and coverage in the ``window`` that the target may touch; the layer
            ``sky`` times one minus that coverage completes the image.

        Returns
        -------
        Rendered
            Radiance (H, W, bands) [W m-2 sr-1], and coverage and depth [m] if requested.

        Raises
        ------
        UserError
            If ``target`` is not the one that the scene was built for, or a pixel's radiance is not finite.
        """
        if layer == "craft":
            return self._render_craft(scene, target, sky)
        frame = self._begin(scene, target, sky)
        self._earths.prefetch(scene)
        draws_target = layer == "all"
        if not draws_target:
            frame[TARGET] = None
        compiles_earth = self._earths.pending(scene.bands) is not None
        stage_ms = self._run(
            "" if compiles_earth else layer,
            lambda: self._passes.frame(target=draws_target, first=compiles_earth),
            frame,
        )
        picture = frame[PICTURE]
        _check_finite(picture, scene, target, frame[COVERAGE].read_coverage)
        coverage = depth = None
        silhouette_inside = 1.0
        if labels:
            clock = StageClock(self.device.context, finish=self.timed)
            coverage = frame[COVERAGE].read_coverage()
            depth = self._passes.labels.start_surfaces(scene, target, layers=False)().depth_m
            silhouette_inside = self._passes.labels.silhouette_inside(scene, target)
            clock.lap("labels")
            stage_ms |= clock.stage_ms
        self.device.check("a frame")
        return Rendered(picture, coverage, depth, silhouette_inside, stage_ms)

    def start_surfaces(
        self, scene: SceneState, target: Target, *, layers: bool = False
    ) -> Callable[[], Surfaces]:
        """Start drawing the target's surface at each pixel's centre, without the image.

        The driver may still be drawing when this method returns.

        Parameters
        ----------
        scene : SceneState
            Scene to render.
        target : Target
            The target that ``scene.target`` names.
        layers : bool, optional
            True for normals and parts, False for depth only.

        Returns
        -------
        callable
            Function that waits for the driver and reads the surface; call it once.
        """
        self.device.prepare(scene)
        finish = self._passes.labels.start_surfaces(scene, target, layers=layers)

        def surfaces() -> Surfaces:
            self.make_current()
            result = finish()
            self.device.check("the labels of a frame")
            return result

        return surfaces

    def surfaces(self, scene: SceneState, target: Target, *, layers: bool = False) -> Surfaces:
        """Draw the target's surface at each pixel's centre; see `start_surfaces`.

        Returns
        -------
        Surfaces
            Depth [m], normals and parts by pixel.
        """
        return self.start_surfaces(scene, target, layers=layers)()

    def silhouette_inside(self, scene: SceneState, target: Target) -> float:
        """Return the fraction of the area of the target's silhouette that is inside the image.

        Returns
        -------
        float
            Fraction of 0 to 1; 0 if the target is behind the camera.
        """
        self.device.prepare(scene)
        return self._passes.labels.silhouette_inside(scene, target)

    def _render_craft(self, scene: SceneState, target: Target, sky: IrradianceField | None) -> Rendered:
        frame = self._begin(scene, target, sky)
        if sky is None:
            self._earths.prefetch(scene)
        has_sky_light = sky is not None
        stage_ms = self._run(
            "craft with sky light" if has_sky_light else "craft",
            lambda: self._passes.craft(has_sky_light=has_sky_light),
            frame,
        )
        clock = StageClock(self.device.context, finish=self.timed)
        placed = frame.find(TARGET)
        rect = PixelRect(0, 0, 0, 0) if placed is None else placed.rect
        radiance, coverage, window = frame[RADIANCE].read_part(rect)
        clock.lap("readback")
        _check_finite(radiance, scene, target, lambda: coverage)
        self.device.check("a craft")
        return Rendered(radiance, coverage, None, 1.0, stage_ms | clock.stage_ms, window)

    def _begin(self, scene: SceneState, target: Target, sky: IrradianceField | None) -> FrameResources:
        """Return the resources that a frame's passes start from."""
        if scene.target.sha256 != target.sha256:
            raise UserError(
                f"the scene was made for target {scene.target.name} ({scene.target.sha256[:12]}) and is drawn with "
                f"{target.name} ({target.sha256[:12]}); use the same version of the target file"
            )
        self.device.prepare(scene)
        frame = FrameResources()
        frame[SCENE], frame[MODEL], frame[GIVEN_IRRADIANCE] = scene, target, sky
        return frame

    def _run(
        self, name: str, make_passes: Callable[[], list[Pass]], frame: FrameResources
    ) -> dict[str, float]:
        """Run the passes of a graph. A named graph is created and checked once."""
        graph = self._graphs.get(name)
        if graph is None:
            graph = FrameGraph(make_passes(), frame)
        if name:
            self._graphs[name] = graph
        return graph.run(self.device.context, frame, timed=self.timed)

    def close(self) -> None:
        """Free the renderer's resources and its own context."""
        self.make_current()
        self._passes.release()
        self._earths.release()
        self.device.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
