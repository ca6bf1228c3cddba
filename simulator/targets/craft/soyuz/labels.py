"""What labels and estimators know of Soyuz, and its mass."""

from __future__ import annotations

import numpy as np

from simulator.arrays import vec3
from simulator.targets.builders.mesh import merge
from simulator.targets.builders.solids import box
from simulator.targets.builders.wing import wing_panels
from simulator.targets.craft.labels import box_edges, moved_edges, polar, rim_edges, welded
from simulator.targets.craft.parts import revolve
from simulator.targets.craft.round_mass import Tube
from simulator.targets.craft.soyuz.fittings import MAST_TIP_M, place_wing
from simulator.targets.craft.soyuz.shape import (
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
    WING,
    WING_AXES,
    WING_Z_M,
)
from simulator.targets.mass import Lump, mass_properties
from simulator.targets.model import Edge, Keypoint, MassProperties, Occluders

MIRROR_X = np.diag([-1.0, 1.0, 1.0])


def build_keypoints() -> tuple[Keypoint, ...]:
    """Corners of the wings, quarters of rims, the probe's tip, the mast's end."""
    points = {}
    y, (z0, z1) = WING.thickness_m / 2, (WING_Z_M - WING.chord_m / 2, WING_Z_M + WING.chord_m / 2)
    for side, sign in (("px", 1), ("nx", -1)):
        for at, x in (("tip", WING.tip_m), ("root", WING.first_m)):
            for end, z in (("aft", z0), ("fore", z1)):
                points[f"wing_{side}_{at}_{end}"] = (sign * x, y, z)
    for name, az in (("px", 0.0), ("py", 90.0), ("nx", 180.0), ("ny", 270.0)):
        points[f"skirt_low_{name}"] = polar(SKIRT_RADIUS_M, az, SKIRT_LOW_M)
        points[f"collar_{name}"] = polar(COLLAR_RADIUS_M, az, COLLAR_M)
    points["probe_tip"] = (0.0, 0.0, PROBE_TIP_M)
    points["mast_tip"] = (MAST_TIP_M[0], -2.02, -2.42)
    return tuple(Keypoint(name=n, position_m=p) for n, p in points.items())


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
    for k, (lo, hi) in enumerate(WING.boxes()):
        panel = moved_edges(box_edges(f"panel_{k + 1}", lo, hi), WING_AXES, (0, 0, WING_Z_M))
        edges += moved_edges(panel, np.eye(3), (0, 0, 0), "px_")
        edges += moved_edges(panel, MIRROR_X, (0, 0, 0), "nx_")
    return tuple(edges)


def build_occluders() -> Occluders:
    """The modules as one body of twelve sides, and the wings' panels."""
    r, z = ORBITAL_RADIUS_M, (ORBITAL_LOW_M, ORBITAL_HIGH_M)
    profile = [
        (0, SKIRT_LOW_M + 0.02), (SKIRT_RADIUS_M, SKIRT_LOW_M + 0.02), (SKIRT_RADIUS_M, SKIRT_EDGE_M),
        (DRUM_RADIUS_M, DRUM_LOW_M), (DRUM_RADIUS_M, 0.0), DESCENT_PROFILE[3], (0.60, 1.80), (0.70 * r, z[0] - 0.71 * r), (r, z[0]),
        (r, z[1]), (0.68 * r, z[1] + 0.73 * r), (COLLAR_RADIUS_M - 0.06, COLLAR_M), (0, COLLAR_M),
    ]  # fmt: skip
    # twice as thick a skirt as the mesh: its hollow is taken as full
    panels = place_wing(wing_panels(WING))
    return welded(merge([revolve(profile, 10), panels, panels.mirrored(0)]))


def build_mass() -> MassProperties:
    """7,080 kg (RSC Energia), shared over the modules as Hall & Shayler (2003) give them.

    Orbital module 1,300 kg, descent module 2,900 kg, service module with propellant 2,600 kg, the rest wings.
    """
    wing_mass, length = 110.0, WING.tip_m - WING.first_m
    middle = (WING.tip_m + WING.first_m) / 2
    wings = [
        Lump(
            name=f"wing {side}",
            mass_kg=wing_mass,
            centre_m=vec3(np.array([sign * middle, 0.0, WING_Z_M])),
            size_m=(length, WING.thickness_m, WING.chord_m),
        )
        for side, sign in (("+x", 1), ("-x", -1))
    ]
    lumps = (
        Tube(name="orbital module", mass_kg=1350.0, centre_m=(0, 0, 3.20), radius_m=1.12, length_m=2.2, inner_m=0.8),
        Tube(name="docking unit", mass_kg=220.0, centre_m=(0, 0, 4.40), radius_m=0.6, length_m=0.4),
        Tube(name="descent module", mass_kg=2900.0, centre_m=(0, 0, 0.75), radius_m=1.0, length_m=1.7),
        Tube(name="service module, dry", mass_kg=1500.0, centre_m=(0, 0, -1.30), radius_m=1.15, length_m=2.0, inner_m=0.7),
        Tube(name="propellant and engine", mass_kg=890.0, centre_m=(0, 0, -1.90), radius_m=0.9, length_m=0.7),
        *wings,
    )
    return mass_properties(lumps)
