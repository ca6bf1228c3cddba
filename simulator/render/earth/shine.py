"""Light of the Earth on the target, sampled with the Earth's shaders along a few hundred rays around the nadir."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.directions import orthonormal_basis, spherical_fibonacci
from flyaround.simulator.render.earth.earth_pass import map_season
from flyaround.simulator.render.earth.screen_tiles import TileKind, ice_day
from flyaround.simulator.render.gl.context import release
from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.scene.illumination.irradiance import field_of_samples

if TYPE_CHECKING:
    import moderngl

    from flyaround.simulator.render.device import Device
    from flyaround.simulator.render.earth.earth_pass import Earth
    from flyaround.simulator.render.gl.programs import Program
    from flyaround.simulator.render.globe.globe_view import GlobeView
    from flyaround.simulator.render.view import View
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.illumination.irradiance import IrradianceField
    from flyaround.simulator.scene.state import SceneState

GROUND_RAYS, LIMB_RAYS = 640, 48
"""Numbers of rays to the ground, and to the air above the limb."""
LIMB_KM = 60.0
"""Height up to which the light of the air is sampled."""
STEPS = 12
"""Steps of a ray through the air."""
CROWD, SUNWARD = 0.8, 0.75
"""Concentration of the rays towards the rim of a wide disc, and towards the Sun's azimuth."""
FOOTPRINT = 0.15
"""Footprint of a sample over its share of the disc. A larger one would average clouds too much."""
_KIND = TileKind(
    air=False,
    fine=False,
    smooth=False,
    covered=False,
    night=True,
    unlit=False,
    icy=True,
    bright_water=False,
    level=0.0,
)
"""Kind of the samples: with all features except bright water, whose areas are too small to matter."""


class ShineSampler:
    """Samples the radiance of the Earth as seen from the camera, by transform feedback, without a framebuffer."""

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        context = device.context
        self._ray_buffer = context.buffer(reserve=(GROUND_RAYS + LIMB_RAYS) * 16, dynamic=True)
        self._light_buffer = context.buffer(reserve=(GROUND_RAYS + LIMB_RAYS) * 12, dynamic=True)
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        # nothing is drawn, but OpenGL requires a complete framebuffer
        self._target = context.simple_framebuffer((1, 1))

    def field(
        self, scene: SceneState, view: View, globe: GlobeView, earth: Earth, additional_w_m2: FloatArray
    ) -> IrradianceField:
        """Return the irradiance on the target by the Earth and additional light; see `field_of_samples`.

        Parameters
        ----------
        scene : SceneState
            Scene to render.
        view : View
            Scene in camera coordinates.
        globe : GlobeView
            Earth in the image.
        earth : Earth
            Maps, air and programs.
        additional_w_m2 : array
            Irradiance by other bodies, as in `field_of_samples`.
        """
        rays, share_sr, rim = _rays(globe, view.globe.radius_m)
        program = self._program(scene, earth)
        array = self._arrays.get(program.gl)
        if array is None:
            array = self._arrays[program.gl] = self._context.vertex_array(
                program.gl, [(self._ray_buffer, "4f", "in_ray")], mode=self._context.POINTS
            )
        earth.air(scene.environment).frame.make_complete()
        self._ray_buffer.write(rays.astype(np.float32).tobytes())
        draw_to(self._target)
        array.transform(self._light_buffer, vertices=len(rays))
        radiance = np.frombuffer(self._light_buffer.read(len(rays) * earth.bands * 4), np.float32)
        # directions and solid angles in the space that is not stretched
        stretch = np.array([1.0, 1.0, view.globe.polar_radius_m / view.globe.radius_m])
        directions = rays[:, :3] * stretch
        lengths = np.sqrt(np.einsum("kc,kc->k", directions, directions))
        directions /= lengths[:, None]
        zenith = view.r_camera_globe_m / np.linalg.norm(view.r_camera_globe_m)
        return field_of_samples(
            directions @ view.R_camera_from_globe.T,
            radiance.reshape(len(rays), -1).astype(float),
            share_sr * stretch[2] / lengths**3,
            rim,
            -view.R_camera_from_globe @ zenith,
            additional_w_m2,
            disc=GROUND_RAYS,
        )

    def _program(self, scene: SceneState, earth: Earth) -> Program:
        """Return the program for a scene, with its textures bound."""
        context, season = self._context, map_season(scene)
        textures = earth.ground_textures(season) | earth.air(scene.environment).frame.static_tables
        textures["t_ice"] = earth.ice_texture(ice_day(scene))
        for name, tiling in (("t_detail", earth.detail), ("t_city", earth.night)):
            textures[name] = tiling.mipmapped(context.LINEAR_MIPMAP_NEAREST)
        for name in ("t_map", "t_colour"):
            if name in textures:
                textures[name].filter = context.LINEAR_MIPMAP_LINEAR, context.LINEAR
        defines = earth.defines(scene.environment, _KIND, behind=False, high=False, quads=False, dark=True)
        program = self._programs.get(
            "earth/shine.vert", None, defines | {"STEPS": STEPS}, tuple(textures), varyings=("v_light",)
        )
        program.bind_textures(**textures)
        program.set("u_season", season.share)
        return program

    def release(self) -> None:
        """Free the buffers."""
        for array in self._arrays.values():
            array.release()
        self._ray_buffer.release()
        self._light_buffer.release()
        release(self._context, self._target)


def _rays(globe: GlobeView, radius_m: float) -> tuple[FloatArray, FloatArray, float]:
    """Return rays (K, 4) (direction, footprint), their solid angles (K,) and the cosine of the ground's angular radius.

    All are in the stretched space of `GlobeView`.
    """
    camera_radius = float(np.linalg.norm(globe.camera))
    rim = float(np.sqrt(1 - 1 / camera_radius**2))
    limb_top = float(np.sqrt(max(1 - ((1 + LIMB_KM * 1e3 / radius_m) / camera_radius) ** 2, 0.0)))
    blocks = []
    for count, low, high, exponent in (
        (GROUND_RAYS, rim, 1.0, 1.0 + CROWD * (1.0 - rim)),
        (LIMB_RAYS, limb_top, rim, 1.0),
    ):
        uniform = spherical_fibonacci(count)
        fraction, angle = 0.5 + 0.5 * uniform[:, 2], np.arctan2(uniform[:, 1], uniform[:, 0])
        cosine, azimuth = low + (high - low) * fraction**exponent, angle - SUNWARD * np.sin(angle)
        sine = np.sqrt(1 - cosine**2)
        solid_angle = (
            2
            * np.pi
            * (high - low)
            / count
            * exponent
            * fraction ** (exponent - 1)
            * (1 - SUNWARD * np.cos(angle))
        )
        blocks.append(
            (np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1), solid_angle)
        )
    directions, share_sr = (np.concatenate(part) for part in zip(*blocks, strict=True))
    zenith = globe.camera / camera_radius
    sunward = globe.sun - (globe.sun @ zenith) * zenith
    x = sunward / np.linalg.norm(sunward) if sunward @ sunward > 1e-6 else orthonormal_basis(zenith)[0]
    axes = np.stack([x, np.cross(zenith, x), -zenith])
    return np.column_stack([directions @ axes, FOOTPRINT * np.sqrt(share_sr)]), share_sr, rim
