"""A smooth ball in sunlight as rendered, with everything needed to integrate its radiance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.world.constants import AU_M, SUN_RADIUS_M
from tools.validation.bare_scene import ball, bare_scene, bare_target, square_camera

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.scene.state import Quality
    from flyaround.simulator.targets.model import Material

_RADIUS_M, _RANGE_M = 0.5, 5.0  # radius and distance of the ball
# cosines; nearer to the terminator and the limb, facets and shadow texels dominate
_LIT, _FACING = 0.06, 0.15


@dataclass(frozen=True, eq=False)
class LitBall:
    """Pixels of the ball's sunlit face.

    Parameters
    ----------
    normals : (K, 3) array
        Outward unit normals, camera frame.
    views : (K, 3) array
        Unit vectors towards the camera, camera frame.
    sun : (D, 3) array
        Unit vectors to points of the Sun's disc of equal weight, camera frame.
    irradiance_w_m2 : float
        Solar irradiance on a surface perpendicular to the sunlight.
    radiance : Float32Array
        (K,) rendered radiance [W m-2 sr-1].
    """

    normals: FloatArray
    views: FloatArray
    sun: FloatArray
    irradiance_w_m2: float
    radiance: Float32Array


def draw_lit_ball(
    renderer: Renderer, material: Material, size_px: int, points_of_sun: int, *, quality: Quality = "default"
) -> LitBall:
    """Return a rendered ball of one material in an image of ``size_px`` squared."""
    target, camera = bare_target([ball(_RADIUS_M)], [material]), square_camera(size_px, 3.75 * size_px)
    scene = bare_scene(target, camera, (0, 0, _RANGE_M), sun_camera=(0.5, -0.3, -0.8), quality=quality)
    rendered = renderer.render(scene, target, labels=True)
    y, x = np.nonzero(np.asarray(rendered.coverage) > 0.999)
    rays = np.stack(
        [(x - camera.cx_px) / camera.fx_px, (y - camera.cy_px) / camera.fy_px, np.ones(len(x))], axis=1
    )
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    along = rays[:, 2] * _RANGE_M
    hit = rays * (along - np.sqrt(np.clip(_RADIUS_M**2 - (_RANGE_M**2 - along**2), 0, None)))[:, None]
    n = (hit - (0, 0, _RANGE_M)) / _RADIUS_M
    towards = np.asarray(scene.sun_direction_camera)
    side = np.cross(towards, [0, 1.0, 0])
    side /= np.linalg.norm(side)
    cap = spherical_fibonacci(points_of_sun, float(np.cos(SUN_RADIUS_M / AU_M)))
    chosen = (n @ towards > _LIT) & (-(n * rays).sum(axis=1) > _FACING)
    return LitBall(
        normals=n[chosen],
        views=-rays[chosen],
        sun=cap @ np.stack([side, np.cross(towards, side), towards]),
        irradiance_w_m2=float(sun_irradiance_w_m2("mono", float(np.linalg.norm(scene.r_sun_eci_m)))[0]),
        radiance=rendered.radiance[y, x][chosen],
    )
