"""The exposure in time: a picture as the mean of instants (motion blur) and of bands of rows (rolling shutter).

Each instant is a whole scene, moved by the propagated rates and drawn anew, so that the smear of the craft, of the
ground and of the stars is each its own motion's. A picture in which nothing moves by as much as ``STILL_PX`` is drawn
once. Where the Earth fills the image its ground is drawn a few times only, behind the craft as well, and smeared along
its own flow; before it the craft is drawn at the instants that its own motion asks for.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from simulator.imaging.motion_blur import smear
from simulator.labels.boxes import box_3d_m
from simulator.render.view import POLE_M
from simulator.scene.motion import scene_at
from simulator.world.ephemeris.bodies import BODIES
from simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Callable

    from simulator.camera.lens.camera_model import Camera
    from simulator.render.rendered import Rendered
    from simulator.render.renderer import Renderer
    from simulator.render.target.label_pass import Surfaces
    from simulator.runtime.arrays import Float32Array, FloatArray
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target

STILL_PX = 0.3
"""Motion during the exposure below which one instant serves: its smear is under a tenth of a pixel rms."""
INSTANT_PX = 1.0
"""Motion between instants. A pixel integrates over itself, so steps of one pixel leave no gap in a smear."""
GAUSS_PX = (1.1, 2.1, 3.1)
"""Motion up to which 2, 3 and 4 instants at Gauss's places serve: up to Nyquist's frequency the contrast of what is
smeared is within 2 % of the still one's, against 3 to 8 % with instants evenly spread."""
LONGEST_SMEAR_PX = 32.0
"""Of the ground; longer ones are drawn instant by instant."""
STRAIGHT_PX = 0.05
"""What the middle of the ground's way may be off the middle of its ends."""
ONCE_PX, DRAWN_PX = 1.0, 2.5
"""Motion of the ground up to which it is drawn once, and between its drawings where it is more: what the renderer makes
of clouds and of a city's lights depends a little on where in a pixel they fall, and is to be averaged."""
LOW_ORBIT_M = 5e7
MAX_INSTANTS = 256
FASTEST_GROUND_M_S = 1.6e3
"""Earth's equator turns at 465 m/s; the Moon goes round the Earth at up to 1.1 km/s."""
BAND_PX = 0.2
"""Motion between bands of rows of a rolling shutter: labels and picture are within half of it of the true row's."""


@dataclass(frozen=True)
class RowBand:
    """Rows ``y0 <= y < y1``, exposed about ``dt_s`` from the picture's mid-exposure."""

    y0: int
    y1: int
    dt_s: float


def crop(camera: Camera, x0: int, y0: int, width_px: int, height_px: int) -> Camera:
    """The camera that sees a window of the image, or beyond its edges."""
    return replace(
        camera, width_px=width_px, height_px=height_px, cx_px=camera.cx_px - x0, cy_px=camera.cy_px - y0
    )


def moments_of(scene: SceneState) -> Callable[[float], SceneState]:
    """`scene_at` of one scene, which works out each moment once: an exposure's ends are asked for again and again."""
    return cache(partial(scene_at, scene))


def image_motion_px(
    scene: SceneState, target: Target, span_s: float, at: Callable[[float], SceneState] | None = None
) -> float:
    """Largest way that anything on the image goes in ``span_s`` about mid-exposure [px].

    Followed are the corners of the box about the craft, and a grid of directions: where one meets the Earth, the
    ground there, else the sky.

    Parameters
    ----------
    at : `moments_of` the scene.
    """
    if span_s == 0:
        return 0.0
    at = at or moments_of(scene)
    early, late = (_places_px(scene, at(sign * span_s / 2), target) for sign in (-1, 1))
    way = np.hypot(*(late - early).T)
    return float(np.nanmax(way, initial=0.0))


