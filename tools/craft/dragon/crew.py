"""Crew Dragon as it flies an approach: trunk attached, nose cone open, docking port free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.model import Detail, Edge, Target
from tools.craft.assemble import Piece, assemble
from tools.craft.dragon.crew_capsule import build_capsule
from tools.craft.dragon.crew_nose import build_nose, nose_cone
from tools.craft.dragon.crew_shape import (
    CLAW_HIGH_M,
    CLAW_LOW_M,
    DECK_M,
    DECK_RADIUS_M,
    FIN_AZIMUTHS_DEG,
    FIN_M,
    FIN_THICK_M,
    NOSE_HEIGHT_M,
    PORT_M,
    PORT_RADIUS_M,
    RIM_RADIUS_M,
    RIM_TOP_M,
    TRUNK_HIGH_M,
    TRUNK_INNER_M,
    TRUNK_LOW_M,
    TRUNK_RADIUS_M,
    WALL_RAD,
    nose_point,
    nose_rotation,
)
from tools.craft.dragon.crew_trunk import build_trunk, fin_mesh
from tools.craft.hardware import revolve
from tools.craft.labels import QUARTERS, moved_edges, polar, prism_edges, rim_edges
from tools.craft.level import Level
from tools.craft.mass import MassElement, Tube
from tools.craft.place import turn_z
from tools.craft.shapes.mesh import Mesh
from tools.craft.shapes.solids import box

NOTES = (
    "z towards the docking port, origin where capsule and trunk meet, x towards the side hatch. "
    "Height 8.1 m with closed nose cone, diameter 4 m: SpaceX's public figures; trunk 3.7 m wide; "
    "port: International Docking System Standard. Sizes of fittings are judged on photographs; the mass distribution "
    "is an estimate. No symmetry: cells, hatch and nose cone tell the quarters apart."
)


def build_dragon(detail: Detail = "full") -> Target:
    """Return Crew Dragon at a level of detail; labels are the same at all."""
    return assemble(
        "dragon",
        "Crew Dragon with trunk, nose cone open",
        pieces=dragon_pieces(Level(detail)),
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "docking": ((0.0, 0.0, PORT_M), (0.0, 0.0, 1.0)),
            "grasp": ((0.0, 0.0, TRUNK_LOW_M), (0.0, 0.0, -1.0)),
        },
        notes=NOTES,
    )


def dragon_pieces(level: Level, *, nose_closed: bool = False) -> list[Piece]:
    """Return all pieces; with the nose cone closed, the craft is as high as its data sheet says."""
    return [*build_capsule(level), *build_nose(level, closed=nose_closed), *build_trunk(level)]


SLOPE = (float(np.cos(WALL_RAD)), float(np.sin(WALL_RAD)))
"""Outward normal of the sidewall: radial and axial."""


def _keypoints() -> dict[str, Vec3]:
    """Return the corners of fins, quarters of rims, the nose cone's apex and rim."""
    points = {}
    for k, az in enumerate(FIN_AZIMUTHS_DEG):
        for corner, (r, z) in (("low", FIN_M[1]), ("high", FIN_M[2])):
            half = np.array([r, FIN_THICK_M / 2, z])
            points[f"fin_{k + 1}_{corner}"] = vec3(turn_z(np.deg2rad(az)) @ half)
    for name, az in QUARTERS:
        points[f"trunk_low_{name}"] = polar(TRUNK_RADIUS_M, az, TRUNK_LOW_M)
        if name != "nx":  # under the umbilical's fairing
            points[f"shield_rim_{name}"] = polar(RIM_RADIUS_M, az, RIM_TOP_M)
        points[f"port_{name}"] = polar(PORT_RADIUS_M, az, PORT_M)
    points["nose_apex"] = vec3(nose_point(np.array([0.0, 0.0, DECK_M + NOSE_HEIGHT_M])))
    for name, az in (("px", 0.0), ("py", 90.0), ("ny", 270.0)):
        points[f"nose_rim_{name}"] = vec3(nose_point(np.array(polar(DECK_RADIUS_M, az, DECK_M))))
    points["umbilical_low"] = (CLAW_LOW_M[0], 0.0, CLAW_LOW_M[2] + 0.1)
    return points


