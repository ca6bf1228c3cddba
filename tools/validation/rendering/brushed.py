"""Rows of the rendering page on brushed metal: its lobe against an integral, and a white furnace."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.scene.illumination.bands import sun_irradiance_w_m2
from flyaround.simulator.targets.model import Material
from tools.validation.bare_scene import bare_scene, bare_target, flat_plate, square_camera
from tools.validation.rendering.lit_ball import draw_lit_ball
from tools.validation.rows import Row

if TYPE_CHECKING:
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import FloatArray

BRUSHED = Material(
    name="m", base_color=(0.9,) * 3, metallic=1.0, roughness=0.35, anisotropy=0.7, grain=(0.2, 1.0, 0.1)
)
_SAMPLES = 1500  # number of half vectors of the integral


def rows(renderer: Renderer) -> list[Row]:
    """Return both comparisons."""
    return [sphere_row(renderer), furnace_row(renderer)]


def sphere_row(renderer: Renderer) -> Row:
    """Return the maximum error over a brushed sphere's lit face relative to its maximum, the Sun's disc integrated."""
    # enough pixels that the radiance at a pixel's centre equals the mean over its area
    drawn = draw_lit_ball(renderer, BRUSHED, 160, 40, quality="high")
    n = drawn.normals
    transverse = np.cross(n, np.asarray(BRUSHED.grain))
    transverse /= np.linalg.norm(transverse, axis=1, keepdims=True)
    frame = np.stack([transverse, np.cross(n, transverse), n], axis=1)  # (K, 3, 3) to the axes of the face
    view = np.einsum("kij,kj->ki", frame, drawn.views)
    f0 = BRUSHED.base_color[0]
    again = 1 + f0 * (1 / _single_albedo(view) - 1)
    exact = np.mean([_once(view, np.einsum("kij,j->ki", frame, d), f0) for d in drawn.sun], axis=0) * again
    exact *= drawn.irradiance_w_m2
    error = np.abs(drawn.radiance - exact).max() / exact.max()
    return Row(
        what="Radiance of a brushed metal sphere under the Sun's disc",
        against="numeric integration",
        unit="1",
        goal=0.03,  # fine sampling resolves the lobe, and a fit conserves the light between microfacets
        measured=float(error),
    )


def furnace_row(renderer: Renderer) -> Row:
    """Return the maximum deviation from one of the light reflected by a white brushed plate, integrated over the Sun.

    By reciprocity, the radiance in one direction, integrated over all directions of the Sun, equals the total
    reflection of a beam from that direction.
    """
    white = Material(
        name="m", base_color=(1.0,) * 3, metallic=1.0, roughness=0.45, anisotropy=0.6, grain=(1.0, 0.3, 0)
    )
    target, camera = bare_target([flat_plate("p", (-1, 1), (-1, 1), 0.0)], [white]), square_camera(5, 2000.0)
    worst, count = 0.0, 300
    for rotvec in ((0.0, 0.0, 0.0), (0.7, 0.0, 0.0), (0.0, 0.7, 0.0)):
        bare = bare_scene(target, camera, (0, 0, 5.0), rotvec)
        total, R = 0.0, bare.camera_from_target.R
        for sun in spherical_fibonacci(count, 0.0) * (1, 1, -1):
            scene = bare_scene(target, camera, (0, 0, 5.0), rotvec, sun_camera=R @ sun)
            total += float(renderer.render(scene, target).radiance[2, 2])
        light = sun_irradiance_w_m2("mono", float(np.linalg.norm(scene.r_sun_eci_m)))[0]
        worst = max(worst, abs(total * 2 * np.pi / count / light - 1))
    return Row(
        what="Sunlight that white brushed metal returns, all directions together, less all of it",
        against="energy",
        unit="1",
        goal=0.03,
        measured=float(worst),
    )


def _widths() -> tuple[float, float]:
    """Return alpha across and along the grain: KHR_materials_anisotropy."""
    alpha = BRUSHED.roughness**2
    return alpha + (1 - alpha) * BRUSHED.anisotropy**2, alpha


def _once(v: FloatArray, light: FloatArray, f0: float) -> FloatArray:
    """Return the (K,) radiance of the single bounce over irradiance; directions in the axes of the face (across,
    along, normal).
    """
    a, b = _widths()
    h = v + light
    h = h / np.linalg.norm(h, axis=1, keepdims=True)
    d = 1 / (np.pi * a * b * ((h[:, 0] / a) ** 2 + (h[:, 1] / b) ** 2 + h[:, 2] ** 2) ** 2)
    fresnel = f0 + (1 - f0) * (1 - (v * h).sum(axis=1)) ** 5
    masked = d * _masking(v, light) / (4 * np.clip(v[:, 2] * light[:, 2], 1e-9, None))
    return np.asarray(fresnel * masked * np.clip(light[:, 2], 0, None))


def _masking(v: FloatArray, light: FloatArray) -> FloatArray:
    """Return the (...,) height-correlated masking and shadowing, Heitz (2014), eqs. 72, 99."""
    a, b = _widths()
    lam = [
        0.5
        * (
            np.sqrt(1 + ((a * w[..., 0]) ** 2 + (b * w[..., 1]) ** 2) / np.clip(w[..., 2], 1e-6, None) ** 2)
            - 1
        )
        for w in (v, light)
    ]
    return np.asarray(1 / (1 + lam[0] + lam[1]))


def _single_albedo(v: FloatArray) -> FloatArray:
    """Return the (K,) share of uniform light that a white brushed mirror reflects once, by sampling normals."""
    a, b = _widths()
    i = np.arange(_SAMPLES) + 0.5
    u, turn = i / _SAMPLES, 2 * np.pi * ((i * 0.6180339887498949) % 1)
    r = np.sqrt(u / (1 - u))
    h = np.stack([a * r * np.cos(turn), b * r * np.sin(turn), np.ones(_SAMPLES)], axis=1)
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    out = []
    for part in np.array_split(v, max(1, len(v) // 200)):
        v_h = part @ h.T
        light = 2 * v_h[..., None] * h - part[:, None]
        good = (v_h > 0) & (light[..., 2] > 0)
        weight = _masking(np.broadcast_to(part[:, None], light.shape), light) * v_h / (part[:, 2:3] * h[:, 2])
        out.append(np.where(good, weight, 0).mean(axis=1))
    return np.concatenate(out)