def motion_bound_px(scene: SceneState, target: Target, span_s: float) -> float:
    """A motion that `image_motion_px` is never above, for a fraction of its cost; infinite where it is not known."""
    camera, size = scene.camera, float(np.linalg.norm(box_3d_m(target), axis=1).max())
    t = scene.t_camera_from_target_m
    body = BODIES[scene.central_body]
    moon = scene.central_body == "moon"
    height = math.dist(scene.r_camera_eci_m, scene.r_moon_eci_m if moon else (0.0, 0.0, 0.0)) - body.radius_m
    if not camera.distortion.is_none or t[2] <= 2 * size or height <= 1e3:
        return float("inf")
    passing = math.dist(scene.v_target_eci_m_s, scene.v_camera_eci_m_s)
    turning, spinning = math.hypot(*scene.omega_camera_rad_s), math.hypot(*scene.omega_target_rad_s)
    craft = (passing + size * spinning) / (t[2] - size)
    ground = (math.hypot(*scene.v_camera_eci_m_s) + FASTEST_GROUND_M_S) / height
    # an angle's image grows with the square of the distance from the axis
    x = max(camera.cx_px, camera.width_px - camera.cx_px) / camera.fx_px
    y = max(camera.cy_px, camera.height_px - camera.cy_px) / camera.fy_px
    aside = max(math.hypot(x, y), (math.hypot(t[0], t[1]) + size) / (t[2] - size))
    rate = turning + max(craft, ground if scene.environment.earth else 0.0)
    # a quarter more: rates change within the span by far less
    return 1.25 * span_s * rate * max(camera.fx_px, camera.fy_px) * (1 + aside**2)


def _places_px(scene: SceneState, then: SceneState, target: Target) -> FloatArray:
    """(K, 2) where the followed points of ``scene`` are seen in the scene ``then``; NaN behind the camera."""
    c = scene.camera
    u, v = np.meshgrid(np.linspace(0, c.width_px - 1, 5), np.linspace(0, c.height_px - 1, 5))
    behind = _behind_px(scene, then, np.stack([u.ravel(), v.ravel()], axis=1))
    return np.concatenate([_corners_px(scene, then, target), behind])


def _behind_px(scene: SceneState, then: SceneState, pixels: FloatArray) -> FloatArray:
    """(K, 2) where the ground or sky at pixels of ``scene`` is seen in the scene ``then``."""
    d = scene.camera.rays(pixels)
    d = d @ matrix_from_quat(scene.q_camera_from_eci_wxyz)  # in ECI
    body = BODIES[scene.central_body]
    moon = scene.central_body == "moon"
    # the Moon turns too slowly to matter here
    here, there = (np.eye(3) if moon else matrix_from_quat(s.q_itrs_from_eci_wxyz).T for s in (scene, then))
    centers = [np.asarray(s.r_moon_eci_m) if moon else np.zeros(3) for s in (scene, then)]
    r = np.asarray(scene.r_camera_eci_m) - centers[0]
    along = -d @ r
    left = along**2 - (r @ r - body.radius_m**2)
    ground = (left > 0) & (along > 0) & scene.environment.earth
    place = r + (along - np.sqrt(np.maximum(left, 0)))[:, None] * d
    place = place @ (there @ here.T).T + centers[1] - np.asarray(then.r_camera_eci_m)
    seen = np.where(ground[:, None], place, d) @ matrix_from_quat(then.q_camera_from_eci_wxyz).T
    return np.asarray(then.camera.project(seen))


def _corners_px(scene: SceneState, then: SceneState, target: Target) -> FloatArray:
    """(8, 2) corners of the box about the craft in the scene ``then``; zeros where they are not in the image."""
    corners, c = box_3d_m(target), scene.camera
    craft = then.camera.project(then.camera_from_target.apply(corners))
    at = scene.camera.project(scene.camera_from_target.apply(corners))
    # a craft far outside the image smears nothing
    size = np.array([c.width_px, c.height_px])
    if not np.all(np.isfinite(at)) or np.any(at.max(axis=0) < 0) or np.any(at.min(axis=0) > size):
        craft = np.zeros_like(craft)
    return np.asarray(craft)


@dataclass(frozen=True)
class Instants:
    """Times from the middle of a row's exposure [s], and their weights, whose sum is one."""

    times_s: tuple[float, ...] = (0.0,)
    weights: tuple[float, ...] = (1.0,)

    def __len__(self) -> int:
        """How many there are."""
        return len(self.times_s)


