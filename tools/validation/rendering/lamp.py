"""Row of the rendering page on the chaser's lamp: the light of every beam on a matt plate."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, get_args

import numpy as np

from flyaround.simulator.scene.illumination.lamp import Lamp, Profile
from flyaround.simulator.targets.model import Material
from tools.validation.bare_scene import bare_scene, bare_target, flat_plate, square_camera
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer


def rows(renderer: Renderer) -> list[Row]:
    """Return the maximum relative error of irradiance on a slanted Lambert plate, over beams and an offset lamp."""
    # a metal is black without its specular part: the diffuse part is a rough plate's light minus its gloss
    matt = Material(name="m", base_color=(0.5, 0.5, 0.5), roughness=1.0)
    black = replace(matt, base_color=(0.0, 0.0, 0.0))
    plate = flat_plate("plate", (-1.5, 1.5), (-1.5, 1.5), 0.0)
    camera, worst = square_camera(96, 240.0), 0.0
    for profile in get_args(Profile):
        lamp = Lamp(power_w=5.0, half_angle_deg=8.0, profile=profile, offset_m=(0.4, -0.2, 0.1))
        images = []
        for material in (matt, black):
            target = bare_target([plate], [material])
            scene = bare_scene(target, camera, (0, 0, 4.0), (0.3, 0.4, 0.0), sunlit=False)
            images.append(np.asarray(renderer.render(replace(scene, lamp=lamp), target).radiance, float))
        n = scene.camera_from_target.R @ np.array([0, 0, -1.0])
        y, x = np.mgrid[: camera.height_px, : camera.width_px]
        rays = np.stack(
            [(x - camera.cx_px) / camera.fx_px, (y - camera.cy_px) / camera.fy_px, np.ones_like(x)], axis=-1
        )
        places = rays * (n[2] * 4.0 / (rays @ n))[..., None]
        normals = np.broadcast_to(n, places.shape)
        exact = lamp.irradiance_w_m2(places.reshape(-1, 3), normals.reshape(-1, 3), "mono").reshape(x.shape)
        # both plates have the same gloss, so the difference is the diffuse part minus the Fresnel reflection
        half = (places / -np.linalg.norm(places, axis=-1, keepdims=True)) + _unit(
            np.asarray(lamp.offset_m) - places
        )
        v_h = (_unit(half) * _unit(-places)).sum(axis=-1)
        fresnel = 0.04 + 0.96 * (1 - v_h) ** 5
        falling = (images[0] - images[1]) * np.pi / (0.5 * (1 - fresnel))
        worst = max(worst, float(np.abs(falling - exact).max() / exact.max()))
    return [
        Row(
            what="Irradiance of the chaser's lamp on a slanted plate, every beam",
            against="inverse square, cosine and beam",
            unit="1",
            goal=0.01,
            measured=worst,
        )
    ]


def _unit(v: np.ndarray) -> np.ndarray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
