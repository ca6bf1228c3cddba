"""Tango with the dimensions of a thesis on its pose estimation: another geometry than SPEED's, never mixed with it.

Published: panel 570 x 759 mm, body 560 x 550 x 300 mm, four antennas of 204 mm, one bar. Everything else (thicknesses,
cells, radii, the bar's length, the places of antennas and bar) is taken over from the builders of the SPEED model.

Frame: as Tango's, origin in the middle of the bottom plate and z out of the solar panel. The body is centred under the
panel, and antennas stand at all four corners: only the bar and the bottom's instruments break the symmetry. The
screws of panel frame and side plates are this model's own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.model import Detail, Edge, Target
from tools.craft.assemble import Piece, assemble
from tools.craft.hardware import socket_screws
from tools.craft.labels import axis_edge, box_edges, face_edges
from tools.craft.level import facets
from tools.craft.mass import MassElement
from tools.craft.place import both_sides
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.solids import box, cone, rod, truss
from tools.craft.tango.dimensions import (
    ANTENNA_RADIUS_COLLAR_M,
    ANTENNA_RADIUS_STUB_M,
    ANTENNA_RADIUS_TIP_M,
    FRAME_X_M,
    FRAME_Y_M,
    SIDE_PLATE_M,
    STRIP_M,
    TangoDimensions,
)
from tools.craft.tango.instruments import build_bottom_instruments
from tools.craft.tango.labels import CORNERS
from tools.craft.tango.materials import MATERIALS
from tools.craft.tango.structure import build_antennas, build_body, build_panel

PANEL_X_M, PANEL_Y_M = 0.570 / 2, 0.759 / 2
BODY_X_M, BODY_Y_M, BODY_TOP_M = 0.560 / 2, 0.550 / 2, 0.300
CORE_TOP_M = 0.279
PANEL_BOTTOM_M, PANEL_TOP_M = 0.3120, 0.3325
ANTENNA_M, ANTENNA_Z_M = 0.204, 0.255
BAR_X_M, BAR_Y_M, BAR_RADIUS_M = -BODY_X_M - 0.0235, 0.16, 0.0082
BAR_LOW_M, BAR_HIGH_M = -0.083, 0.300


def _corner_out(sx: int, sy: int, reach_m: float) -> Vec3:
    """Return the point ``reach_m`` along the diagonal from a corner of the body at the antennas' height."""
    d = reach_m * 0.5**0.5
    return (sx * (BODY_X_M + d), sy * (BODY_Y_M + d), ANTENNA_Z_M)


ANTENNA_CORNERS = ((-1, 1), (1, 1), (1, -1), (-1, -1))
THESIS = TangoDimensions(
    panel_x_m=PANEL_X_M,
    panel_y_m=PANEL_Y_M,
    panel_bottom_m=PANEL_BOTTOM_M,
    panel_top_m=PANEL_TOP_M,
    columns=3,
    rows=17,
    cell_pitch_x_m=(PANEL_X_M - FRAME_X_M - STRIP_M / 2) / 3,
    cell_pitch_y_m=2 * (PANEL_Y_M - FRAME_Y_M) / 17,
    body_x_m=BODY_X_M,
    body_y_low_m=-BODY_Y_M,
    body_y_high_m=BODY_Y_M,
    body_top_m=BODY_TOP_M,
    core_top_m=CORE_TOP_M,
    antenna_roots=tuple(_corner_out(sx, sy, 0.0) for sx, sy in ANTENNA_CORNERS),
    antenna_tips=tuple(_corner_out(sx, sy, ANTENNA_M) for sx, sy in ANTENNA_CORNERS),
    antenna_collar_m=0.046,
)
NOTES = (
    "Dimensions of the thesis, not of SPEED: panel 570 x 759 mm, body 560 x 550 x 300 mm, four antennas of 204 mm, one "
    "bar. The rest is taken over from the SPEED model; mass split estimated."
)


