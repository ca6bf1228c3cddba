"""What labels and estimators know of Tianzhou, and its mass."""

from __future__ import annotations

from flyaround.simulator.targets.builders.labels import QUARTERS, named_keypoints, polar, rim_edges, welded
from flyaround.simulator.targets.builders.mass import mass_properties
from flyaround.simulator.targets.builders.mesh import merge
from flyaround.simulator.targets.craft.parts import revolve
from flyaround.simulator.targets.craft.round_mass import Tube
from flyaround.simulator.targets.craft.tianzhou.shape import (
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
from flyaround.simulator.targets.model import Edge, Keypoint, MassProperties, Occluders


def build_keypoints() -> tuple[Keypoint, ...]:
    """Corners of the wings, quarters of the rims of cargo module, propulsion module and port."""
    points = WINGS.corners()
    for name, az in QUARTERS:
        points[f"cargo_high_{name}"] = polar(CARGO_RADIUS_M, az, CARGO_HIGH_M)
        points[f"drive_low_{name}"] = polar(DRIVE_RADIUS_M, az, DRIVE_LOW_M - 0.004)
        points[f"port_{name}"] = polar(PORT_RADIUS_M, az, PORT_M)
    return named_keypoints(points)


def build_wireframe() -> tuple[Edge, ...]:
    """Rims of both modules, the cone and the port; outlines of the wings' panels."""
    cone = (CONE_HIGH_M - CARGO_HIGH_M, CARGO_RADIUS_M - CONE_RADIUS_M)
    aft = (CARGO_LOW_M - DRIVE_HIGH_M, DRIVE_RADIUS_M - NECK_RADIUS_M)
    edges = [
        *rim_edges("cargo_high", CARGO_HIGH_M, CARGO_RADIUS_M, [(1, 0), cone]),
        *rim_edges("cargo_low", CARGO_LOW_M, CARGO_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("drive_high", DRIVE_HIGH_M - 0.004, DRIVE_RADIUS_M, [(1, 0), aft]),
        *rim_edges("drive_low", DRIVE_LOW_M - 0.004, DRIVE_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("port", PORT_M, PORT_RADIUS_M, [(1, 0), (0, 1)], segments=48),
    ]
    return tuple(edges + WINGS.edges())


def build_occluders() -> Occluders:
    """Both modules and the port as one body of 16 sides, and the wings' panels."""
    profile = [
        (0, DRIVE_LOW_M), (DRIVE_RADIUS_M, DRIVE_LOW_M), (DRIVE_RADIUS_M, DRIVE_HIGH_M),
        (CARGO_RADIUS_M, CARGO_LOW_M), (CARGO_RADIUS_M, CARGO_HIGH_M), (CONE_RADIUS_M, CONE_HIGH_M),
        (0.66, CONE_HIGH_M + 0.14), (PORT_RADIUS_M, PORT_M), (0, PORT_M),
    ]  # fmt: skip
    return welded(merge([revolve(profile, 16), WINGS.panel_bodies()]))


def build_mass() -> MassProperties:
    """13.5 t at launch (public figure), 6.5 t of it cargo and fuel to give away; the split is estimated."""
    lumps = (
        Tube(
            name="cargo module, shell",
            mass_kg=2600.0,
            centre_m=(0, 0, 2.6),
            radius_m=1.66,
            length_m=5.2,
            inner_m=1.5,
        ),
        Tube(name="cargo", mass_kg=5500.0, centre_m=(0, 0, 2.6), radius_m=1.4, length_m=4.6, inner_m=0.5),
        Tube(
            name="docking end and port",
            mass_kg=620.0,
            centre_m=(0, 0, 6.05),
            radius_m=0.9,
            length_m=1.4,
            inner_m=0.5,
        ),
        Tube(
            name="propulsion module, dry",
            mass_kg=2200.0,
            centre_m=(0, 0, -1.8),
            radius_m=1.38,
            length_m=3.2,
            inner_m=0.6,
        ),
        Tube(name="propellant", mass_kg=2200.0, centre_m=(0, 0, -1.7), radius_m=1.1, length_m=1.4),
        *WINGS.lumps(190.0),
    )
    return mass_properties(lumps)
