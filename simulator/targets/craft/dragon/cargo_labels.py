"""What labels and estimators know of Cargo Dragon, and its mass."""

from __future__ import annotations

from flyaround.simulator.targets.builders.labels import QUARTERS, named_keypoints, polar, rim_edges, welded
from flyaround.simulator.targets.builders.mass import mass_properties
from flyaround.simulator.targets.builders.mesh import merge
from flyaround.simulator.targets.builders.solids import box
from flyaround.simulator.targets.craft.dragon.cargo_shape import (
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
    SLOPE,
    TRUNK_HIGH_M,
    TRUNK_INNER_M,
    TRUNK_LOW_M,
    TRUNK_RADIUS_M,
    WINGS,
)
from flyaround.simulator.targets.craft.parts import revolve
from flyaround.simulator.targets.craft.round_mass import Tube
from flyaround.simulator.targets.model import Edge, Keypoint, MassProperties, Occluders


def build_keypoints() -> tuple[Keypoint, ...]:
    """Corners of the wings; quarters of the rims of trunk, shield and port."""
    points = WINGS.corners()
    for name, az in QUARTERS:
        points[f"trunk_low_{name}"] = polar(TRUNK_RADIUS_M, az, TRUNK_LOW_M)
        if name != "ny":  # under the umbilical's fairing
            points[f"shield_rim_{name}"] = polar(RIM_RADIUS_M, az, RIM_TOP_M)
        points[f"port_{name}"] = polar(PORT_RADIUS_M, az, PORT_M)
    return named_keypoints(points)


def build_wireframe() -> tuple[Edge, ...]:
    """Rims of trunk, shield, deck and port; outlines of the wings' panels."""
    shoulder = (SHOULDER_HIGH_M - DECK_M, DECK_RADIUS_M - SHOULDER_RADIUS_M)
    edges = [
        *rim_edges("trunk_low", TRUNK_LOW_M, TRUNK_RADIUS_M, [(1, 0), (0, -1)]),
        *rim_edges("trunk_inner", TRUNK_LOW_M, TRUNK_INNER_M + 0.002, [(0, -1), (-1, 0)]),
        *rim_edges("trunk_high", TRUNK_HIGH_M, TRUNK_RADIUS_M, [(1, 0), (0, 1)]),
        *rim_edges("shield_rim", RIM_TOP_M, RIM_RADIUS_M, [(1, 0), SLOPE]),
        *rim_edges("deck", DECK_M, DECK_RADIUS_M, [SLOPE, shoulder]),
        *rim_edges("port", PORT_M, PORT_RADIUS_M, [(1, 0), (0, 1)]),
    ]
    return tuple(edges + WINGS.edges())


def build_occluders() -> Occluders:
    """Trunk as a tube, capsule with port, panels: inscribed polygons of 12 sides."""
    n, ro, ri = 12, TRUNK_RADIUS_M, TRUNK_INNER_M
    trunk = [(ri, TRUNK_LOW_M), (ro, TRUNK_LOW_M), (ro, -0.03), (ri, -0.03), (ri, TRUNK_LOW_M)]
    capsule = [
        (0, -0.30), (1.2, -0.20), (RIM_RADIUS_M, 0.18), (RIM_RADIUS_M, RIM_TOP_M), (DECK_RADIUS_M, DECK_M),
        (PORT_RADIUS_M - 0.06, DECK_M), (PORT_RADIUS_M - 0.06, PORT_M), (0, PORT_M),
    ]  # fmt: skip
    return welded(
        merge([revolve(trunk, n), revolve(capsule, n), box(CLAW_LOW_M, CLAW_HIGH_M), WINGS.panel_bodies()])
    )


def build_mass() -> MassProperties:
    """8.4 t: 4.2 t dry (SpaceX), 1.3 t of propellant and 2.9 t of cargo; the split is an estimate."""
    lumps = (
        Tube(name="heat shield", mass_kg=750.0, centre_m=(0, 0, 0.02), radius_m=1.78, length_m=0.35),
        Tube(
            name="propellant", mass_kg=1290.0, centre_m=(0, 0, 0.75), radius_m=1.65, length_m=0.8, inner_m=1.3
        ),
        Tube(
            name="pressure vessel",
            mass_kg=1900.0,
            centre_m=(0, 0, 1.5),
            radius_m=1.5,
            length_m=2.4,
            inner_m=1.2,
        ),
        Tube(name="pressurised cargo", mass_kg=2400.0, centre_m=(0, 0, 1.4), radius_m=1.15, length_m=1.9),
        Tube(
            name="berthing port",
            mass_kg=340.0,
            centre_m=(0, 0, 3.05),
            radius_m=1.0,
            length_m=0.5,
            inner_m=0.6,
        ),
        Tube(name="trunk", mass_kg=900.0, centre_m=(0, 0, -1.4), radius_m=1.83, length_m=2.77, inner_m=1.74),
        Tube(name="cargo in the trunk", mass_kg=500.0, centre_m=(0, 0, -0.9), radius_m=0.9, length_m=0.9),
        *WINGS.lumps(160.0),
    )
    return mass_properties(lumps)
