"""Label geometry of Tango: keypoints, wireframe, occluders."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.model import Edge
from tools.craft.labels import axis_edge, box_edges, edge
from tools.craft.shapes.mesh import Mesh
from tools.craft.shapes.prism import prism
from tools.craft.shapes.solids import box, cone, rod
from tools.craft.tango.dimensions import (
    ANTENNA_COLLAR_M,
    ANTENNA_RADIUS_COLLAR_M,
    ANTENNA_RADIUS_TIP_M,
    ANTENNA_ROOTS,
    ANTENNA_TIPS,
    BAR_HIGH_M,
    BAR_LOW_M,
    BODY_TOP_M,
    BODY_X_M,
    BODY_Y_HIGH_M,
    BODY_Y_LOW_M,
    CONNECTOR_BOTTOM_M,
    CONNECTOR_OUTLINE_M,
    CONNECTOR_TOP_M,
    CORE_TOP_M,
    FRAME_X_M,
    FRAME_Y_M,
    PANEL_BOTTOM_M,
    PANEL_TOP_M,
    PANEL_X_M,
    PANEL_Y_M,
    ROD_BOTTOM_M,
    ROD_RADIUS_M,
    ROD_TOP_M,
    ROD_X_M,
    ROD_Y_M,
    SIDE_BOX_HIGH_M,
    SIDE_BOX_LOW_M,
    SIDE_PLATE_M,
    SPIKE_RADIUS_M,
    SPIKE_TIP_M,
    SPIKE_Y_M,
    SPIKE_Z_M,
    STRIP_M,
    WHITE_PLATE_HIGH_M,
    WHITE_PLATE_LOW_M,
)

CORNERS = (("nx", "ny", -1, -1), ("px", "ny", 1, -1), ("px", "py", 1, 1), ("nx", "py", -1, 1))


def build_keypoints() -> dict[str, Vec3]:
    """Return the eleven points of SPEED first (panel, bottom, antenna tips), then this model's extras."""
    points: dict[str, Vec3] = {
        f"panel_{a}_{b}": (sx * PANEL_X_M, sy * PANEL_Y_M, PANEL_TOP_M) for a, b, sx, sy in CORNERS
    }
    points |= {
        f"bottom_{a}_{b}": (sx * BODY_X_M, BODY_Y_HIGH_M if sy > 0 else BODY_Y_LOW_M, 0.0)
        for a, b, sx, sy in CORNERS
    }
    points |= {f"antenna_{k + 1}_tip": p for k, p in enumerate(ANTENNA_TIPS)}
    points |= {f"antenna_{k + 1}_root": p for k, p in enumerate(ANTENNA_ROOTS)}
    return points | {
        "spike_nx_tip": (-SPIKE_TIP_M, SPIKE_Y_M, SPIKE_Z_M),
        "spike_px_tip": (SPIKE_TIP_M, SPIKE_Y_M, SPIKE_Z_M),
        "rod_bottom": (ROD_X_M, ROD_Y_M, ROD_BOTTOM_M),
        "connector_corner": (*CONNECTOR_OUTLINE_M[5], CONNECTOR_TOP_M),
        "plate_corner": WHITE_PLATE_HIGH_M,
        "bar_corner": BAR_LOW_M,
    }


def build_wireframe() -> list[Edge]:
    """Return the straight edges that a camera sees, on the mesh; antennas and rods by their axes."""
    panel = box_edges("panel", (-PANEL_X_M, -PANEL_Y_M, PANEL_BOTTOM_M), (PANEL_X_M, PANEL_Y_M, PANEL_TOP_M))
    body = box_edges("body", (-BODY_X_M, BODY_Y_LOW_M, 0.0), (BODY_X_M, BODY_Y_HIGH_M, BODY_TOP_M))
    # the +-y covers end below the side plates: there is no top edge along x
    body = [e for e in body if not (e.name.endswith("pz") and "y" in e.name)]
    return [*panel, *_frame_edges(), *body, *_fitting_edges(), *_rod_axes()]


def _frame_edges() -> list[Edge]:
    """Return the inner outlines of the panel's frame: light metal beside dark cells, seen from above only."""
    x, y, half, z = PANEL_X_M - FRAME_X_M, PANEL_Y_M - FRAME_Y_M, STRIP_M / 2, PANEL_TOP_M
    up = (0, 0, 1)
    lines = {"panel_strip_nx": -half, "panel_strip_px": half, "panel_frame_nx": -x, "panel_frame_px": x}
    edges = [edge(name, (y_edge, -y, z), (y_edge, y, z), up) for name, y_edge in lines.items()]
    for row, y_edge in (("ny", -y), ("py", y)):
        edges.append(edge(f"panel_frame_{row}_nx", (-x, y_edge, z), (-half, y_edge, z), up))
        edges.append(edge(f"panel_frame_{row}_px", (half, y_edge, z), (x, y_edge, z), up))
    return edges


