"""Tianzhou with its wings out."""

from __future__ import annotations

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.targets.model import Detail, Edge, Target
from tools.craft.assemble import assemble
from tools.craft.hardware import revolve
from tools.craft.labels import QUARTERS, polar, rim_edges
from tools.craft.level import Level
from tools.craft.mass import MassElement, Tube
from tools.craft.shapes.mesh import Mesh
from tools.craft.tianzhou.fittings import build_fittings
from tools.craft.tianzhou.modules import build_modules
from tools.craft.tianzhou.shape import (
    CARGO_HIGH_M,
    CARGO_LOW_M,
    CARGO_RADIUS_M,
    CONE_HIGH_M,
    CONE_RADIUS_M,
    DRIVE_HIGH_M,
    DRIVE_LOW_M,
    DRIVE_RADIUS_M,
    NECK_RADIUS_M,
    PORT_M,
    PORT_RADIUS_M,
    WINGS,
)

NOTES = (
    "z towards the docking port, origin where propulsion and cargo module meet, x along the wings, cells towards +y. "
    "Length 10.6 m, diameter 3.35 m, propulsion module 2.8 m, span 14.9 m, mass 13.5 t: public figures of Tianzhou-1. "
    "Sizes of fittings are judged on photographs; the mass distribution is an estimate."
)


def build_tianzhou(detail: Detail = "full") -> Target:
    """Return Tianzhou at a level of detail; labels are the same at all."""
    level = Level(detail)
    return assemble(
        "tianzhou",
        "Tianzhou cargo craft",
        pieces=[*build_modules(level), *build_fittings(level)],
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "docking": ((0.0, 0.0, PORT_M), (0.0, 0.0, 1.0)),
            "grasp": ((0.0, 0.0, DRIVE_LOW_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )


def _keypoints() -> dict[str, Vec3]:
    """Return the corners of the wings, quarters of the rims of cargo module, propulsion module and port."""
    points = WINGS.corners()
    for name, az in QUARTERS:
        points[f"cargo_high_{name}"] = polar(CARGO_RADIUS_M, az, CARGO_HIGH_M)
        points[f"drive_low_{name}"] = polar(DRIVE_RADIUS_M, az, DRIVE_LOW_M - 0.004)
        points[f"port_{name}"] = polar(PORT_RADIUS_M, az, PORT_M)
    return points


def _wireframe() -> list[Edge]:
    """Return the rims of both modules, the cone and the port; outlines of the wings' panels."""
    cone = (CONE_HIGH_M - CARGO_HIGH_M, CARGO_RADIUS_M - CONE_RADIUS_M)
    aft = (CARGO_LOW_M - DRIVE_HIGH_M, DRIVE_RADIUS_M - NECK_RADIUS_M)
    edges = [
        *rim_edges("cargo_high", CARGO_HIGH_M, CARGO_RADIUS_M, [(1, 0), cone]),
        *rim_edges("cargo_low", CARGO_LOW_M, CARGO_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("drive_high", DRIVE_HIGH_M - 0.004, DRIVE_RADIUS_M, [(1, 0), aft]),
        *rim_edges("drive_low", DRIVE_LOW_M - 0.004, DRIVE_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("port", PORT_M, PORT_RADIUS_M, [(1, 0), (0, 1)], segments=48),
    ]
    return edges + WINGS.edges()


def _occluders() -> list[Mesh]:
    """Return both modules and the port as one body of 16 sides, and the wings' panels."""
    profile = [
        (0, DRIVE_LOW_M), (DRIVE_RADIUS_M, DRIVE_LOW_M), (DRIVE_RADIUS_M, DRIVE_HIGH_M),
        (CARGO_RADIUS_M, CARGO_LOW_M), (CARGO_RADIUS_M, CARGO_HIGH_M), (CONE_RADIUS_M, CONE_HIGH_M),
        (0.66, CONE_HIGH_M + 0.14), (PORT_RADIUS_M, PORT_M), (0, PORT_M),
    ]  # fmt: skip
    return [revolve(profile, 16), WINGS.panel_bodies()]


def _lumps() -> list[MassElement]:
    """13.5 t at launch (public figure), 6.5 t of it cargo and fuel to give away; the split is estimated."""
    return [
        Tube("cargo module, shell", 2600.0, (0, 0, 2.6), radius_m=1.66, length_m=5.2, inner_m=1.5),
        Tube("cargo", 5500.0, (0, 0, 2.6), radius_m=1.4, length_m=4.6, inner_m=0.5),
        Tube("docking end and port", 620.0, (0, 0, 6.05), radius_m=0.9, length_m=1.4, inner_m=0.5),
        Tube("propulsion module, dry", 2200.0, (0, 0, -1.8), radius_m=1.38, length_m=3.2, inner_m=0.6),
        Tube("propellant", 2200.0, (0, 0, -1.7), radius_m=1.1, length_m=1.4),
        *WINGS.lumps(190.0),
    ]
