"""Light of the drawn Earth on the target, by the Earth's own shaders at a few hundred directions around the nadir."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.directions import orthonormal_basis, spherical_fibonacci
from flyaround.simulator.render.earth.earth_pass import season_of
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

GROUND_RAYS, LIMB_RAYS = 640, 48  # rays to the ground, and to the air above the limb
LIMB_KM = 60.0  # height up to which the air's light matters to a craft
STEPS = 12  # steps of a ray through the air
CROWD, SUNWARD = 0.8, 0.75
"""Ray density: exponents of the stretch towards the rim of a wide disc, and towards the Sun's azimuth."""
# footprint of a sample over its share of the disc; a larger one would average clouds too much
FOOTPRINT = 0.15
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
"""Tiles with every kind of ground but bright water, which is too small to light a craft."""


class ShineSampler:
    """Samples the drawn Earth from the camera's position, at once: other drawing does not delay it."""

    def __init__(self, device: Device) -> None:
        self._context, self._programs = device.context, device.programs
        context = device.context
        self._in = context.buffer(reserve=(GROUND_RAYS + LIMB_RAYS) * 16, dynamic=True)
        self._out = context.buffer(reserve=(GROUND_RAYS + LIMB_RAYS) * 12, dynamic=True)
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}
        # nothing is drawn, but OpenGL requires a complete framebuffer
        self._target = context.simple_framebuffer((1, 1))

    def field(
        self, scene: SceneState, view: View, globe: GlobeView, earth: Earth, additional_w_m2: FloatArray
    ) -> IrradianceField:
        """Return the field of the Earth's light plus other light, as in `field_of_samples`."""
        rays, share_sr, rim = _rays(globe, view.globe.radius_m)
        program = self._program(scene, earth)
        array = self._arrays.get(program.gl)
        if array is None:
            array = self._arrays[program.gl] = self._context.vertex_array(
                program.gl, [(self._in, "4f", "in_ray")], mode=self._context.POINTS
            )
        earth.air(scene.environment).frame.make_complete()
        self._in.write(rays.astype(np.float32).tobytes())
        draw_to(self._target)
        array.transform(self._out, vertices=len(rays))
        light = np.frombuffer(self._out.read(len(rays) * earth.bands * 4), np.float32)
        # back from the stretched space, where angles differ
        stretch = np.array([1.0, 1.0, view.globe.polar_radius_m / view.globe.radius_m])
        directions = rays[:, :3] * stretch
        length = np.sqrt(np.einsum("kc,kc->k", directions, directions))
        directions /= length[:, None]
        zenith = view.r_camera_globe_m / np.linalg.norm(view.r_camera_globe_m)
        return field_of_samples(
            directions @ view.R_camera_from_globe.T,
            light.reshape(len(rays), -1).astype(float),
            share_sr * stretch[2] / length**3,
            rim,
            -view.R_camera_from_globe @ zenith,
            additional_w_m2,
            disc=GROUND_RAYS,
        )

    def _program(self, scene: SceneState, earth: Earth) -> Program:
        """Return the program for a scene, with its textures bound."""
        context, month = self._context, season_of(scene)
        textures = earth.ground_textures(month) | earth.air(scene.environment).frame.static_tables
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
        program.set("u_season", month.share)
        return program

    def release(self) -> None:
        """Free the buffers."""
        for array in self._arrays.values():
            array.release()
        self._in.release()
        self._out.release()
        release(self._context, self._target)


def _rays(globe: GlobeView, radius_m: float) -> tuple[FloatArray, FloatArray, float]:
    """Return rays (K, 4) for the shader, their solid angles (K,) in its space, and the cosine of the ground's rim."""
    above = float(np.linalg.norm(globe.camera))
    rim = float(np.sqrt(1 - 1 / above**2))
    top = float(np.sqrt(max(1 - ((1 + LIMB_KM * 1e3 / radius_m) / above) ** 2, 0.0)))
    parts = []
    for count, low, high, crowd in (
        (GROUND_RAYS, rim, 1.0, 1.0 + CROWD * (1.0 - rim)),
        (LIMB_RAYS, top, rim, 1.0),
    ):
        even = spherical_fibonacci(count)
        share, turn = 0.5 + 0.5 * even[:, 2], np.arctan2(even[:, 1], even[:, 0])
        cosine, azimuth = low + (high - low) * share**crowd, turn - SUNWARD * np.sin(turn)
        sine = np.sqrt(1 - cosine**2)
        each = 2 * np.pi * (high - low) / count * crowd * share ** (crowd - 1) * (1 - SUNWARD * np.cos(turn))
        parts.append((np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], axis=1), each))
    directions, share_sr = (np.concatenate(part) for part in zip(*parts, strict=True))
    zenith = globe.camera / above
    sunward = globe.sun - (globe.sun @ zenith) * zenith
    x = sunward / np.linalg.norm(sunward) if sunward @ sunward > 1e-6 else orthonormal_basis(zenith)[0]
    axes = np.stack([x, np.cross(zenith, x), -zenith])
    return np.column_stack([directions @ axes, FOOTPRINT * np.sqrt(share_sr)]), share_sr, rim
