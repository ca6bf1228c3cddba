"""Surfaces common to several craft: metals, paints, insulation, cells under cover glass, mirrors.

Reflectances in the middle of the ranges of Gilmore, Spacecraft Thermal Control Handbook, vol. 1 (2002), app. A:
white paint absorbs 0.17 to 0.28 of sunlight, black paint 0.96, aluminised Kapton 0.35 to 0.45, silvered quartz
(optical solar reflectors) 0.05 to 0.10. Metals as in glTF: base colour is the reflectance at normal incidence.
"""

from __future__ import annotations

from simulator.targets.model import Material

WHITE_PAINT = Material(name="white-paint", base_color=(0.78, 0.78, 0.76), roughness=0.6)
BLACK_PAINT = Material(name="black-paint", base_color=(0.04, 0.04, 0.042), roughness=0.6)
GREY_PAINT = Material(name="grey-paint", base_color=(0.32, 0.32, 0.33), roughness=0.6)
BARE_ALUMINIUM = Material(name="bare-aluminium", base_color=(0.80, 0.80, 0.80), metallic=0.75, roughness=0.32)
BRUSHED_ALUMINIUM = Material(
    name="brushed-aluminium", base_color=(0.62, 0.62, 0.63), metallic=0.6, roughness=0.5
)
TITANIUM = Material(name="titanium", base_color=(0.50, 0.46, 0.42), metallic=0.7, roughness=0.38)
NOZZLE_NIOBIUM = Material(name="nozzle", base_color=(0.16, 0.14, 0.13), metallic=0.6, roughness=0.45)
STEEL = Material(name="spring-steel", base_color=(0.58, 0.55, 0.47), metallic=0.7, roughness=0.35)
GOLD_MLI = Material(name="mli-gold", base_color=(0.83, 0.60, 0.24), metallic=0.7, roughness=0.33, crinkle=0.9)
SILVER_MLI = Material(
    name="mli-silver", base_color=(0.74, 0.74, 0.75), metallic=0.7, roughness=0.35, crinkle=0.8
)
BLACK_MLI = Material(name="mli-black", base_color=(0.045, 0.045, 0.05), roughness=0.4, crinkle=0.7)
RADIATOR = Material(
    name="radiator-mirror", base_color=(0.86, 0.87, 0.90), metallic=0.55, roughness=0.14, clearcoat=0.6
)
CARBON_FIBRE = Material(name="carbon-fibre", base_color=(0.06, 0.06, 0.065), roughness=0.5)
KAPTON = Material(name="kapton-substrate", base_color=(0.30, 0.17, 0.05), roughness=0.5)
BUSBAR = Material(name="busbar", base_color=(0.66, 0.65, 0.62), metallic=0.5, roughness=0.4)
LENS = Material(
    name="lens", base_color=(0.015, 0.012, 0.025), roughness=0.2, clearcoat=1.0, clearcoat_roughness=0.03
)
CELL_SILICON = Material(
    name="solar-cell-silicon",
    base_color=(0.010, 0.018, 0.060),
    roughness=0.4,
    clearcoat=1.0,
    clearcoat_roughness=0.05,
)
CELL_GAAS = Material(
    name="solar-cell",
    base_color=(0.012, 0.014, 0.030),
    roughness=0.4,
    clearcoat=1.0,
    clearcoat_roughness=0.04,
)

FINISHES = (
    WHITE_PAINT,
    BLACK_PAINT,
    GREY_PAINT,
    BARE_ALUMINIUM,
    BRUSHED_ALUMINIUM,
    TITANIUM,
    NOZZLE_NIOBIUM,
    STEEL,
    GOLD_MLI,
    SILVER_MLI,
    BLACK_MLI,
    RADIATOR,
    CARBON_FIBRE,
    KAPTON,
    BUSBAR,
    LENS,
    CELL_SILICON,
    CELL_GAAS,
)
"""All of them; a craft keeps those that its parts use."""
