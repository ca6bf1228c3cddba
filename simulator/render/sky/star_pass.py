"""Star pass: adds stars and planets as points, each distributed over its four nearest pixels.

Only points that the target may hide are drawn. The others are added after the read-back, because a software driver
takes a microsecond to draw a point, and adding it to four pixels takes a twentieth of that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.celestial.star_catalogue import stars
from flyaround.simulator.celestial.star_colours import (
    irradiance_of_v_mag,
    photons_over_sunlights,
    typical_v_minus_i,
)
from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.frame_graph import Pass
from flyaround.simulator.render.frame_images import IMAGES, RADIANCE, STARLIGHT, PointLights
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.globe.frame_air import AIR
from flyaround.simulator.render.globe.globe_view import GLOBE
from flyaround.simulator.render.moon.moon_view import MOON
from flyaround.simulator.render.projection import PixelRect
from flyaround.simulator.render.view import SCENE, VIEW
from flyaround.simulator.scene.illumination.atmosphere import optical_depth_to_top
from flyaround.simulator.scene.illumination.planets import earth_velocity_c, planets
from flyaround.simulator.world.constants import LIGHT_M_S

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.render.craft.placement import PlacedTarget
    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.frame_graph import PassResources
    from flyaround.simulator.render.frame_images import FrameImages
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.render.globe.globe_view import GlobeView
    from flyaround.simulator.render.moon.moon_view import MoonView
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray
    from flyaround.simulator.scene.illumination.atmosphere import Atmosphere
    from flyaround.simulator.scene.state import SceneState

_MAX_STARS = 80_000  # size of the buffer: the whole catalogue (78,348 stars) and the planets
_REACH_PX = 2  # largest distance of a pixel that a point lights
_COSINE_TOLERANCE = 1e-3  # tolerance of a cosine: aberration changes lengths by 1e-4


class StarPass(Pass):
    """Adds stars and planets. Positions and light are computed in float64 on the CPU."""

    name = "stars"
    reads = (SCENE, VIEW, *IMAGES)
    optional = (GLOBE, MOON, AIR, TARGET)
    writes = (RADIANCE, STARLIGHT)

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        self._points = self._context.buffer(reserve=_MAX_STARS * 5 * 4, dynamic=True)
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def run(self, r: PassResources) -> None:
        """Draw the stars in view that the target may hide, and write the light of the others."""
        scene, images, earth = r[SCENE], r[RADIANCE], r.find(GLOBE)
        environment = scene.environment
        if (earth is not None and earth.fills_image) or not (environment.stars or environment.planets):
            return
        pixels, radiance = stars_in_view(scene, r[VIEW], earth, r.find(AIR), r.find(MOON))
        near = self.may_be_hidden(pixels, images, r.find(TARGET))
        self._draw(pixels[near], radiance[near], images)
        r[STARLIGHT] = distribute_points(pixels[~near], radiance[~near], images.size)

    def may_be_hidden(
        self, pixels: FloatArray, images: FrameImages, target: PlacedTarget | None
    ) -> BoolArray:
        """Find the points that the target may hide, and mark the pixels beside it as drawn.

        Returns
        -------
        (K,) array of bool
            True for points within a pixel of the target's rectangle; all False without a target.
        """
        if target is None:
            return np.zeros(len(pixels), bool)
        rect = target.rect
        low, high = (rect.x0 - 1, rect.y0 - 1), (rect.x1, rect.y1)
        images.mark_drawn(
            PixelRect(*(edge - _REACH_PX for edge in low), *(edge + _REACH_PX for edge in high))
        )
        return np.asarray(((pixels > low) & (pixels < high)).all(axis=1))

    def _draw(self, pixels: FloatArray, radiance: FloatArray, images: FrameImages) -> None:
        """Add points, times one minus the target's coverage of their pixels."""
        if not len(pixels):
            return
        program = self._programs.get(
            "sky/stars.vert", "sky/stars.frag", {"BANDS": images.bands}, ("t_coverage",)
        )
        if program not in self._arrays:
            self._arrays[program] = self._context.vertex_array(
                program.gl, [(self._points, "2f 3f", "in_pixel", "in_radiance")]
            )
        points = np.zeros((len(pixels), 5), np.float32)
        points[:, :2] = pixels
        points[:, 2 : 2 + radiance.shape[1]] = radiance
        self._points.write(points.tobytes())
        program.set("u_size", images.size)
        draw_to(images.sky_framebuffer)
        images.sky_framebuffer.viewport = (0, 0, *images.size)
        self._context.enable_only(self._context.BLEND | self._context.PROGRAM_POINT_SIZE)
        self._context.blend_func = self._context.ONE, self._context.ONE
        program.bind_textures(t_coverage=images.coverage)
        self._arrays[program].render(mode=self._context.POINTS, vertices=len(points))


def distribute_points(pixels: FloatArray, radiance: FloatArray, size: tuple[int, int]) -> PointLights:
    """Distribute points by a tent over their four nearest pixels, as shaders/sky/stars.frag does.

    Parameters
    ----------
    pixels : (K, 2) array
        Positions in an image of ``size``.
    radiance : (K, n) array
        Radiance if one pixel held all the light.
    size : tuple of int
        Width and height of the image [px].
    """
    width, height = size
    first = np.floor(pixels)
    fraction = (pixels - first).T
    column, row = first.T.astype(np.int64)
    indices, light = [], []
    for dx in (0, 1):
        for dy in (0, 1):
            x, y = column + dx, row + dy
            inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
            weight = (fraction[0] if dx else 1 - fraction[0]) * (fraction[1] if dy else 1 - fraction[1])
            indices.append(np.where(inside, y * width + x, 0))
            light.append(radiance * (weight * inside)[:, None])
    return PointLights(np.concatenate(indices), np.concatenate(light).astype(np.float32))


