"""Cargo Dragon's capsule with its berthing port, and its trunk."""

from __future__ import annotations

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.dragon.cargo_shape import (
    BAY_AZIMUTH_DEG,
    BAY_Z_M,
    CLAW_HIGH_M,
    CLAW_LOW_M,
    DECK_M,
    HATCH_HALF_M,
    PORT_M,
    PORT_RADIUS_M,
    RIM_RADIUS_M,
    RIM_TOP_M,
    SHOULDER_HIGH_M,
    SHOULDER_RADIUS_M,
    SIDEWALL,
    TRUNK,
    TRUNK_HIGH_M,
    TRUNK_INNER_M,
    TRUNK_LOW_M,
    TRUNK_RADIUS_M,
    WINGS,
)
from tools.craft.hardware import bell, hoop, open_tube, revolve, seams, window
from tools.craft.labels import RIM_SEGMENTS, polar
from tools.craft.level import Level
from tools.craft.place import turn_z
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.prism import prism
from tools.craft.shapes.solids import bar, box, cone, rod
from tools.craft.shapes.wrapped import pad, sector

QUAD_AZIMUTHS_DEG = (42.0, 138.0, 222.0, 318.0)


def build_body(level: Level) -> list[Piece]:
    """Return everything but the wings."""
    pieces = [*_capsule(level), *_port(level), *_trunk(level)]
    return [*pieces, *(_fittings(level) if level.fittings else [])]


def _capsule(level: Level) -> list[Piece]:
    n = level.segments(RIM_SEGMENTS)
    shield = [
        (0, -0.40), (0.6, -0.37), (1.2, -0.25), (1.60, -0.06), (1.74, 0.0), (1.80, 0.06), (RIM_RADIUS_M, 0.17),
        (RIM_RADIUS_M, RIM_TOP_M), (0, RIM_TOP_M),
    ]  # fmt: skip
    rows = np.linspace(RIM_TOP_M, DECK_M, 6 if level.fine else 2)
    wall = [
        (0, RIM_TOP_M - 0.02),
        (RIM_RADIUS_M - 0.012, RIM_TOP_M - 0.02),
        (RIM_RADIUS_M - 0.012, RIM_TOP_M),
    ]
    wall += [(float(r), float(z)) for r, z in zip(SIDEWALL.radius(rows), rows, strict=True)]
    wall += [(SHOULDER_RADIUS_M, SHOULDER_HIGH_M), (0, SHOULDER_HIGH_M)]
    return [
        Piece("heat_shield", "burnt-ablator", revolve(shield, n)),
        Piece("capsule_sidewall", "white-paint", revolve(wall, n)),
    ]


def _port(level: Level) -> list[Piece]:
    """Return the passive berthing ring round a square hatch."""
    n = level.segments(RIM_SEGMENTS)
    r, z = PORT_RADIUS_M, PORT_M
    neck = [(0.86, DECK_M), (r - 0.06, DECK_M), (r - 0.06, z - 0.10), (0.86, z - 0.10), (0.86, DECK_M)]
    ring = [(0.88, z - 0.11), (r, z - 0.11), (r, z), (0.88, z), (0.88, z - 0.11)]
    floor = [(0, DECK_M + 0.2), (0.875, DECK_M + 0.2), (0.875, DECK_M + 0.3), (0, DECK_M + 0.3)]
    h = HATCH_HALF_M
    pieces = [
        Piece("port_neck", "white-paint", revolve(neck, n)),
        Piece("berthing_ring", "machined-aluminium", revolve(ring, n)),
        Piece("port_bulkhead", "grey-paint", revolve(floor, n)),
        Piece("port_hatch", "white-paint", box((-h, -h, DECK_M + 0.28), (h, h, DECK_M + 0.36), 0.02)),
    ]
    if not level.fittings:
        return pieces
    guides, bolts = [], []
    for k in range(4):
        plate = prism(
            [(-0.13, 0.0), (0.13, 0.0), (0.07, 0.13), (-0.07, 0.13)], 0.03, u=(0, 1, 0), v=(0.25, 0, 0.968)
        )
        guides.append(plate.moved((r - 0.10, 0, z - 0.02)).rotated(turn_z(np.deg2rad(45.0 + 90.0 * k))))
    for k in range(16):
        az = 22.5 * k + 11.25
        bolts.append(rod(polar(0.95, az, z - 0.05), polar(0.95, az, z + 0.012), 0.028, level.segments(12)))
    pane = rod((0, 0, DECK_M + 0.34), (0, 0, DECK_M + 0.372), 0.11, level.segments(36))
    return [
        *pieces,
        Piece("berthing_guides", "brushed-metal", merge(guides)),
        Piece("berthing_bolts", "brushed-metal", merge(bolts)),
        Piece("port_window", "window", pane),
    ]


def _trunk(level: Level) -> list[Piece]:
    n = level.segments(RIM_SEGMENTS)
    ri, ro, lo, hi = TRUNK_INNER_M, TRUNK_RADIUS_M, TRUNK_LOW_M, TRUNK_HIGH_M
    drives = [
        cone((s * (ro - 0.04), 0, WINGS.z_m), (s * (ro + 0.14), 0, WINGS.z_m), 0.16, 0.13, level.segments(24))
        for s in (1, -1)
    ]
    return [
        Piece("trunk_tube", "white-paint", open_tube(ri + 0.002, ro, lo, hi, n)),
        Piece("trunk_liner", "dark-interior", open_tube(ri - 0.02, ri + 0.004, lo + 0.02, hi, n)),
        Piece("wing_drives", "grey-paint", merge(drives)),
    ]


