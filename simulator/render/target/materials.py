"""What the shading is told of a craft's materials."""

from __future__ import annotations

from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from simulator.scene.illumination.bands import reflectance

if TYPE_CHECKING:
    from collections.abc import Mapping

    from simulator.runtime.arrays import FloatArray
    from simulator.scene.illumination.bands import Bands
    from simulator.targets.model import Material


@lru_cache(maxsize=16)
def material_values(materials: tuple[Material, ...], bands: Bands) -> Mapping[str, FloatArray]:
    """Members of the block ``Materials``; the same object again for the same materials, which need no second upload."""
    color, surface, grain = np.zeros((256, 4)), np.zeros((256, 4)), np.zeros((256, 4))
    for k, material in enumerate(materials, start=1):
        albedo = reflectance(bands, np.asarray(material.base_color))
        color[k, : len(albedo)] = albedo
        color[k, 3] = material.metallic
        surface[k] = [
            max(material.roughness, 0.03),  # below this a highlight is narrower than the Sun's own disc
            material.clearcoat,
            max(material.clearcoat_roughness, 0.03),
            material.crinkle,
        ]
        if material.anisotropy > 0:
            strength = material.anisotropy * (-1 if material.turned else 1)
            grain[k] = [*(np.asarray(material.grain) / np.linalg.norm(material.grain)), strength]
    return MappingProxyType(
        {"u_material_color": color, "u_material_surface": surface, "u_material_grain": grain}
    )
