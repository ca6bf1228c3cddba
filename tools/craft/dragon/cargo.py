"""Cargo Dragon (2010 to 2020) on orbit: nose cap gone, wings out, sensor bay open."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.model import Detail, Edge, Target
from tools.craft.assemble import assemble
from tools.craft.dragon.cargo_body import build_body
from tools.craft.dragon.cargo_shape import (
    BAY_AZIMUTH_DEG,
    BAY_Z_M,
    CLAW_HIGH_M,
    CLAW_LOW_M,
    DECK_M,
    DECK_RADIUS_M,
    PORT_M,
    PORT_RADIUS_M,
    RIM_RADIUS_M,
    RIM_TOP_M,
    SHOULDER_HIGH_M,
    SHOULDER_RADIUS_M,
    SIDEWALL,
    SLOPE,
    TRUNK_HIGH_M,
    TRUNK_INNER_M,
    TRUNK_LOW_M,
    TRUNK_RADIUS_M,
    WINGS,
)
from tools.craft.hardware import revolve
from tools.craft.labels import QUARTERS, polar, rim_edges
from tools.craft.level import Level
from tools.craft.mass import MassElement, Tube
from tools.craft.shapes.mesh import Mesh
from tools.craft.shapes.solids import box

NOTES = (
    "z towards the berthing port, origin where capsule and trunk meet, x along the wings, cells towards +y. "
    "Height 7.2 m with nose cap (6.1 m on orbit), diameter 3.7 m, span 16.5 m: press kit of CRS-6; "
    "port: Common Berthing Mechanism. "
    "Sizes of fittings are judged on photographs; the mass distribution is an estimate."
)


def build_dragon_cargo(detail: Detail = "full") -> Target:
    """Return Cargo Dragon at a level of detail; labels are the same at all."""
    level = Level(detail)
    bay = np.deg2rad(BAY_AZIMUTH_DEG)
    out = SIDEWALL.normal(bay, BAY_Z_M)
    return assemble(
        "dragon-cargo",
        "Cargo Dragon (2010 to 2020) with solar wings",
        pieces=[*build_body(level), *WINGS.pieces(level)],
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "docking": ((0.0, 0.0, PORT_M), (0.0, 0.0, 1.0)),
            "grasp": (vec3(SIDEWALL.point(bay, BAY_Z_M) + 0.33 * out), vec3(out)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )


def _keypoints() -> dict[str, Vec3]:
    """Return the corners of the wings; quarters of the rims of trunk, shield and port."""
    points = WINGS.corners()
    for name, az in QUARTERS:
        points[f"trunk_low_{name}"] = polar(TRUNK_RADIUS_M, az, TRUNK_LOW_M)
        if name != "ny":  # under the umbilical's fairing
            points[f"shield_rim_{name}"] = polar(RIM_RADIUS_M, az, RIM_TOP_M)
        points[f"port_{name}"] = polar(PORT_RADIUS_M, az, PORT_M)
    return points


def _wireframe() -> list[Edge]:
    """Return the rims of trunk, shield, deck and port; outlines of the wings' panels."""
    shoulder = (SHOULDER_HIGH_M - DECK_M, DECK_RADIUS_M - SHOULDER_RADIUS_M)
    edges = [
        *rim_edges("trunk_low", TRUNK_LOW_M, TRUNK_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("trunk_inner", TRUNK_LOW_M, TRUNK_INNER_M + 0.002, [(0, -1), (-1, 0)]),
        *rim_edges("trunk_high", TRUNK_HIGH_M, TRUNK_RADIUS_M, [(1, 0), (0, 1)]),
        *rim_edges("shield_rim", RIM_TOP_M, RIM_RADIUS_M, [(1, 0), SLOPE]),
        *rim_edges("deck", DECK_M, DECK_RADIUS_M, [SLOPE, shoulder]),
        *rim_edges("port", PORT_M, PORT_RADIUS_M, [(1, 0), (0, 1)]),
    ]
    return edges + WINGS.edges()


def _occluders() -> list[Mesh]:
    """Return the trunk as a tube, capsule with port, panels: inscribed polygons of 12 sides."""
    n, ro, ri = 12, TRUNK_RADIUS_M, TRUNK_INNER_M
    trunk = [(ri, TRUNK_LOW_M), (ro, TRUNK_LOW_M), (ro, -0.03), (ri, -0.03), (ri, TRUNK_LOW_M)]
    capsule = [
        (0, -0.30), (1.2, -0.20), (RIM_RADIUS_M, 0.18), (RIM_RADIUS_M, RIM_TOP_M), (DECK_RADIUS_M, DECK_M),
        (PORT_RADIUS_M - 0.06, DECK_M), (PORT_RADIUS_M - 0.06, PORT_M), (0, PORT_M),
    ]  # fmt: skip
    return [revolve(trunk, n), revolve(capsule, n), box(CLAW_LOW_M, CLAW_HIGH_M), WINGS.panel_bodies()]


def _lumps() -> list[MassElement]:
    """Return 8.4 t: 4.2 t dry (SpaceX), 1.3 t of propellant and 2.9 t of cargo; the split is an estimate."""
    return [
        Tube("heat shield", 750.0, (0, 0, 0.02), radius_m=1.78, length_m=0.35),
        Tube("propellant", 1290.0, (0, 0, 0.75), radius_m=1.65, length_m=0.8, inner_m=1.3),
        Tube("pressure vessel", 1900.0, (0, 0, 1.5), radius_m=1.5, length_m=2.4, inner_m=1.2),
        Tube("pressurised cargo", 2400.0, (0, 0, 1.4), radius_m=1.15, length_m=1.9),
        Tube("berthing port", 340.0, (0, 0, 3.05), radius_m=1.0, length_m=0.5, inner_m=0.6),
        Tube("trunk", 900.0, (0, 0, -1.4), radius_m=1.83, length_m=2.77, inner_m=1.74),
        Tube("cargo in the trunk", 500.0, (0, 0, -0.9), radius_m=0.9, length_m=0.9),
        *WINGS.lumps(160.0),
    ]
