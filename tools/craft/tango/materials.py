"""Tango's surfaces: paint, bare and anodised metal, cover glass, optics, insulation.

White and black are typical of spacecraft thermal coatings (white paints absorb 0.17 to 0.28 of
sunlight, black ones 0.96: Gilmore, Spacecraft Thermal Control Handbook), cells of silicon under cover glass.
"""

from __future__ import annotations

from flyaround.simulator.targets.model import Material

MATERIALS = (
    Material(name="white-paint", base_color=(0.75, 0.75, 0.74), roughness=0.6),
    Material(name="plate-edge", base_color=(0.38, 0.38, 0.38), roughness=0.55),
    Material(name="body-grey", base_color=(0.17, 0.17, 0.17), roughness=0.6),
    Material(name="body-dark", base_color=(0.10, 0.10, 0.103), roughness=0.6),
    Material(name="panel-frame", base_color=(0.26, 0.26, 0.265), roughness=0.5),
    Material(name="panel-substrate", base_color=(0.10, 0.10, 0.105), roughness=0.6),
    Material(
        name="solar-cell",
        base_color=(0.010, 0.011, 0.018),
        roughness=0.45,
        clearcoat=1.0,
        clearcoat_roughness=0.04,
    ),
    Material(name="interconnect", base_color=(0.62, 0.61, 0.59), metallic=0.4, roughness=0.4),
    Material(name="antenna-grey", base_color=(0.33, 0.33, 0.33), roughness=0.55),
    Material(name="aluminium", base_color=(0.17, 0.17, 0.175), metallic=0.4, roughness=0.5),
    Material(name="instrument-black", base_color=(0.02, 0.02, 0.02), roughness=0.35),
)
"""Greys in proportion to public images of Tango, white paint at 0.75; `tango-mli` wraps the sides."""

MLI = Material(name="mli", base_color=(0.83, 0.62, 0.27), metallic=0.7, roughness=0.35, crinkle=0.9)
"""Aluminised polyimide, coloured by the film; its non-metallic share stands for scattering in creases."""