def _fittings(level: Level) -> list[Piece]:
    """Return the thruster quads, hatch, sensor bay with grapple fixture, radiators, cradle beams in the trunk,
    seams.
    """
    return [*_thrusters(level), *_side(level), *_trunk_skin(level)]


def _thrusters(level: Level) -> list[Piece]:
    n = level.segments(24)
    small, pods = [], []
    for az in np.deg2rad(QUAD_AZIMUTHS_DEG):
        pods.append(
            pad(SIDEWALL, az, 0.72, (0.34, 0.32), lift_m=0.035, exponent=4.0, segments=level.segments(36))
        )
        tangent = np.array([-np.sin(az), np.cos(az), 0.0])
        for side in (-1.0, 1.0):
            for z in (0.60, 0.86):
                position = SIDEWALL.point(az + side * 0.085, z, 0.0)
                out = SIDEWALL.normal(az, z) + 0.45 * side * tangent
                small.append(bell(position, out, 0.10, 0.03, 0.065, n))
    return [
        Piece("thruster_pods", "white-seam", merge(pods)),
        Piece("draco_thrusters", "nozzle-alloy", merge(small)),
    ]


def _side(level: Level) -> list[Piece]:
    """Return the side hatch, sensor bay, portholes, tile seams."""
    n = level.segments(36)
    bay = np.deg2rad(BAY_AZIMUTH_DEG)
    recess = pad(SIDEWALL, bay, BAY_Z_M, (0.44, 0.34), lift_m=0.006, exponent=6.0, segments=n, rings=4)
    out, position = SIDEWALL.normal(bay, BAY_Z_M), SIDEWALL.point(bay, BAY_Z_M)
    plate = rod(position - 0.02 * out, position + 0.05 * out, 0.20, n)
    shaft = rod(position + 0.04 * out, position + 0.30 * out, 0.022, level.segments(24))
    knob = rod(position + 0.29 * out, position + 0.33 * out, 0.04, level.segments(24))
    lenses = [
        rod(p - 0.02 * out, p + 0.06 * out, 0.05, n)
        for p in np.add(position, [(0.32, 0, 0.10), (-0.32, 0, 0.10)])
    ]
    # the open door protrudes next to the bay
    side = position + np.array([-0.48, 0.02, 0.0])
    door = bar(side, side + 0.62 * out + (-0.22, 0, 0), 0.60, 0.04, (1, 0, 0))
    hatch = pad(SIDEWALL, -bay, 1.30, (0.45, 0.55), lift_m=0.010, exponent=4.0, segments=2 * n, rings=6)
    seal = pad(SIDEWALL, -bay, 1.30, (0.475, 0.575), lift_m=0.005, exponent=4.0, segments=2 * n, rings=6)
    pieces = [
        Piece("sensor_bay", "dark-interior", recess),
        Piece("bay_door", "white-paint", door),
        Piece("grapple_fixture", "machined-aluminium", merge([plate, shaft, knob])),
        Piece("sensor_lenses", "window", merge(lenses)),
        Piece("hatch", "white-paint", hatch),
        Piece("hatch_seal", "white-seam", seal),
    ]
    for az in (-62.0, -118.0):
        pieces += window("porthole", SIDEWALL, az, 1.62, (0.13, 0.13), level, frame_m=0.05)
    if level.fine:
        lines = [
            seams(
                SIDEWALL,
                [15.0 + 30.0 * k for k in range(12)],
                [RIM_TOP_M + 0.02, DECK_M - 0.02],
                0.014,
                0.0025,
            )
        ]
        lines += [hoop(SIDEWALL, z, 0.014, 0.0035, RIM_SEGMENTS) for z in (0.40, 1.08, 1.95)]
        pieces.append(Piece("tile_seams", "white-seam", merge(lines)))
        pieces.append(
            Piece("forward_ring", "grey-paint", hoop(SIDEWALL, DECK_M - 0.05, 0.06, 0.006, RIM_SEGMENTS))
        )
    return pieces


def _trunk_skin(level: Level) -> list[Piece]:
    """Return the radiators on both sides between the wings, hinge brackets of the fairings, beams inside."""
    heights, columns = [-2.62, -0.25], level.segments(12) // 2
    starts = (*range(30, 150, 20), *range(210, 330, 20))
    edges = [(float(np.deg2rad(a + 0.4)), float(np.deg2rad(a + 20.0 - 0.4))) for a in starts]
    panels = [sector(TRUNK, ends, heights, 0.010, 0.01, columns) for ends in edges]
    brackets = [
        box((-0.03, -0.07, -0.10), (0.06, 0.07, 0.10), 0.01)
        .moved((TRUNK_RADIUS_M, 0, z))
        .rotated(turn_z(np.deg2rad(a)))
        for a in (25.0, 155.0, 205.0, 335.0)
        for z in (-0.45, -2.45)
    ]
    beams = [bar((-1.77, y, -0.75), (1.77, y * 0.99, -0.76), 0.09, 0.12, (0, 0, 1)) for y in (-0.25, 0.25)]
    claw = box(CLAW_LOW_M, CLAW_HIGH_M, 0.03)
    return [
        Piece("radiators", "radiator", merge(panels)),
        Piece("fairing_brackets", "brushed-metal", merge(brackets)),
        Piece("cargo_beams", "brushed-metal", merge(beams)),
        Piece("umbilical_fairing", "white-paint", claw),
        Piece(
            "trunk_ring",
            "grey-paint",
            hoop(TRUNK, TRUNK_LOW_M + 0.06, 0.06, 0.006, level.segments(RIM_SEGMENTS)),
        ),
    ]
