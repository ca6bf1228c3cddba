"""Tango as a mock-up in a laboratory: the flight model's shape, other surfaces, a bright rim and lines on its panel.

As images of SPEED+'s lightbox show it: the panel's rim is bare and bright, cells are joined by thin bright lines,
its face mirrors light boxes with blurred edges, sides are foil of which one is smooth and one creased, brackets are
black.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flyaround.simulator.targets.model import Detail, Material
from tools.craft.assemble import Piece
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.prism import cell_grid, prism, rectangle
from tools.craft.tango.dimensions import SPEED, STRIP_M
from tools.craft.tango.structure import CLIP_M, GAP_M, SUBSTRATE_M, TAB_M

RIM_M = 0.0008
"""By so much the bright rim stands out of the panel's edge."""
LINE_M = 0.0012
"""Width of the lines between rows of cells, in gaps of 1.4 mm."""

MATERIALS = (
    Material(name="white-paint", base_color=(0.70, 0.70, 0.69), roughness=0.45),
    Material(name="plate-edge", base_color=(0.60, 0.60, 0.60), metallic=0.3, roughness=0.35),
    Material(name="foil-smooth", base_color=(0.55, 0.55, 0.55), metallic=0.95, roughness=0.2),
    Material(name="foil-creased", base_color=(0.55, 0.55, 0.55), metallic=0.85, roughness=0.3, crinkle=0.35),
    Material(name="foil-bottom", base_color=(0.55, 0.55, 0.55), metallic=0.6, roughness=0.35, crinkle=0.1),
    Material(name="body-dark", base_color=(0.06, 0.06, 0.06), roughness=0.5),
    Material(
        name="panel-frame",
        base_color=(0.17, 0.17, 0.17),
        roughness=0.45,
        clearcoat=0.7,
        clearcoat_roughness=0.3,
    ),
    Material(name="panel-substrate", base_color=(0.15, 0.15, 0.15), roughness=0.5),
    Material(
        name="solar-cell",
        base_color=(0.012, 0.012, 0.016),
        roughness=0.45,
        clearcoat=1.0,
        clearcoat_roughness=0.25,
    ),
    Material(name="interconnect", base_color=(0.70, 0.70, 0.69), roughness=0.45),
    Material(name="antenna-grey", base_color=(0.10, 0.10, 0.10), roughness=0.4),
    Material(name="aluminium", base_color=(0.06, 0.06, 0.06), roughness=0.4),
    Material(name="instrument-black", base_color=(0.02, 0.02, 0.02), roughness=0.35),
)
"""Greys fitted to images: docs/lab/2026-11-real-pictures.md."""
_SURFACES = {
    "panel_interconnects": "panel-substrate",
    "body_bottom_sheet": "foil-bottom",
    "body_cover_ny": "foil-smooth",
    "body_cover_py": "foil-creased",
    "body_core": "foil-smooth",
    "side_domes": "white-paint",
    "plate_white": "body-dark",
    "plate_grey": "body-dark",
}
"""Parts whose surface is another than the flight model's."""


def mockup_pieces(pieces: list[Piece], detail: Detail) -> list[Piece]:
    """Return the flight model's pieces with other surfaces, the panel's rim, lines where cells are drawn one by one."""
    d = SPEED
    changed = [replace(p, material=_SURFACES.get(p.name, p.material)) for p in pieces]
    outline = rectangle((-d.panel_x_m, -d.panel_y_m), (d.panel_x_m, d.panel_y_m))
    beyond = rectangle(
        (-d.panel_x_m - RIM_M, -d.panel_y_m - RIM_M), (d.panel_x_m + RIM_M, d.panel_y_m + RIM_M)
    )
    height = d.panel_top_m - d.panel_bottom_m
    changed.append(
        Piece(
            "panel_rim",
            "white-paint",
            prism(beyond, height, holes=[outline], origin_m=(0, 0, d.panel_bottom_m)),
        )
    )
    if detail == "full":
        half = (d.cell_pitch_x_m - GAP_M) / 2 - CLIP_M
        line = rectangle((-half, -LINE_M / 2), (half, LINE_M / 2))
        joints = (np.arange(d.rows - 1) - (d.rows - 2) / 2) * d.cell_pitch_y_m
        centres = STRIP_M / 2 + (np.arange(d.columns) + 0.5) * d.cell_pitch_x_m
        top = d.panel_top_m - SUBSTRATE_M
        fields = [cell_grid(side * centres, joints, line, top, TAB_M) for side in (-1.0, 1.0)]
        changed.append(Piece("panel_lines", "interconnect", merge(fields)))
    return changed
