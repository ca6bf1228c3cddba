"""Colour of the light that a spacecraft's parts give each other: the mean of the surfaces that other parts see."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.render.occlusion import LARGEST_SLOPE

if TYPE_CHECKING:
    from simulator.arrays import ByteArray, FloatArray
    from simulator.targets.model import Target

# points of a triangle, barycentric
_POINTS = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]], float)


def bounce_color(target: Target, grid: ByteArray, corner_m: FloatArray, extent_m: FloatArray) -> FloatArray:
    """(3,) reflectance, linear RGB, of the surfaces that hide the sky from others.

    Form factors are reciprocal: of all light between parts, the share that falls on a surface is its area times the
    part of the sky that is hidden from it. Surfaces inside a body, which see nothing, have no say.

    Parameters
    ----------
    grid : (N, N, N, 4) visibility of the sky, z first, of `occlusion.baked_occlusion`.
    corner_m, extent_m : (3,) of the grid's box, target frame.
    """
    colors = {material.name: np.asarray(material.base_color) for material in target.materials}
    count = grid.shape[0]
    step_m = extent_m / count
    total, weight = np.zeros(3), 0.0
    for part in target.parts:
        corners = part.positions_m.astype(float)[np.asarray(part.triangles)]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(across, axis=1)
        normal = across / np.maximum(size, 1e-30)[:, None]
        for point in _POINTS / _POINTS.sum(axis=1, keepdims=True):
            # a step off the face, as in shaders/target/lighting.glsl
            place = np.einsum("k,fkc->fc", point, corners) + normal * step_m
            x, y, z = np.clip(((place - corner_m) / step_m).astype(int), 0, count - 1).T
            seen = grid[z, y, x].astype(float) / 255
            slope = (seen[:, :3] - 0.5) * (2 * LARGEST_SLOPE)
            # the mean of V over the cosine-weighted hemisphere
            open_share = np.clip(seen[:, 3] + 2 / 3 * np.einsum("fc,fc->f", slope, normal), 0, 1)
            hidden = float((size * open_share * (1 - open_share)).sum())
            total += hidden * colors[part.material]
            weight += hidden
    return np.asarray(total / max(weight, 1e-30))