def build_tango_thesis(detail: Detail = "full") -> Target:
    """Return Tango after the thesis."""
    return assemble(
        "tango-thesis",
        "Tango (PRISMA), dimensions of the thesis",
        pieces=[
            *build_panel(detail, THESIS),
            *build_body(THESIS),
            *build_antennas(detail, THESIS),
            *_bottom(detail),
            *_brackets(detail),
            *_bar(detail),
            *_screws(detail),
        ],
        materials=MATERIALS,
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "panel": ((0.0, 0.0, PANEL_TOP_M), (0.0, 0.0, 1.0)),
            "bottom": ((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )


def _bottom(detail: Detail) -> list[Piece]:
    """Return the SPEED model's instruments, brought under this shorter body."""
    return [replace(p, mesh=p.mesh.moved((0, -0.0255, 0))) for p in build_bottom_instruments(detail)]


def _brackets(detail: Detail) -> list[Piece]:
    """Return the posts under the panel, and a plate with two struts behind each antenna."""
    posts = [
        box(
            (sx * 0.24 - 0.02, sy * 0.25 - 0.02, BODY_TOP_M - 0.025),
            (sx * 0.24 + 0.02, sy * 0.25 + 0.02, PANEL_BOTTOM_M),
        )
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    struts = []
    for sx, sy in ANTENNA_CORNERS:
        x, y, z = _corner_out(sx, sy, 0.040)
        n = facets(detail, 8)
        nodes = [(sx * (BODY_X_M + 0.003), sy * (BODY_Y_M - 0.08), z - 0.04), (x, y, z - 0.018)]
        nodes += [(sx * (BODY_X_M - 0.08), sy * (BODY_Y_M + 0.003), z - 0.04), (x, y, z + 0.018)]
        nodes += [(sx * (BODY_X_M + 0.003), sy * (BODY_Y_M - 0.08), z + 0.03)]
        struts.append(truss(np.array(nodes), [(0, 1), (2, 1), (0, 3), (4, 3), (2, 3)], 0.003, n))
    return [
        Piece("panel_blocks", "aluminium", merge(posts)),
        Piece("antenna_brackets", "aluminium", merge(struts)),
    ]


def _bar(detail: Detail) -> list[Piece]:
    """Return the single bar, along z off the -x face, in two clips."""
    bar = rod((BAR_X_M, BAR_Y_M, BAR_LOW_M), (BAR_X_M, BAR_Y_M, BAR_HIGH_M), BAR_RADIUS_M, facets(detail, 24))
    clips = [
        box((BAR_X_M - 0.0115, BAR_Y_M - 0.011, z - 0.008), (-BODY_X_M, BAR_Y_M + 0.011, z + 0.008), 0.003)
        for z in (0.055, 0.185)
    ]
    return [Piece("bar", "antenna-grey", bar), Piece("bar_clips", "aluminium", merge(clips))]


def _screws(detail: Detail) -> list[Piece]:
    """Return the button heads round the panel's frame, and along the rims of the side plates."""
    if detail != "full":
        return []
    x, y = PANEL_X_M - FRAME_X_M / 2, PANEL_Y_M - FRAME_Y_M / 2
    frame = [(s * x, v, PANEL_TOP_M) for s in (-1, 1) for v in np.linspace(-y, y, 11)]
    frame += [(u, s * y, PANEL_TOP_M) for s in (-1, 1) for u in np.linspace(-x, x, 8)[1:-1]]
    heads = [socket_screws(frame, (0, 0, 1), 0.0022, 0.0010, detail)]
    for s in (-1, 1):
        rim = [(s * BODY_X_M, v, z) for z in (0.012, 0.285) for v in np.linspace(-0.25, 0.25, 6)]
        heads.append(socket_screws(rim, (s, 0, 0), 0.0025, 0.0012, detail))
    return [Piece("screws", "aluminium", merge(heads))]


def _keypoints() -> dict[str, Vec3]:
    """Return the keypoints in the order of SPEED's: panel corners, bottom corners, antenna tips; then roots and the
    bar's ends.
    """
    points = {f"panel_{a}_{b}": (sx * PANEL_X_M, sy * PANEL_Y_M, PANEL_TOP_M) for a, b, sx, sy in CORNERS}
    points |= {f"bottom_{a}_{b}": (sx * BODY_X_M, sy * BODY_Y_M, 0.0) for a, b, sx, sy in CORNERS}
    points |= {f"antenna_{k + 1}_tip": p for k, p in enumerate(THESIS.antenna_tips)}
    points |= {f"antenna_{k + 1}_root": p for k, p in enumerate(THESIS.antenna_roots)}
    points |= {"bar_bottom": (BAR_X_M, BAR_Y_M, BAR_LOW_M), "bar_top": (BAR_X_M, BAR_Y_M, BAR_HIGH_M)}
    return points


def _collar(k: int) -> Vec3:
    sx, sy = ANTENNA_CORNERS[k]
    return _corner_out(sx, sy, THESIS.antenna_collar_m)


def _wireframe() -> list[Edge]:
    edges = box_edges("panel", (-PANEL_X_M, -PANEL_Y_M, PANEL_BOTTOM_M), (PANEL_X_M, PANEL_Y_M, PANEL_TOP_M))
    x, y, half = PANEL_X_M - FRAME_X_M, PANEL_Y_M - FRAME_Y_M, STRIP_M / 2
    for name, lo, hi in (("nx", -x, -half), ("px", half, x)):
        corners = [(lo, -y, PANEL_TOP_M), (hi, -y, PANEL_TOP_M), (hi, y, PANEL_TOP_M), (lo, y, PANEL_TOP_M)]
        edges += face_edges(f"panel_field_{name}", corners, (0, 0, 1))
    body = box_edges("body", (-BODY_X_M, -BODY_Y_M, 0.0), (BODY_X_M, BODY_Y_M, BODY_TOP_M))
    # the +-y covers end below the side plates: there is no top edge along x
    edges += [e for e in body if not (e.name.endswith("pz") and "y" in e.name)]
    mean = (ANTENNA_RADIUS_COLLAR_M + ANTENNA_RADIUS_TIP_M) / 2
    edges += [
        axis_edge(f"antenna_{k + 1}", _collar(k), tip, mean) for k, tip in enumerate(THESIS.antenna_tips)
    ]
    edges.append(
        axis_edge("bar", (BAR_X_M, BAR_Y_M, BAR_LOW_M), (BAR_X_M, BAR_Y_M, BAR_HIGH_M), BAR_RADIUS_M)
    )
    return edges


def _occluders() -> list[Mesh]:
    inner = BODY_X_M - SIDE_PLATE_M
    side = box((inner, -BODY_Y_M, CORE_TOP_M), (BODY_X_M, BODY_Y_M, BODY_TOP_M))
    bodies = [
        box((-BODY_X_M, -BODY_Y_M, 0), (BODY_X_M, BODY_Y_M, CORE_TOP_M)),
        *both_sides(side, 0),
        box((-PANEL_X_M, -PANEL_Y_M, PANEL_BOTTOM_M), (PANEL_X_M, PANEL_Y_M, PANEL_TOP_M)),
    ]
    for k, tip in enumerate(THESIS.antenna_tips):
        bodies.append(cone(_collar(k), tip, ANTENNA_RADIUS_COLLAR_M, ANTENNA_RADIUS_TIP_M, 8))
        bodies.append(rod(THESIS.antenna_roots[k], _collar(k), ANTENNA_RADIUS_STUB_M, 6))
    bodies.append(rod((BAR_X_M, BAR_Y_M, BAR_LOW_M), (BAR_X_M, BAR_Y_M, BAR_HIGH_M), BAR_RADIUS_M, 6))
    return bodies


def _lumps() -> list[MassElement]:
    """Return Tango's 50 kg in the same shares as for the SPEED model (tango_mass.py), on this body."""
    x, y = 2 * BODY_X_M, 2 * BODY_Y_M
    lumps = [
        MassElement("avionics and battery", 30.0, (0, 0, 0.12), size_m=(x - 0.1, y - 0.1, 0.2)),
        MassElement("bottom plate and instruments", 5.6, (0, 0, 0.011), size_m=(x, y, 0.022)),
        MassElement("side plates", 4.8, (0, 0, BODY_TOP_M / 2), size_m=(x, y, BODY_TOP_M)),
        MassElement("covers", 2.8, (0, 0, 0.14), size_m=(x, y, 0.25)),
        MassElement(
            "solar panel",
            4.2,
            (0, 0, (PANEL_BOTTOM_M + PANEL_TOP_M) / 2),
            size_m=(2 * PANEL_X_M, 2 * PANEL_Y_M, 0.02),
        ),
        MassElement("bar", 0.2, (BAR_X_M, BAR_Y_M, BAR_LOW_M), tip_m=(BAR_X_M, BAR_Y_M, BAR_HIGH_M)),
    ]
    for root, tip in zip(THESIS.antenna_roots, THESIS.antenna_tips, strict=True):
        lumps.append(MassElement("antenna", 0.6, vec3(np.array(root)), tip_m=tip))
    return lumps
