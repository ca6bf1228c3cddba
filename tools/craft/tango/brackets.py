"""Tango's metalwork: truss feet, corner trusses, and the outriggers that carry panel and antennas."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.level import facets
from tools.craft.shapes.mesh import Mesh, merge, unit
from tools.craft.shapes.prism import circle, prism
from tools.craft.shapes.solids import bar, box, rod, truss
from tools.craft.tango.dimensions import (
    ANTENNA_COLLAR_M,
    ANTENNA_RADIUS_COLLAR_M,
    ANTENNA_ROOTS,
    ANTENNA_TIPS,
    BODY_X_M,
    BODY_Y_HIGH_M,
    BODY_Y_LOW_M,
    PANEL_BOTTOM_M,
)

PLATE_M = 0.007  # thickness of the sheet metal
Y_AXIS, Z_AXIS, X_AXIS = (0, 1, 0), (0, 0, 1), (1, 0, 0)
NODE_TOP_M, NODE_LOW_M = 0.284, 0.211
"""Heights of the two inner nodes of an outrigger."""


def build_brackets(detail: Detail = "full") -> list[Piece]:
    """Return all brackets, by family."""
    return [
        Piece("foot_brackets", "aluminium", merge([*_corner_feet(detail), *_middle_feet(detail)])),
        Piece("corner_trusses", "aluminium", merge(_corner_trusses(detail))),
        Piece("side_brackets", "aluminium", merge(_side_triangles(detail))),
        Piece("panel_outriggers", "aluminium", merge(_outriggers_low_y())),
        Piece(
            "antenna_brackets",
            "aluminium",
            merge([*_antenna_brackets_high_y(detail), _antenna_plate_low_y(detail)]),
        ),
        Piece("panel_blocks", "aluminium", merge(_panel_blocks())),
    ]


def _both_x(mesh: Mesh) -> list[Mesh]:
    return [mesh, mesh.mirrored(0)]


def _boss(
    centre: tuple[float, float], origin: np.ndarray, u: np.ndarray, v: np.ndarray, detail: Detail
) -> Mesh:
    """Return a bolt head on a bracket's node."""
    n = np.cross(u, v)
    p = origin + centre[0] * u + centre[1] * v
    return rod(p, p + n * (PLATE_M + 0.0025), 0.0042, facets(detail, 12))


def _v_bracket(
    origin: tuple[float, float, float],
    along: tuple[int, int, int],
    inward: tuple[int, int, int],
    detail: Detail,
) -> Mesh:
    """Return a bow-tie plate on an edge of the body: two triangles that meet at the waist.

    ``along`` the edge, ``inward`` on the face; the plate stands out along their cross product.
    """
    outline = [
        (-0.058, -0.009), (0.058, -0.009), (0.058, 0.028), (0.051, 0.028),
        (0.006, 0.004), (-0.006, 0.004), (-0.051, 0.028), (-0.058, 0.028),
    ]  # fmt: skip
    holes = [[(s * 0.0525, 0.001), (s * 0.0525, 0.018), (s * 0.019, 0.001)] for s in (-1, 1)]
    o, u, v = (np.asarray(a, float) for a in (origin, along, inward))
    plate = prism(outline, PLATE_M, holes=holes, origin_m=o, u=u, v=v)
    return merge([plate, _boss((-0.054, 0.0235), o, u, v, detail), _boss((0.054, 0.0235), o, u, v, detail)])


def _corner_feet(detail: Detail) -> list[Mesh]:
    """Return the V plates at the four corners, on the bottom and on the +-x faces."""
    feet = []
    for y, sign in ((BODY_Y_LOW_M, 1), (BODY_Y_HIGH_M, -1)):
        along_x = (sign * -1, 0, 0)
        # (-sign x) x (sign y) points to -z, the outside of the bottom
        feet += _both_x(_v_bracket((0.260, y, 0.0), along_x, (0, sign, 0), detail))
        along_z = (0, 0, sign * -1)
        # (-sign z) x (sign y) points to +x
        feet += _both_x(_v_bracket((BODY_X_M, y, 0.111), along_z, (0, sign, 0), detail))
    return feet


