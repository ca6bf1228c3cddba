"""Exposure in time: an image as the mean of several instants (motion blur) and of bands of rows (rolling shutter).

The scene is propagated to each instant and drawn again, so that craft, ground and stars are smeared by their own
motion. If nothing moves by ``MIN_MOTION_PX``, a single instant is drawn. If the Earth fills the image, ground and craft
are drawn separately, a few times only, and are smeared along their optical flow.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.imaging.image_motion import (
    background_px,
    craft_flow,
    image_motion_px,
    motion_bound_px,
    scene_propagator,
)
from flyaround.simulator.imaging.motion_blur import motion_blur
from flyaround.simulator.imaging.rolling_shutter import crop, row_bands
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.imaging.image_motion import CraftFlow
    from flyaround.simulator.render.renderer import Rendered, Renderer
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

MIN_MOTION_PX = 0.3
"""Motion during the exposure below which one instant suffices [px]: its blur is 1 / sqrt(12) of it, below 0.1 px."""

INSTANT_SPACING_PX = 1.0
"""Motion between instants [px]. Pixels integrate over their area, so steps of one pixel leave no gap."""

GAUSS_LIMITS_PX = (1.1, 2.1, 3.1)
"""Motion up to which 2, 3 and 4 Gauss-Legendre instants suffice [px]. Up to the Nyquist frequency, the sum of cosines
at the nodes, times the pixel's own sinc(f), is then within 0.02 of sinc(f d) sinc(f), the contrast of a motion by d.
"""

MAX_BLUR_PX = 32.0
"""Longest blur of the ground [px]; longer ones are drawn by instants."""

MAX_PATH_SAG_PX = 0.05
"""Largest deviation of the ground's path from a straight line, at its centre [px]."""

SINGLE_DRAWING_PX, DRAWING_SPACING_PX = 1.0, 5.0
"""Ground motion up to which one drawing suffices, and the motion between drawings otherwise [px]. Averaging removes the
dependence of clouds and city lights on sub-pixel positions.
"""

# Distance from the body's centre beyond which the ground's motion during an exposure is ignored [m].
LOW_ORBIT_M = 5e7

TEST_POINTS, TEST_POINTS_DISTORTED = 5, 17
"""Points along each side of the image where the ground is tested, without and with lens distortion."""

# Maximum number of instants that are averaged for motion blur.
MAX_INSTANTS = 256


@dataclass(frozen=True)
class Instants:
    """Times relative to the middle of a row's exposure [s], and weights that sum to one."""

    times_s: tuple[float, ...] = (0.0,)
    weights: tuple[float, ...] = (1.0,)

    def __len__(self) -> int:
        """Return the number of instants."""
        return len(self.times_s)


def instants_of(motion_px: float, exposure_s: float) -> Instants:
    """Return the instants for a motion; one if it is invisible."""
    if motion_px < MIN_MOTION_PX:
        return Instants()
    for n, limit_px in enumerate(GAUSS_LIMITS_PX, start=2):
        if motion_px <= limit_px:
            nodes, weights = np.polynomial.legendre.leggauss(n)
            return Instants(tuple((exposure_s / 2 * nodes).tolist()), tuple((weights / 2).tolist()))
    n = int(np.clip(np.ceil(motion_px / INSTANT_SPACING_PX), 1, MAX_INSTANTS))
    nodes = (np.arange(n) + 0.5) / n - 0.5
    return Instants(tuple((exposure_s * nodes).tolist()), (1 / n,) * n)


def instants(
    scene: SceneState, target: Target, scene_at: Callable[[float], SceneState] | None = None
) -> Instants:
    """Return the instants of a whole scene; ``scene_at`` is the result of `scene_propagator` for it."""
    if not scene.shutter.motion_blur or motion_bound_px(scene, target, scene.exposure_s) < MIN_MOTION_PX:
        return Instants()
    return instants_of(image_motion_px(scene, target, scene.exposure_s, scene_at), scene.exposure_s)


@dataclass(frozen=True, eq=False)
class MeanRadiance:
    """Mean radiance over the exposure (H, W[, 3]) [W m-2 sr-1], and the timings of drawing it."""

    radiance: Float32Array
    stage_ms: dict[str, float]
    n_drawn: int


