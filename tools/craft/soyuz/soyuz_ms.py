"""Soyuz MS with its wings out and the probe ready to dock."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.targets.model import Detail, Edge, Target
from tools.craft.assemble import assemble
from tools.craft.hardware import revolve
from tools.craft.labels import QUARTERS, polar, rim_edges
from tools.craft.level import Level
from tools.craft.mass import MassElement, Tube
from tools.craft.shapes.mesh import Mesh
from tools.craft.soyuz.fittings import MAST_TIP_M, build_fittings
from tools.craft.soyuz.modules import build_modules
from tools.craft.soyuz.shape import (
    COLLAR_M,
    COLLAR_RADIUS_M,
    DESCENT_PROFILE,
    DRUM_HIGH_M,
    DRUM_LOW_M,
    DRUM_RADIUS_M,
    ORBITAL_HIGH_M,
    ORBITAL_LOW_M,
    ORBITAL_RADIUS_M,
    PROBE_TIP_M,
    SKIRT_EDGE_M,
    SKIRT_LOW_M,
    SKIRT_RADIUS_M,
    WINGS,
)

NOTES = (
    "z towards the docking probe, origin where descent and service module meet, x along the wings, cells towards +y. "
    "Length 7.48 m, greatest diameter 2.72 m, span 10.7 m: public figures; lengths and masses "
    "of modules: Hall & Shayler (2003). "
    "Sizes of fittings are judged on photographs; the mass distribution is an estimate."
)


def build_soyuz_ms(detail: Detail = "full") -> Target:
    """Return Soyuz MS at a level of detail; labels are the same at all."""
    level = Level(detail)
    return assemble(
        "soyuz-ms",
        "Soyuz MS",
        pieces=[*build_modules(level), *build_fittings(level)],
        keypoints=_keypoints(),
        wireframe=_wireframe(),
        occluders=_occluders(),
        lumps=_lumps(),
        frames={
            "docking": ((0.0, 0.0, COLLAR_M), (0.0, 0.0, 1.0)),
            "grasp": ((0.0, 0.0, SKIRT_LOW_M), (0.0, 0.0, -1.0)),
        },
        symmetry=((0.0, 0.0, 0.0, 1.0),),
        notes=NOTES,
    )


def _keypoints() -> dict[str, Vec3]:
    """Return the corners of the wings, quarters of rims, the probe's tip, the mast's end."""
    points = WINGS.corners()
    for name, az in QUARTERS:
        points[f"skirt_low_{name}"] = polar(SKIRT_RADIUS_M, az, SKIRT_LOW_M)
        points[f"collar_{name}"] = polar(COLLAR_RADIUS_M, az, COLLAR_M)
    points["probe_tip"] = (0.0, 0.0, PROBE_TIP_M)
    points["mast_tip"] = (MAST_TIP_M[0], -2.02, -2.42)
    return points


def _wireframe() -> list[Edge]:
    """Return the outlines of the wings' panels; rims of skirt, drum and docking collar."""
    out = np.array([DRUM_LOW_M - SKIRT_EDGE_M, SKIRT_RADIUS_M - DRUM_RADIUS_M])
    flare = (float(out[0]), float(out[1]))
    edges = [
        *rim_edges("skirt_low", SKIRT_LOW_M, SKIRT_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("skirt_edge", SKIRT_EDGE_M, SKIRT_RADIUS_M, [(1, 0), flare]),
        *rim_edges("drum_high", DRUM_HIGH_M, DRUM_RADIUS_M, [(1, 0), (0.7, 0.7)]),
        *rim_edges("collar", COLLAR_M, COLLAR_RADIUS_M, [(1, 0), (0, 1)], segments=48),
    ]
    return edges + WINGS.edges()


def _occluders() -> list[Mesh]:
    """Return the modules as one body of ten sides, the skirt's hollow taken as full, and the wings' panels."""
    r, z = ORBITAL_RADIUS_M, (ORBITAL_LOW_M, ORBITAL_HIGH_M)
    profile = [
        (0, SKIRT_LOW_M + 0.02), (SKIRT_RADIUS_M, SKIRT_LOW_M + 0.02), (SKIRT_RADIUS_M, SKIRT_EDGE_M),
        (DRUM_RADIUS_M, DRUM_LOW_M), (DRUM_RADIUS_M, 0.0), DESCENT_PROFILE[3], (0.60, 1.80),
        (0.70 * r, z[0] - 0.71 * r), (r, z[0]), (r, z[1]), (0.68 * r, z[1] + 0.73 * r),
        (COLLAR_RADIUS_M - 0.06, COLLAR_M), (0, COLLAR_M),
    ]  # fmt: skip
    return [revolve(profile, 10), WINGS.panel_bodies()]


def _lumps() -> list[MassElement]:
    """7,080 kg (public figure), shared over the modules as Hall & Shayler (2003) give them.

    Orbital module 1,300 kg, descent module 2,900 kg, service module with propellant 2,600 kg, the rest wings.
    """
    return [
        Tube("orbital module", 1350.0, (0, 0, 3.20), radius_m=1.12, length_m=2.2, inner_m=0.8),
        Tube("docking unit", 220.0, (0, 0, 4.40), radius_m=0.6, length_m=0.4),
        Tube("descent module", 2900.0, (0, 0, 0.75), radius_m=1.0, length_m=1.7),
        Tube("service module, dry", 1500.0, (0, 0, -1.30), radius_m=1.15, length_m=2.0, inner_m=0.7),
        Tube("propellant and engine", 890.0, (0, 0, -1.90), radius_m=0.9, length_m=0.7),
        *WINGS.lumps(110.0),
    ]