def _m_bracket(
    depth_m: float, origin: tuple[float, float, float], inward: tuple[int, int, int], detail: Detail
) -> Mesh:
    """Return a trapezoid plate with three triangular holes on a +-x edge of the bottom."""
    s = depth_m / 0.068
    outline = [(-0.0435, -0.009), (0.0435, -0.009), (0.0255, 0.068 * s), (-0.0255, 0.068 * s)]
    holes = [[(-0.0145, 0.058 * s), (0.0145, 0.058 * s), (0.0, 0.019 * s)]]
    holes += [[(k * 0.0350, 0.003), (k * 0.0045, 0.003), (k * 0.0195, 0.046 * s)] for k in (-1, 1)]
    o, v = np.asarray(origin, float), np.asarray(inward, float)
    # y x z = +x is the side's outside; y x (-x) = +z is the body's inside, so the bottom leaf runs along -y
    u = np.array([0.0, 1.0 if inward[2] else -1.0, 0.0])
    plate = prism(outline, PLATE_M, holes=holes, origin_m=o, u=u, v=v)
    return merge([plate, *(_boss((k * 0.0205, 0.062 * s), o, u, v, detail) for k in (-1, 1))])


def _middle_feet(detail: Detail) -> list[Mesh]:
    """Return the two M feet at the middle of the +-x edges: one leaf on the side, one on the bottom."""
    side = _m_bracket(0.068, (BODY_X_M, 0.020, 0.0), (0, 0, 1), detail)
    bottom = _m_bracket(0.044, (BODY_X_M, 0.020, 0.0), (-1, 0, 0), detail)
    return [*_both_x(side), *_both_x(bottom)]


def _corner_trusses(detail: Detail) -> list[Mesh]:
    """Return the thin rods over the +-y faces between the nodes of the corner feet."""
    meshes = []
    for y in (BODY_Y_LOW_M - 0.006, BODY_Y_HIGH_M + 0.006):
        nodes = [
            (0.371, y, 0.160), (0.371, y, 0.062), (0.311, y, 0.0), (0.208, y, 0.0), (0.291, y, 0.0818),
        ]  # fmt: skip
        members = [(0, 3), (1, 2), (4, 1), (4, 2)]
        meshes += _both_x(truss(nodes, members, 0.0030, facets(detail, 8)))
    return meshes


def _side_triangles(detail: Detail) -> list[Mesh]:
    """Return the triangular frames on the +-x faces, one towards each +-y edge."""
    meshes = []
    for edge, sign in ((BODY_Y_HIGH_M, 1), (BODY_Y_LOW_M, -1)):
        outline = [
            (edge - sign * 0.114, 0.2475),
            (edge - sign * 0.012, 0.2930),
            (edge - sign * 0.012, 0.2020),
        ]
        hole = [(edge - sign * 0.082, 0.2475), (edge - sign * 0.026, 0.2715), (edge - sign * 0.026, 0.2225)]
        meshes.append(prism(outline, PLATE_M, holes=[hole], origin_m=(BODY_X_M, 0, 0), u=Y_AXIS, v=Z_AXIS))
        bosses = [(edge - sign * 0.097, 0.2475), *((edge - sign * 0.019, z) for z in (0.284, 0.2475, 0.211))]
        o, u, v = np.array([BODY_X_M, 0, 0]), np.array([0.0, 1, 0]), np.array([0.0, 0, 1])
        meshes += [_boss(b, o, u, v, detail) for b in bosses]
    return [m for mesh in meshes for m in _both_x(mesh)]


def _outriggers_low_y() -> list[Mesh]:
    """Return the machined plates that reach out under the panel's -y overhang, in the planes of the +-x faces."""
    outline = [
        (-0.2520, 0.2900), (-0.3725, 0.2900), (-0.3725, 0.2790),
        (-0.3470, 0.2630), (-0.3455, 0.2350), (-0.2520, 0.2030),
    ]  # fmt: skip
    holes = [
        [(-0.2640, 0.2800), (-0.2990, 0.2800), (-0.2640, 0.2370)],
        [(-0.2900, 0.2480), (-0.3070, 0.2800), (-0.3560, 0.2800), (-0.3420, 0.2710)],
        [(-0.3080, 0.2390), (-0.3370, 0.2560), (-0.3370, 0.2400)],
    ]
    plate = prism(outline, PLATE_M, holes=holes, origin_m=(BODY_X_M - 0.001, 0, 0), u=Y_AXIS, v=Z_AXIS)
    return _both_x(plate)


