"""Surfaces that the larger craft share: paint, ablator, metal, blankets, cover glass, windows.

White paints absorb 0.17 to 0.28 of sunlight, black ones 0.96 (Gilmore, Spacecraft Thermal Control Handbook);
colours of blankets and cells are judged on public photographs. The non-metallic share of metals stands for scattering
in machining marks, without which they mirror nothing but black sky.
"""

from __future__ import annotations

from simulator.targets.model import Material

WHITE = Material(name="white-paint", base_color=(0.78, 0.78, 0.77), roughness=0.55)
WHITE_SEAM = Material(name="white-seam", base_color=(0.50, 0.50, 0.49), roughness=0.65)
WHITE_CLOTH = Material(name="white-cloth", base_color=(0.74, 0.73, 0.70), roughness=0.8, crinkle=0.12)
RADIATOR = Material(
    name="radiator", base_color=(0.70, 0.71, 0.72), roughness=0.3, clearcoat=0.4, clearcoat_roughness=0.15
)
CHAR = Material(name="burnt-ablator", base_color=(0.030, 0.028, 0.026), roughness=0.85)
BLACK = Material(name="black-paint", base_color=(0.035, 0.035, 0.037), roughness=0.6)
GREY = Material(name="grey-paint", base_color=(0.30, 0.30, 0.31), roughness=0.6)
DARK = Material(name="dark-interior", base_color=(0.085, 0.083, 0.080), roughness=0.75)
ALUMINIUM = Material(name="bare-aluminium", base_color=(0.55, 0.55, 0.56), metallic=0.5, roughness=0.4)
BRUSHED = Material(name="brushed-metal", base_color=(0.42, 0.41, 0.40), metallic=0.5, roughness=0.5)
NOZZLE = Material(name="nozzle-alloy", base_color=(0.24, 0.21, 0.19), metallic=0.6, roughness=0.45)
WINDOW = Material(
    name="window", base_color=(0.010, 0.011, 0.013), roughness=0.3, clearcoat=1.0, clearcoat_roughness=0.02
)
CELL_BLACK = Material(
    name="solar-cell-black",
    base_color=(0.012, 0.013, 0.020),
    roughness=0.45,
    clearcoat=1.0,
    clearcoat_roughness=0.04,
)
CELL_BLUE = Material(
    name="solar-cell-blue",
    base_color=(0.016, 0.022, 0.070),
    roughness=0.4,
    clearcoat=1.0,
    clearcoat_roughness=0.04,
)
SUBSTRATE = Material(name="cell-substrate", base_color=(0.22, 0.22, 0.21), roughness=0.6)
PANEL_BACK = Material(name="panel-back", base_color=(0.42, 0.42, 0.40), roughness=0.6)
GREY_GREEN = Material(
    name="blanket-grey-green", base_color=(0.205, 0.215, 0.170), roughness=0.7, crinkle=0.45
)
GREY_GREEN_DARK = Material(name="blanket-dark", base_color=(0.110, 0.116, 0.095), roughness=0.7, crinkle=0.45)
GOLD = Material(name="mli-gold", base_color=(0.80, 0.58, 0.25), metallic=0.7, roughness=0.35, crinkle=0.8)
SILVER = Material(name="mli-silver", base_color=(0.72, 0.72, 0.72), metallic=0.7, roughness=0.4, crinkle=0.6)

MATERIALS = (
    WHITE, WHITE_SEAM, WHITE_CLOTH, RADIATOR, CHAR, BLACK, GREY, DARK, ALUMINIUM, BRUSHED, NOZZLE, WINDOW,
    CELL_BLACK, CELL_BLUE, SUBSTRATE, PANEL_BACK, GREY_GREEN, GREY_GREEN_DARK, GOLD, SILVER,
)  # fmt: skip