def integrate(renderer: Renderer, scene: SceneState, target: Target) -> MeanRadiance:
    """Draw a scene over its exposure.

    Returns
    -------
    MeanRadiance
        Mean radiance, each band of rows over its own exposure; times by stage [ms], summed over all drawings; and the
        number of drawings.
    """
    scene_at = scene_propagator(scene)
    bands, instants_ = row_bands(scene, target), instants(scene, target, scene_at)
    if len(bands) == 1 and len(instants_) == 1 and bands[0].dt_s == 0:
        rendered = renderer.render(scene, target)
        return MeanRadiance(rendered.radiance, rendered.stage_ms, 1)
    n_drawings = 0 if len(bands) > 1 else ground_drawings(scene, scene_at)
    if n_drawings:
        return _integrate_over_ground(renderer, scene, target, n_drawings, scene_at)
    parts: dict[int, Float32Array] = {}
    stage_ms: dict[str, float] = {}
    for band in bands:
        camera = crop(scene.camera, 0, band.y0, scene.camera.width_px, band.y1 - band.y0)
        total: Float32Array | None = None
        for dt, weight in zip(instants_.times_s, instants_.weights, strict=True):
            at_band = replace(scene_at(band.dt_s + dt), camera=camera)
            rendered = renderer.render(at_band, target)
            part = rendered.radiance * np.float32(weight)
            total = part if total is None else np.add(total, part, out=total)
            add_times(stage_ms, rendered.stage_ms)
        if total is not None:
            parts[band.y0] = total
    radiance = np.empty((scene.camera.height_px, *next(iter(parts.values())).shape[1:]), np.float32)
    for y0, part in sorted(parts.items(), reverse=True):
        radiance[y0 : y0 + len(part)] = part
    return MeanRadiance(radiance, stage_ms, len(bands) * len(instants_))


def ground_drawings(scene: SceneState, scene_at: Callable[[float], SceneState] | None = None) -> int:
    """Return the number of drawings of a ground that fills the image; 0 if it does not fill it, or moves too far.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    scene_at : callable, optional
        Result of `scene_propagator` for the scene.
    """
    globe = scene.globe
    is_far = float(np.linalg.norm(np.subtract(scene.r_camera_eci_m, globe.r_eci_m))) > LOW_ORBIT_M
    if not scene.environment.draws(globe.body) or globe.name != scene.central_body or is_far:
        return 0  # the Moon may be in front of the ground
    scene_at = scene_at or scene_propagator(scene)
    early, late = (scene_at(sign * scene.exposure_s / 2) for sign in (-1, 1))
    c = scene.camera
    # disc and undistorted image are convex, so points along the edges suffice; a distorted image needs more points
    n = TEST_POINTS if c.distortion.is_none else TEST_POINTS_DISTORTED
    side_px = [np.linspace(-0.5, size - 0.5, n) for size in (c.width_px, c.height_px)]
    points = np.stack(np.meshgrid(*side_px), axis=-1).reshape(-1, 2)
    if not all(_is_all_ground(moment, points) for moment in (early, scene, late)):
        return 0
    ends = [background_px(scene, moment, points) for moment in (early, late)]
    displacement_px = float(np.abs(ends[1] - ends[0]).max())
    sag_px = float(np.abs((ends[0] + ends[1]) / 2 - points).max())
    # negated, so that NaN is refused
    if not (displacement_px <= MAX_BLUR_PX and sag_px <= MAX_PATH_SAG_PX):
        return 0
    return (
        1
        if displacement_px <= SINGLE_DRAWING_PX
        else max(int(np.ceil(displacement_px / DRAWING_SPACING_PX)), 2)
    )


def _is_all_ground(scene: SceneState, pixels: FloatArray) -> bool:
    """Return True if rays through (K, 2) pixels all hit the globe, even its lowest surface."""
    body = scene.globe.body
    r = np.subtract(scene.r_camera_eci_m, scene.globe.r_eci_m)
    along = -scene.camera.rays(pixels) @ matrix_from_quat(scene.q_camera_from_eci_wxyz) @ r
    return bool(np.all((along > 0) & (r @ r - along**2 < body.polar_radius_m**2)))