def _panel_blocks() -> list[Mesh]:
    """Return the blocks between the outriggers and the back of the panel."""
    low = box((0.294, -0.3725, 0.2850), (0.376, -0.3450, PANEL_BOTTOM_M), bevel_m=0.0015)
    high = box((0.290, 0.3600, 0.2850), (0.350, 0.3820, PANEL_BOTTOM_M), bevel_m=0.0015)
    foot = box((0.250, BODY_Y_LOW_M - 0.004, 0.268), (0.300, BODY_Y_LOW_M + 0.018, 0.276))
    return [m for mesh in (low, high, foot) for m in _both_x(mesh)]


def _antenna_brackets_high_y(detail: Detail) -> list[Mesh]:
    """Open trusses from the body's +y corners to a ring about each corner antenna's collar."""
    meshes = []
    for sign, root, tip in ((-1, ANTENNA_ROOTS[0], ANTENNA_TIPS[0]), (1, ANTENNA_ROOTS[1], ANTENNA_TIPS[1])):
        axis = unit(np.subtract(tip, root))
        centre = np.asarray(root) + axis * (ANTENNA_COLLAR_M - 0.006)
        u = unit(np.cross(axis, Z_AXIS))
        v = np.cross(u, axis)
        hole = circle((0, 0), ANTENNA_RADIUS_COLLAR_M - 0.007, facets(detail, 24))
        # u x v points back along the axis, so the plate is thickened towards the root
        rim = circle((0, 0), 0.0345, facets(detail, 32))
        meshes.append(prism(rim, 0.005, holes=[hole], origin_m=centre + axis * 0.005, u=u, v=v))
        ring = {(a, b): centre + a * 0.0225 * u + b * 0.0225 * v for a in (-1, 1) for b in (-1, 1)}
        out = 1 if (u @ np.array([sign, 0, 0])) > 0 else -1
        x, y = sign * (BODY_X_M + 0.004), BODY_Y_HIGH_M - 0.019
        nodes = [
            (x, y, NODE_TOP_M), (x, y, NODE_LOW_M), ring[out, 1], ring[out, -1],
            (sign * 0.318, BODY_Y_HIGH_M, 0.255), (sign * 0.318, BODY_Y_HIGH_M, 0.215),
            ring[-out, 1], ring[-out, -1],
        ]  # fmt: skip
        members = [(0, 2), (1, 3), (0, 3), (4, 6), (5, 7), (4, 7), (0, 6), (1, 7)]
        meshes.append(truss(np.array(nodes, float), members, 0.0030, facets(detail, 8)))
        top = [(0.315, 0.374), (0.372, 0.400), (0.348, 0.4255)]
        meshes.append(prism([(sign * a, b) for a, b in top], 0.004, origin_m=(0, 0, 0.2845)))
    return meshes


def _antenna_plate_low_y(detail: Detail) -> Mesh:
    """Return the plate that holds the -y antenna's collar, fixed to the +x outrigger."""
    root, tip = np.asarray(ANTENNA_ROOTS[2]), np.asarray(ANTENNA_TIPS[2])
    centre = root + unit(tip - root) * (ANTENNA_COLLAR_M - 0.006)
    cx, cz = float(centre[0]), float(centre[2])
    arc = [(cx + 0.035 * np.cos(t), cz + 0.035 * np.sin(t)) for t in np.deg2rad(np.linspace(165, 270, 10))]
    outline = [(0.3740, cz - 0.035), (0.3740, 0.2960), (cx - 0.035 * 0.97, 0.2960), *arc]
    hole = circle((cx, cz), ANTENNA_RADIUS_COLLAR_M - 0.007, facets(detail, 24))
    plate = prism(outline, 0.005, holes=[hole], origin_m=(0, float(centre[1]), 0), u=X_AXIS, v=Z_AXIS)
    y = float(centre[1])
    struts = [
        bar((0.345, y, 0.288), (0.345, BODY_Y_LOW_M, 0.262), 0.005, 0.008, Z_AXIS),
        bar((0.278, y, 0.288), (0.278, BODY_Y_LOW_M, 0.262), 0.005, 0.008, Z_AXIS),
        bar((0.345, y, 0.224), (0.345, BODY_Y_LOW_M, 0.240), 0.005, 0.008, Z_AXIS),
    ]
    return merge([plate, *struts])
