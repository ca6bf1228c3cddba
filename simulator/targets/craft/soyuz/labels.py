"""What labels and estimators know of Soyuz, and its mass."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.builders.labels import QUARTERS, named_keypoints, polar, rim_edges, welded
from flyaround.simulator.targets.builders.mass import mass_properties
from flyaround.simulator.targets.builders.mesh import merge
from flyaround.simulator.targets.craft.parts import revolve
from flyaround.simulator.targets.craft.round_mass import Tube
from flyaround.simulator.targets.craft.soyuz.fittings import MAST_TIP_M
from flyaround.simulator.targets.craft.soyuz.shape import (
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
from flyaround.simulator.targets.model import Edge, Keypoint, MassProperties, Occluders


def build_keypoints() -> tuple[Keypoint, ...]:
    """Corners of the wings, quarters of rims, the probe's tip, the mast's end."""
    points = WINGS.corners()
    for name, az in QUARTERS:
        points[f"skirt_low_{name}"] = polar(SKIRT_RADIUS_M, az, SKIRT_LOW_M)
        points[f"collar_{name}"] = polar(COLLAR_RADIUS_M, az, COLLAR_M)
    points["probe_tip"] = (0.0, 0.0, PROBE_TIP_M)
    points["mast_tip"] = (MAST_TIP_M[0], -2.02, -2.42)
    return named_keypoints(points)


def build_wireframe() -> tuple[Edge, ...]:
    """Outlines of the wings' panels; rims of skirt, drum and docking collar."""
    out = np.array([DRUM_LOW_M - SKIRT_EDGE_M, SKIRT_RADIUS_M - DRUM_RADIUS_M])
    flare = (float(out[0]), float(out[1]))
    edges = [
        *rim_edges("skirt_low", SKIRT_LOW_M, SKIRT_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("skirt_edge", SKIRT_EDGE_M, SKIRT_RADIUS_M, [(1, 0), flare]),
        *rim_edges("drum_high", DRUM_HIGH_M, DRUM_RADIUS_M, [(1, 0), (0.7, 0.7)]),
        *rim_edges("collar", COLLAR_M, COLLAR_RADIUS_M, [(1, 0), (0, 1)], segments=48),
    ]
    return tuple(edges + WINGS.edges())


def build_occluders() -> Occluders:
    """The modules as one body of ten sides, the skirt's hollow taken as full, and the wings' panels."""
    r, z = ORBITAL_RADIUS_M, (ORBITAL_LOW_M, ORBITAL_HIGH_M)
    profile = [
        (0, SKIRT_LOW_M + 0.02), (SKIRT_RADIUS_M, SKIRT_LOW_M + 0.02), (SKIRT_RADIUS_M, SKIRT_EDGE_M),
        (DRUM_RADIUS_M, DRUM_LOW_M), (DRUM_RADIUS_M, 0.0), DESCENT_PROFILE[3], (0.60, 1.80),
        (0.70 * r, z[0] - 0.71 * r), (r, z[0]), (r, z[1]), (0.68 * r, z[1] + 0.73 * r),
        (COLLAR_RADIUS_M - 0.06, COLLAR_M), (0, COLLAR_M),
    ]  # fmt: skip
    return welded(merge([revolve(profile, 10), WINGS.panel_bodies()]))


def build_mass() -> MassProperties:
    """7,080 kg (public figure), shared over the modules as Hall & Shayler (2003) give them.

    Orbital module 1,300 kg, descent module 2,900 kg, service module with propellant 2,600 kg, the rest wings.
    """
    lumps = (
        Tube(
            name="orbital module",
            mass_kg=1350.0,
            centre_m=(0, 0, 3.20),
            radius_m=1.12,
            length_m=2.2,
            inner_m=0.8,
        ),
        Tube(name="docking unit", mass_kg=220.0, centre_m=(0, 0, 4.40), radius_m=0.6, length_m=0.4),
        Tube(name="descent module", mass_kg=2900.0, centre_m=(0, 0, 0.75), radius_m=1.0, length_m=1.7),
        Tube(
            name="service module, dry",
            mass_kg=1500.0,
            centre_m=(0, 0, -1.30),
            radius_m=1.15,
            length_m=2.0,
            inner_m=0.7,
        ),
        Tube(name="propellant and engine", mass_kg=890.0, centre_m=(0, 0, -1.90), radius_m=0.9, length_m=0.7),
        *WINGS.lumps(110.0),
    )
    return mass_properties(lumps)