def _integrate_over_ground(
    renderer: Renderer,
    scene: SceneState,
    target: Target,
    n_drawings: int,
    scene_at: Callable[[float], SceneState],
) -> MeanRadiance:
    """Average the moving ground and the craft separately over the exposure, then composite them. Occlusion changes
    during the exposure are ignored.
    """
    stage_ms: dict[str, float] = {"motion_blur": 0.0}
    mean: Float32Array | None = None
    for mid, early, late in _spans(scene, n_drawings, scene_at):
        rendered = renderer.render(mid, target, layer="sky")
        add_times(stage_ms, rendered.stage_ms)
        start = time.perf_counter()
        blurred = motion_blur(rendered.radiance, partial(_background_displacements_px, mid, early, late))
        mean = blurred if mean is None else np.add(mean, blurred, out=mean)
        stage_ms["motion_blur"] += (time.perf_counter() - start) * 1e3
    if mean is None:
        raise ValueError("the number of drawings of the ground must be positive")
    if n_drawings > 1:
        mean /= np.float32(n_drawings)
    early, late = (scene_at(sign * scene.exposure_s / 2) for sign in (-1, 1))
    spans = _spans(scene, craft_flow(scene, early, late, target).n_drawings, scene_at)
    craft_images: list[Rendered] = []
    for mid, early, late in spans:
        craft = renderer.render(mid, target, layer="craft")
        add_times(stage_ms, craft.stage_ms)
        start = time.perf_counter()
        craft_images.append(_smear(craft, craft_flow(mid, early, late, target), scene.camera))
        stage_ms["motion_blur"] += (time.perf_counter() - start) * 1e3
    _composite(mean, craft_images)
    return MeanRadiance(mean, stage_ms, n_drawings + len(spans))


def _spans(
    scene: SceneState, n: int, scene_at: Callable[[float], SceneState]
) -> list[tuple[SceneState, SceneState, SceneState]]:
    """Return the middle, beginning and end of ``n`` equal parts of an exposure."""
    parts = [[(k + part) / n - 0.5 for part in (0.5, 0.0, 1.0)] for k in range(n)]
    return [
        (scene_at(m * scene.exposure_s), scene_at(a * scene.exposure_s), scene_at(b * scene.exposure_s))
        for m, a, b in parts
    ]


def _smear(craft: Rendered, flow: CraftFlow, camera: Camera) -> Rendered:
    """Smear a craft's radiance and coverage along its flow, in a window that contains the smear."""
    if craft.coverage is None or not craft.radiance.size or flow.longest_px < MIN_MOTION_PX:
        return craft
    reach = int(np.ceil(flow.longest_px / 2)) + 2
    rows, columns = (
        slice(max(side.start - reach, 0), min(side.stop + reach, size))
        for side, size in zip(craft.window, (camera.height_px, camera.width_px), strict=True)
    )
    radiance_and_coverage = np.dstack([craft.radiance, craft.coverage])
    y, x = craft.window[0].start - rows.start, craft.window[1].start - columns.start
    padded = np.zeros(
        (rows.stop - rows.start, columns.stop - columns.start, radiance_and_coverage.shape[2]), np.float32
    )
    padded[y : y + radiance_and_coverage.shape[0], x : x + radiance_and_coverage.shape[1]] = (
        radiance_and_coverage
    )
    blurred = motion_blur(
        padded, lambda px: flow.displacements_px(px + np.array([columns.start, rows.start]))
    )
    light = blurred[..., 0] if craft.radiance.ndim == 2 else blurred[..., :-1]
    return replace(craft, radiance=light, coverage=blurred[..., -1], window=(rows, columns))


def _composite(ground: Float32Array, craft_images: list[Rendered]) -> None:
    """Composite the mean of craft images over a ground (H, W[, bands]), in place."""
    visible = [craft for craft in craft_images if craft.radiance.size]
    if not visible:
        return
    rows, columns = (
        slice(min(c.window[k].start for c in visible), max(c.window[k].stop for c in visible)) for k in (0, 1)
    )
    background = ground[rows, columns]
    light, transmission = np.zeros_like(background), np.ones(background.shape[:2], np.float32)
    weight = np.float32(1 / len(craft_images))
    for craft in visible:
        y, x = (
            slice(span.start - image_span.start, span.stop - image_span.start)
            for span, image_span in zip(craft.window, (rows, columns), strict=True)
        )
        if craft.coverage is None:
            continue
        light[y, x] += craft.radiance * weight
        transmission[y, x] -= craft.coverage * weight
    # rounding and the overshoot of cubic interpolation may give negative values
    np.maximum(transmission, 0, out=transmission)
    background *= transmission if background.ndim == 2 else transmission[..., None]
    background += light


def _background_displacements_px(
    mid: SceneState, early: SceneState, late: SceneState, pixels: FloatArray
) -> FloatArray:
    """Return (K, 2) displacements from ``early`` to ``late`` of the background at (K, 2) pixels of ``mid`` [px]."""
    return np.asarray(background_px(mid, late, pixels) - background_px(mid, early, pixels))


def add_times(total_ms: dict[str, float], more_ms: dict[str, float]) -> None:
    """Add one drawing's timings to another's."""
    for name, ms in more_ms.items():
        total_ms[name] = total_ms.get(name, 0.0) + ms