def instants_of(motion_px: float, exposure_s: float) -> Instants:
    """The instants that a motion asks for; one where it is too small to be seen."""
    if motion_px < STILL_PX:
        return Instants()
    for n, most in enumerate(GAUSS_PX, start=2):
        if motion_px <= most:
            at, weights = np.polynomial.legendre.leggauss(n)
            return Instants(tuple((exposure_s / 2 * at).tolist()), tuple((weights / 2).tolist()))
    n = int(np.clip(np.ceil(motion_px / INSTANT_PX), 1, MAX_INSTANTS))
    at = (np.arange(n) + 0.5) / n - 0.5
    return Instants(tuple((exposure_s * at).tolist()), (1 / n,) * n)


def instants(scene: SceneState, target: Target, at: Callable[[float], SceneState] | None = None) -> Instants:
    """The instants to draw a whole scene at; ``at``: `moments_of` the scene."""
    if not scene.shutter.motion_blur or motion_bound_px(scene, target, scene.exposure_s) < STILL_PX:
        return Instants()
    return instants_of(image_motion_px(scene, target, scene.exposure_s, at), scene.exposure_s)


def row_bands(scene: SceneState, target: Target) -> tuple[RowBand, ...]:
    """Bands of rows of equal height that a rolling shutter is drawn in; the last may overlap the one before."""
    height = scene.camera.height_px
    if not scene.shutter.is_rolling:
        return (RowBand(0, height, 0.0),)
    motion = image_motion_px(scene, target, scene.shutter.readout_s)
    n = int(np.clip(np.ceil(motion / BAND_PX), 1, height))
    rows = -(-height // n)
    bands = []
    for y in range(0, height, rows):
        y0 = min(y, height - rows)
        dt = float(scene.shutter.row_time_s(y0 + (rows - 1) / 2, height))
        bands.append(RowBand(y0, y0 + rows, dt))
    return tuple(bands)


@dataclass(frozen=True, eq=False)
class Exposed:
    """Mean radiance over the exposure (H, W[, 3]) [W m-2 sr-1], and the ledger of drawing it."""

    radiance: Float32Array
    stage_ms: dict[str, float]
    n_drawn: int


def integrate(renderer: Renderer, scene: SceneState, target: Target) -> Exposed:
    """Draw a scene over its exposure."""
    at = moments_of(scene)
    bands, moments = row_bands(scene, target), instants(scene, target, at)
    if len(bands) == 1 and len(moments) == 1 and bands[0].dt_s == 0:
        rendered = renderer.render(scene, target)
        return Exposed(rendered.radiance, rendered.stage_ms, 1)
    n_drawings = 0 if len(bands) > 1 else drawings_of_ground(scene, at)
    if n_drawings:
        return _over_passing_ground(renderer, scene, target, n_drawings, at)
    parts: dict[int, Float32Array] = {}
    stage_ms: dict[str, float] = {}
    for band in bands:
        camera = crop(scene.camera, 0, band.y0, scene.camera.width_px, band.y1 - band.y0)
        total: Float32Array | None = None
        for dt, weight in zip(moments.times_s, moments.weights, strict=True):
            moved = replace(at(band.dt_s + dt), camera=camera)
            rendered = renderer.render(moved, target)
            part = rendered.radiance * np.float32(weight)
            total = part if total is None else np.add(total, part, out=total)
            _add_times(stage_ms, rendered.stage_ms)
        if total is not None:
            parts[band.y0] = total
    radiance = np.empty((scene.camera.height_px, *next(iter(parts.values())).shape[1:]), np.float32)
    for y0, part in sorted(parts.items(), reverse=True):
        radiance[y0 : y0 + len(part)] = part
    return Exposed(radiance, stage_ms, len(bands) * len(moments))


def drawings_of_ground(scene: SceneState, at: Callable[[float], SceneState] | None = None) -> int:
    """How often ground that fills the image is to be drawn and smeared; 0 where it does not, or goes too far.

    Parameters
    ----------
    at : `moments_of` the scene.
    """
    far = float(np.linalg.norm(scene.r_camera_eci_m)) > LOW_ORBIT_M
    if not scene.environment.earth or scene.central_body != "earth" or far:
        return 0  # the Moon may be before the ground
    at = at or moments_of(scene)
    early, late = (at(sign * scene.exposure_s / 2) for sign in (-1, 1))
    c = scene.camera
    across = [np.linspace(-0.5, size - 0.5, 5) for size in (c.width_px, c.height_px)]
    places = np.stack(np.meshgrid(*across), axis=-1).reshape(-1, 2)
    # the Earth's disc is convex, and so is the image where no lens bends it
    if not c.distortion.is_none or not all(_all_ground(then, places) for then in (early, scene, late)):
        return 0
    ends = [_behind_px(scene, then, places) for then in (early, late)]
    way = float(np.abs(ends[1] - ends[0]).max())
    bend = float(np.abs((ends[0] + ends[1]) / 2 - places).max())
    # written so that what is not a number is refused
    if not (way <= LONGEST_SMEAR_PX and bend <= STRAIGHT_PX):
        return 0
    return 1 if way <= ONCE_PX else max(int(np.ceil(way / DRAWN_PX)), 2)


def _all_ground(scene: SceneState, pixels: FloatArray) -> bool:
    """Whether rays through (K, 2) pixels all meet the Earth, be it where it is lowest."""
    r = np.asarray(scene.r_camera_eci_m)
    along = -scene.camera.rays(pixels) @ matrix_from_quat(scene.q_camera_from_eci_wxyz) @ r
    return bool(np.all((along > 0) & (r @ r - along**2 < POLE_M**2)))


def _over_passing_ground(
    renderer: Renderer,
    scene: SceneState,
    target: Target,
    n_drawings: int,
    at: Callable[[float], SceneState],
) -> Exposed:
    """The ground's mean, and before it the craft's: what of one changes while the other's edge passes is left out."""
    stage_ms: dict[str, float] = {"smear": 0.0}
    means: list[Float32Array] = []
    span_s = scene.exposure_s / n_drawings
    ends = [_corners_px(scene, at(sign * scene.exposure_s / 2), target) for sign in (-1, 1)]
    motion = float(np.nanmax(np.hypot(*(ends[1] - ends[0]).T), initial=0.0))
    moments = instants_of(motion, scene.exposure_s)
    # the driver draws the first craft's samples while the ground's are prepared, and shades it during the last smear
    first = renderer.begin_craft(at(moments.times_s[0]), target)
    for k in range(n_drawings):
        mid, early, late = (at((k + part) * span_s - scene.exposure_s / 2) for part in (0.5, 0.0, 1.0))
        rendered = renderer.render(mid, target, layer="sky")
        _add_times(stage_ms, rendered.stage_ms)
        if k == n_drawings - 1:
            first.shade()
        start = time.perf_counter()
        smeared = smear(rendered.radiance, partial(_ways_px, mid, early, late))
        means = [np.add(means[0], smeared, out=means[0])] if means else [smeared]
        stage_ms["smear"] += (time.perf_counter() - start) * 1e3
    mean = means[0]
    if n_drawings > 1:
        mean /= np.float32(n_drawings)
    crafts: list[tuple[Rendered, np.float32]] = []
    for dt, weight in zip(moments.times_s, moments.weights, strict=True):
        craft = renderer.render(at(dt), target, layer="craft") if crafts else first.read()
        _add_times(stage_ms, craft.stage_ms)
        crafts.append((craft, np.float32(weight)))
    _put_before(mean, crafts)
    return Exposed(mean, stage_ms, n_drawings + len(moments))


def _put_before(ground: Float32Array, crafts: list[tuple[Rendered, np.float32]]) -> None:
    """Put the weighted mean of crafts before a ground (H, W[, bands]), in place."""
    kept = [(c, weight) for c, weight in crafts if c.radiance.size]
    if not kept:
        return
    rows, columns = (
        slice(min(c.window[k].start for c, _ in kept), max(c.window[k].stop for c, _ in kept)) for k in (0, 1)
    )
    behind = ground[rows, columns]
    light, open_ = np.zeros_like(behind), np.ones(behind.shape[:2], np.float32)
    for craft, weight in kept:
        y, x = (
            slice(own.start - whole.start, own.stop - whole.start)
            for own, whole in zip(craft.window, (rows, columns), strict=True)
        )
        if craft.coverage is None:
            continue
        light[y, x] += craft.radiance * weight
        open_[y, x] -= craft.coverage * weight
    # weights that add up to one but for their rounding
    np.maximum(open_, 0, out=open_)
    behind *= open_ if behind.ndim == 2 else open_[..., None]
    behind += light


def _ways_px(mid: SceneState, early: SceneState, late: SceneState, pixels: FloatArray) -> FloatArray:
    """(K, 2) ways from ``early`` to ``late`` of what is behind (K, 2) pixels of ``mid`` [px]."""
    return np.asarray(_behind_px(mid, late, pixels) - _behind_px(mid, early, pixels))


def _add_times(total_ms: dict[str, float], more_ms: dict[str, float]) -> None:
    """Add one drawing's ledger to another's."""
    for name, ms in more_ms.items():
        total_ms[name] = total_ms.get(name, 0.0) + ms


def begin_surfaces(
    renderer: Renderer, scene: SceneState, target: Target, *, layers: bool
) -> Callable[[], Surfaces]:
    """`surfaces`, which the driver draws while other things are done; the result, called once, waits for it."""
    if len(row_bands(scene, target)) > 1:
        return partial(surfaces, renderer, scene, target, layers=layers)
    return renderer.begin_surfaces(scene, target, layers=layers)


def surfaces(
    renderer: Renderer, scene: SceneState, target: Target, *, layers: bool, margin_px: int = 0
) -> Surfaces:
    """What lies at each pixel's centre at mid-exposure, each row at its own; ``margin_px`` pixels beyond the edges."""
    height, m = scene.camera.height_px, margin_px
    bands = row_bands(scene, target)
    found: Surfaces | None = None
    for k in reversed(range(len(bands))):
        band = bands[k]
        # rows beyond the image are exposed with its edge
        top, bottom = band.y0 - (m if k == 0 else 0), band.y1 + (m if k == len(bands) - 1 else 0)
        camera = crop(scene.camera, -m, top, scene.camera.width_px + 2 * m, bottom - top)
        seen = renderer.surfaces(replace(scene_at(scene, band.dt_s), camera=camera), target, layers=layers)
        if len(bands) == 1:
            return seen
        if found is None:
            found = _empty_like(seen, height + 2 * m)
        rows = slice(top + m, bottom + m)
        found.depth_m[rows] = seen.depth_m
        for ours, theirs in ((found.normals, seen.normals), (found.parts, seen.parts)):
            if ours is not None and theirs is not None:
                ours[rows] = theirs
    if found is None:
        raise RuntimeError("an image without rows has no labels")
    return found


def _empty_like(seen: Surfaces, height: int) -> Surfaces:
    return replace(
        seen,
        depth_m=np.full((height, seen.depth_m.shape[1]), np.nan, np.float32),
        normals=None if seen.normals is None else np.zeros((height, *seen.normals.shape[1:]), np.float16),
        parts=None if seen.parts is None else np.zeros((height, seen.parts.shape[1]), np.uint16),
        window=(slice(None), slice(None)),
    )


def pose_at_rows(scene: SceneState, points_target_m: FloatArray) -> tuple[SceneState, ...]:
    """The scene at the mid-exposure of the row that each point is seen in; the picture's own for a global shutter.

    Parameters
    ----------
    points_target_m : (K, 3), target frame [m].
    """
    if not scene.shutter.is_rolling:
        return (scene,) * len(points_target_m)
    scenes = []
    for point in points_target_m:
        then = scene
        for _ in range(8):  # each step leaves the share of the readout that the point moves, squared
            row = then.camera.project(then.camera_from_target.apply(point[None]))[0, 1]
            if not np.isfinite(row):
                then = scene
                break
            then = scene_at(scene, float(scene.shutter.row_time_s(row, scene.camera.height_px)))
        scenes.append(then)
    return tuple(scenes)