def _fitting_edges() -> list[Edge]:
    """Return the outlines of the white fittings: what stands out brightest after the panel."""
    plate = box_edges("plate", WHITE_PLATE_LOW_M, WHITE_PLATE_HIGH_M)
    side = box_edges("side_box", SIDE_BOX_LOW_M, SIDE_BOX_HIGH_M)
    front = box_edges("bar", BAR_LOW_M, BAR_HIGH_M)
    edges = [e for e in plate if "py" in e.name.removeprefix("plate")]
    edges += [e for e in side if "px" in e.name.removeprefix("side_box")]
    edges += [e for e in front if "ny" in e.name.removeprefix("bar")]
    return edges + _prism_edges("connector", CONNECTOR_OUTLINE_M, CONNECTOR_BOTTOM_M, CONNECTOR_TOP_M)


def _prism_edges(
    name: str, outline_m: tuple[tuple[float, float], ...], z0_m: float, z1_m: float
) -> list[Edge]:
    """Return the top, bottom and upright edges of an upright prism, but for its first wall (against the panel)."""
    corners = [(*p, z) for z in (z0_m, z1_m) for p in outline_m]
    n = len(outline_m)
    walls: list[Vec3] = []
    for k in range(n):
        (ax, ay), (bx, by) = outline_m[k], outline_m[(k + 1) % n]
        length = float(np.hypot(bx - ax, by - ay))
        walls.append(((by - ay) / length, -(bx - ax) / length, 0.0))
    edges = []
    for k in range(1, n):
        j = (k + 1) % n
        edges.append(edge(f"{name}_low_{k}", corners[k], corners[j], walls[k], (0, 0, -1)))
        edges.append(edge(f"{name}_top_{k}", corners[n + k], corners[n + j], walls[k], (0, 0, 1)))
        edges.append(edge(f"{name}_up_{k}", corners[k], corners[n + k], walls[k - 1], walls[k]))
    return edges


def _rod_axes() -> list[Edge]:
    """Return the axes of antennas, rod and spikes, with their radii: their outlines depend on the view."""
    mean = (ANTENNA_RADIUS_COLLAR_M + ANTENNA_RADIUS_TIP_M) / 2
    axes = [
        axis_edge(f"antenna_{k + 1}", collar_point(root, tip), tip, mean)
        for k, (root, tip) in enumerate(zip(ANTENNA_ROOTS, ANTENNA_TIPS, strict=True))
    ]
    axes.append(
        axis_edge("rod", (ROD_X_M, ROD_Y_M, ROD_BOTTOM_M), (ROD_X_M, ROD_Y_M, ROD_TOP_M), ROD_RADIUS_M)
    )
    for side, sign in (("nx", -1), ("px", 1)):
        start = (sign * (BODY_X_M + 0.024), SPIKE_Y_M, SPIKE_Z_M)
        tip = (sign * SPIKE_TIP_M, SPIKE_Y_M, SPIKE_Z_M)
        axes.append(axis_edge(f"spike_{side}", start, tip, SPIKE_RADIUS_M))
    return axes


def collar_point(root: Vec3, tip: Vec3) -> Vec3:
    """Return the start of the thick part of an antenna, on its axis [m]."""
    axis = np.subtract(tip, root)
    return vec3(np.asarray(root) + axis * (ANTENNA_COLLAR_M / np.linalg.norm(axis)))


def build_occluders() -> list[Mesh]:
    """Return the body, panel, antennas and the larger fittings as coarse closed bodies."""
    inner = BODY_X_M - SIDE_PLATE_M
    bodies = [
        box((-BODY_X_M, BODY_Y_LOW_M, 0), (BODY_X_M, BODY_Y_HIGH_M, CORE_TOP_M)),
        # above the core the side plates alone block the view: one looks through under the panel
        box((-BODY_X_M, BODY_Y_LOW_M, CORE_TOP_M), (-inner, BODY_Y_HIGH_M, BODY_TOP_M)),
        box((inner, BODY_Y_LOW_M, CORE_TOP_M), (BODY_X_M, BODY_Y_HIGH_M, BODY_TOP_M)),
        box((-PANEL_X_M, -PANEL_Y_M, PANEL_BOTTOM_M), (PANEL_X_M, PANEL_Y_M, PANEL_TOP_M)),
    ]
    for root, tip in zip(ANTENNA_ROOTS, ANTENNA_TIPS, strict=True):
        start = collar_point(root, tip)
        bodies.append(cone(start, tip, ANTENNA_RADIUS_COLLAR_M, ANTENNA_RADIUS_TIP_M, 8))
    bodies.append(
        prism(CONNECTOR_OUTLINE_M, CONNECTOR_TOP_M - CONNECTOR_BOTTOM_M, origin_m=(0, 0, CONNECTOR_BOTTOM_M))
    )
    bodies.append(box(SIDE_BOX_LOW_M, SIDE_BOX_HIGH_M))
    bodies.append(box(WHITE_PLATE_LOW_M, WHITE_PLATE_HIGH_M))
    bodies.append(box(BAR_LOW_M, BAR_HIGH_M))
    bodies.append(rod((ROD_X_M, ROD_Y_M, ROD_BOTTOM_M), (ROD_X_M, ROD_Y_M, ROD_TOP_M), ROD_RADIUS_M, 6))
    return bodies
