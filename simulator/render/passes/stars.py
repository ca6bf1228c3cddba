"""Star pass: stars and planets, points of known irradiance, over the four nearest pixels. Adds to the radiance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.render.catalogue import HP_MINUS_V, star_irradiance_w_m2, stars
from simulator.scene.atmosphere import optical_depth_to_top
from simulator.scene.planets import earth_velocity_c, planets
from simulator.world.constants import LIGHT_M_S

if TYPE_CHECKING:
    import moderngl

    from simulator.arrays import FloatArray
    from simulator.render.earthview import EarthView
    from simulator.render.images import Images
    from simulator.render.moonview import MoonView
    from simulator.render.programs import Program, ProgramLibrary
    from simulator.render.view import View
    from simulator.scene.atmosphere import Atmosphere
    from simulator.scene.state import SceneState

_MAX_STARS = 80_000
_SLACK = 1e-3  # of a cosine: aberration changes lengths by a ten-thousandth


class StarPass:
    """Positions and light are worked out in float64 on the CPU; the GPU spreads and adds them."""

    def __init__(self, context: moderngl.Context, programs: ProgramLibrary) -> None:
        self._context, self._programs = context, programs
        self._points = context.buffer(reserve=_MAX_STARS * 5 * 4, dynamic=True)
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def run(
        self,
        scene: SceneState,
        view: View,
        images: Images,
        earth: EarthView | None,
        air: Atmosphere | None,
        moon: MoonView | None,
    ) -> None:
        """Add the stars in view.

        Parameters
        ----------
        earth : what hides them, ``None`` without Earth. air : what dims them near its limb.
        moon : what also hides them.
        """
        pixels, radiance = stars_in_view(scene, view, earth, air, moon)
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
        images.sky_framebuffer.use()
        images.sky_framebuffer.viewport = (0, 0, *images.size)
        self._context.enable_only(self._context.BLEND | self._context.PROGRAM_POINT_SIZE)
        self._context.blend_func = self._context.ONE, self._context.ONE
        program.bind_textures(t_coverage=images.coverage)
        self._arrays[program].render(mode=self._context.POINTS, vertices=len(points))


def stars_in_view(
    scene: SceneState,
    view: View,
    earth: EarthView | None,
    air: Atmosphere | None,
    moon: MoonView | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Pixel positions (K, 2) and radiance (K, n) that one whole pixel would have [W m-2 sr-1]."""
    camera, environment = scene.camera, scene.environment
    directions, light = [], []
    if environment.stars:
        field = stars(scene.epoch_utc, scene.bands)
        near, irradiance = field.near(view.R_camera_from_eci[2], camera.half_angle_rad())
        directions.append(near)
        light.append(irradiance)
    if environment.planets:
        points = planets(scene.epoch_utc, np.asarray(scene.r_camera_eci_m))
        directions.append(points.directions)
        light.append(star_irradiance_w_m2(points.v_mag + HP_MINUS_V, points.b_minus_v, scene.bands))
    # aberration by the motion of the Earth and of the camera about it
    beta = earth_velocity_c(scene.epoch_utc) + np.asarray(scene.v_camera_eci_m_s) / LIGHT_M_S
    R = view.R_camera_from_eci
    # what is added to a unit vector shifts its direction; its length is mended where it matters
    d, irradiance = np.concatenate(directions) @ R.T + R @ beta, np.concatenate(light)
    inside = d[:, 2] > np.cos(camera.half_angle_rad()) - _SLACK
    d, irradiance = d[inside], irradiance[inside]
    pixels = camera.project(d)
    keep = camera.contains(pixels)
    d, irradiance, pixels = d[keep], irradiance[keep], pixels[keep]
    d /= _length(d)
    if moon is not None:
        seen = ~moon.hides(d)
        d, irradiance, pixels = d[seen], irradiance[seen], pixels[seen]
    if earth is not None:
        visible, share = _past_the_earth(d, earth, air)
        d, pixels, irradiance = d[visible], pixels[visible], (irradiance * share)[visible]
    return pixels, irradiance / camera.pixel_solid_angle_sr(pixels)[:, None]


def _past_the_earth(
    d_camera: FloatArray, earth: EarthView, air: Atmosphere | None
) -> tuple[np.typing.NDArray[np.bool_], FloatArray]:
    """Which directions miss the ground, and what the air on the way leaves of their light."""
    d = d_camera @ earth.earth_from_camera.T
    d /= _length(d)
    along = d @ earth.camera
    perigee2 = float(earth.camera @ earth.camera) - along**2
    visible = (along >= 0) | (perigee2 >= 1)
    through = visible & (along < 0) & (perigee2 < earth.top2)
    if air is None or not through.any():
        return visible, np.ones((len(d), 1))
    depth = np.zeros((len(d), len(air.rayleigh_m)))
    radius = np.sqrt(perigee2[through]) * air.radius_m
    depth[through] = 2 * optical_depth_to_top(air, radius, np.zeros_like(radius), steps=32)
    return visible, np.exp(-depth)


def _length(vectors: FloatArray) -> FloatArray:
    """(K, 1) of vectors (K, 3)."""
    return np.asarray(np.sqrt(np.einsum("kc,kc->k", vectors, vectors))[:, None])