def stars_in_view(
    scene: SceneState,
    view: View,
    earth: GlobeView | None,
    air: Atmosphere | None,
    moon: MoonView | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Compute positions and radiance of the stars and planets in the image.

    Electrons are later computed for the Sun's spectrum. So for a detector that counts photons, the radiance is that of
    sunlight with the same number of photons.

    Parameters
    ----------
    scene : SceneState
        Scene to render.
    view : View
        Scene in camera coordinates.
    earth : GlobeView or None
        Globe in the image, which hides stars.
    air : Atmosphere or None
        Atmosphere of the globe, which attenuates stars near the limb.
    moon : MoonView, optional
        Moon, which hides stars.

    Returns
    -------
    pixels : (K, 2) array
        Columns and rows [px].
    radiance : (K, n) array
        Radiance per band if a single pixel held all the light [W m-2 sr-1].
    """
    camera, environment = scene.camera, scene.environment
    # arrays of (3, K), because NumPy is slower for (K, 3)
    directions, light = [], []
    by_photons = scene.sensor.detector is not None
    if environment.stars:
        star_field = stars(scene.epoch_utc, scene.bands, by_photons=by_photons)
        star_directions, irradiance = star_field.near(view.R_camera_from_eci[2], camera.half_angle_rad())
        directions.append(star_directions)
        light.append(irradiance)
    if environment.planets:
        points = planets(scene.epoch_utc, np.asarray(scene.r_camera_eci_m))
        directions.append(points.directions.T)
        bv, vi = points.b_minus_v, typical_v_minus_i(points.b_minus_v)
        irradiance = irradiance_of_v_mag(points.v_mag, bv, vi, scene.bands)
        if by_photons:
            irradiance *= photons_over_sunlights(vi, scene.bands)
        light.append(irradiance.T)
    # aberration by the motion of the Earth, and of the camera around it
    beta = earth_velocity_c(scene.epoch_utc) + np.asarray(scene.v_camera_eci_m_s) / LIGHT_M_S
    R = view.R_camera_from_eci
    # first-order aberration: the velocity is added to the unit vector, which is normalised later
    rays = R @ np.concatenate(directions, axis=1) + (R @ beta)[:, None]
    in_cone = np.flatnonzero(rays[2] > np.cos(camera.half_angle_rad()) - _COSINE_TOLERANCE)
    rays = rays.take(in_cone, axis=1)
    pixels = _project(camera, rays)
    inside = np.flatnonzero(_contains(camera, pixels))
    rays = rays.take(inside, axis=1)
    rays /= np.sqrt(np.einsum("ck,ck->k", rays, rays))
    in_front = np.ones(len(inside), bool) if moon is None else ~moon.hides(rays.T)
    share = None
    if earth is not None:
        visible, share = _visible_past_earth(rays, earth, air)
        in_front &= visible
    if not in_front.all():
        indices = np.flatnonzero(in_front)
        rays, inside, share = rays[:, indices], inside[indices], None if share is None else share[:, indices]
    radiance = np.concatenate(light, axis=1).take(in_cone.take(inside), axis=1)
    if share is not None:
        radiance *= share
    pixels = pixels.take(inside, axis=1).T
    return pixels, (radiance / _pixel_solid_angle_sr(camera, rays)).T


def _project(camera: Camera, d: FloatArray) -> FloatArray:
    """Project directions (3, K) in front of the camera to pixels (2, K)."""
    if not camera.distortion.is_none:
        return camera.project(d.T).T
    pixels = d[:2] / d[2]
    pixels *= ((camera.fx_px,), (camera.fy_px,))
    pixels += ((camera.cx_px,), (camera.cy_px,))
    return np.asarray(pixels)


def _contains(camera: Camera, pixels: FloatArray) -> BoolArray:
    """Return (K,) True for pixels (2, K) inside the image; False for NaN."""
    x, y = pixels
    ends = camera.width_px - 0.5, camera.height_px - 0.5
    return np.asarray((x >= -0.5) & (x < ends[0]) & (y >= -0.5) & (y < ends[1]))


def _pixel_solid_angle_sr(camera: Camera, d: FloatArray) -> FloatArray:
    """Return the solid angle (K,) of one pixel at unit directions (3, K) [sr]."""
    if not camera.distortion.is_none:
        return camera.ray_solid_angle_sr((d[:2] / d[2]).T)
    return np.asarray(d[2] * d[2] * d[2] / (camera.fx_px * camera.fy_px))


def _visible_past_earth(
    d_camera: FloatArray, earth: GlobeView, air: Atmosphere | None
) -> tuple[BoolArray, FloatArray | None]:
    """Return a mask (K,) of directions (3, K) that miss the ground, and the air's transmittance (n, K) or None."""
    d = earth.earth_from_camera @ d_camera
    along_zenith = earth.camera @ d / np.sqrt(np.einsum("ck,ck->k", d, d))
    perigee2 = float(earth.camera @ earth.camera) - along_zenith * along_zenith
    visible = (along_zenith >= 0) | (perigee2 >= 1)
    crosses_air = visible & (along_zenith < 0) & (perigee2 < earth.top2)
    if air is None or not crosses_air.any():
        return visible, None
    depth = np.zeros((d.shape[1], len(air.rayleigh_m)))
    radius = np.sqrt(perigee2[crosses_air]) * air.radius_m
    depth[crosses_air] = 2 * optical_depth_to_top(air, radius, np.zeros_like(radius), steps=32)
    return visible, np.exp(-depth.T)