def _wireframe() -> list[Edge]:
    """Return the rims of trunk, shield, deck, port and nose cone; outlines of the fins."""
    edges = [
        *rim_edges("trunk_low", TRUNK_LOW_M, TRUNK_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("trunk_inner", TRUNK_LOW_M, TRUNK_INNER_M + 0.002, [(0, -1), (-1, 0)]),
        *rim_edges("trunk_high", TRUNK_HIGH_M, TRUNK_RADIUS_M, [(1, 0), (0, 1)]),
        *rim_edges("shield_rim", RIM_TOP_M, RIM_RADIUS_M, [(1, 0), SLOPE]),
        *rim_edges("deck", DECK_M, DECK_RADIUS_M, [SLOPE, (0, 1)]),
        *rim_edges("port", PORT_M, PORT_RADIUS_M, [(1, 0), (0, 1)], segments=48),
    ]
    rim = rim_edges("nose_rim", DECK_M, DECK_RADIUS_M, [(1, 0), (0, -1)])
    edges += moved_edges(rim, nose_rotation(), nose_point(np.zeros(3)))
    origin, thick = (0, FIN_THICK_M / 2, 0), FIN_THICK_M
    fin = prism_edges("fin", FIN_M, thick, origin_m=origin, u=(1, 0, 0), v=(0, 0, 1), crease_rad=0.0)
    # the root is inside the trunk
    fin = [e for e in fin if not e.name.endswith(("_3", "up_0"))]
    fin = [e if "up" in e.name else replace(e, normals=e.normals[::-1]) for e in fin]
    for k, az in enumerate(FIN_AZIMUTHS_DEG):
        edges += moved_edges(fin, turn_z(np.deg2rad(az)), (0, 0, 0), f"f{k + 1}_")
    return edges


def _occluders() -> list[Mesh]:
    """Return the trunk as a tube, capsule, port, fins, nose cone: inscribed polygons of 12 sides."""
    n = 12
    ro, ri = TRUNK_RADIUS_M, TRUNK_INNER_M
    trunk = [(ri, TRUNK_LOW_M), (ro, TRUNK_LOW_M), (ro, 0.0), (ri, 0.0), (ri, TRUNK_LOW_M)]
    capsule = [
        (0, -0.3),
        (1.3, -0.2),
        (RIM_RADIUS_M, 0.2),
        (RIM_RADIUS_M, RIM_TOP_M),
        (DECK_RADIUS_M, DECK_M),
        (0, DECK_M),
    ]
    port = [(0, DECK_M - 0.05), (PORT_RADIUS_M, DECK_M - 0.05), (PORT_RADIUS_M, PORT_M), (0, PORT_M)]
    r, h = DECK_RADIUS_M, NOSE_HEIGHT_M
    # the cone's hollow counts little: a solid of its outer shape
    nose = revolve([(0, DECK_M), (r, DECK_M), (0.75 * r, DECK_M + 0.62 * h), (0, DECK_M + h)], n)
    nose = nose.rotated(nose_rotation()).moved(nose_point(np.zeros(3)))
    bodies = [revolve(trunk, n), revolve(capsule, n), revolve(port, n), nose, box(CLAW_LOW_M, CLAW_HIGH_M)]
    fin = fin_mesh()
    bodies += [fin.rotated(turn_z(a)) for a in np.deg2rad(FIN_AZIMUTHS_DEG)]
    return bodies


def _lumps() -> list[MassElement]:
    """Return 12.5 t in all (public figure for the launch mass), divided by an estimate.

    The abort propellant sits low in the capsule; the trunk is light.
    """
    nose = np.asarray(nose_cone(Level("low"), closed=False).positions_m).mean(axis=0)
    return [
        Tube("heat shield", 1100.0, (0, 0, 0.05), radius_m=1.95, length_m=0.35),
        Tube("propellant and engines", 2900.0, (0, 0, 0.80), radius_m=1.85, length_m=0.9,
             inner_m=1.3),
        Tube("pressure vessel, crew, cargo", 5600.0, (0.05, 0, 1.45), radius_m=1.45,
             length_m=2.2),
        Tube("forward structure and port", 900.0, (0, 0, 3.35), radius_m=0.95, length_m=1.0),
        MassElement("nose cone", 250.0, vec3(nose), size_m=(1.0, 2.2, 2.2)),
        Tube("trunk", 1550.0, (0, 0, -1.84), radius_m=1.85, length_m=3.62, inner_m=1.75),
        Tube("fins", 200.0, (0, 0, -3.0), radius_m=2.2, length_m=1.4, inner_m=1.85),
    ]  # fmt: skip
