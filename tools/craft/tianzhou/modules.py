"""Cargo and propulsion module of Tianzhou with their blankets, rails and engines."""

from __future__ import annotations

import itertools

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.hardware import bell, handrail, hoop, revolve, seams
from tools.craft.labels import RIM_SEGMENTS, polar
from tools.craft.level import Level
from tools.craft.place import turn_z
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import prism
from tools.craft.shapes.solids import box
from tools.craft.shapes.wrapped import pad, sector
from tools.craft.tianzhou.shape import (
    CARGO,
    CARGO_HIGH_M,
    CARGO_LOW_M,
    CARGO_RADIUS_M,
    CONE,
    CONE_HIGH_M,
    CONE_RADIUS_M,
    DRIVE,
    DRIVE_HIGH_M,
    DRIVE_LOW_M,
    DRIVE_RADIUS_M,
    NECK_RADIUS_M,
    NOZZLE_LOW_M,
    PORT_M,
    PORT_RADIUS_M,
)

BLANKET_M = 0.008


def build_modules(level: Level) -> list[Piece]:
    """Return the shells, blankets, port, engines."""
    return [*_shells(level), *_port(level), *_engines(level), *(_skin(level) if level.fittings else [])]


def _shells(level: Level) -> list[Piece]:
    n = level.segments(RIM_SEGMENTS)
    r, lo, hi = CARGO_RADIUS_M, CARGO_LOW_M, CARGO_HIGH_M
    cargo = [(0, lo), (r, lo), (r, hi), (CONE_RADIUS_M, CONE_HIGH_M), (0, CONE_HIGH_M)]
    d, base, top = DRIVE_RADIUS_M, DRIVE_LOW_M, DRIVE_HIGH_M
    drive = [(0, base), (d, base), (d, top), (NECK_RADIUS_M, lo), (0, lo)]
    return [
        Piece("cargo_shell", "white-cloth", revolve(cargo, n)),
        Piece("drive_shell", "white-paint", revolve(drive, n).moved((0, 0, -0.004))),
    ]


def _port(level: Level) -> list[Piece]:
    """Return the androgynous adapter: tunnel, ring, three guide petals turned inwards."""
    n = level.segments(48)
    z = CONE_HIGH_M
    tunnel = [
        (0.56, z - 0.1), (0.74, z - 0.1), (0.74, z + 0.10), (0.63, z + 0.16), (0.63, 6.60), (0.56, 6.60),
        (0.56, z - 0.1),
    ]  # fmt: skip
    ring = [(0.53, 6.58), (PORT_RADIUS_M, 6.58), (PORT_RADIUS_M, PORT_M), (0.53, PORT_M), (0.53, 6.58)]
    hatch = [(0, 6.34), (0.57, 6.34), (0.57, 6.37), (0.30, 6.41), (0, 6.41)]
    pieces = [
        Piece("docking_tunnel", "mli-silver", revolve(tunnel, n)),
        Piece("docking_ring", "machined-aluminium", revolve(ring, n)),
        Piece("docking_hatch", "grey-paint", revolve(hatch, n)),
    ]
    if level.fittings:
        petal = prism(
            [(-0.20, 0.0), (0.20, 0.0), (0.09, 0.24), (-0.09, 0.24)], 0.025, u=(0, 1, 0), v=(-0.42, 0, 0.9075)
        )
        petals = [petal.moved((0.54, 0, 6.62)).rotated(turn_z(np.deg2rad(a))) for a in (30.0, 150.0, 270.0)]
        guide = [(0.50, 6.82), (0.555, 6.82), (0.555, 6.85), (0.50, 6.85), (0.50, 6.82)]
        hooks = [
            box((-0.04, -0.035, -0.06), (0.014, 0.035, 0.03))
            .moved((PORT_RADIUS_M + 0.006, 0, 6.73))
            .rotated(turn_z(a))
            for a in np.deg2rad(15.0 + 30.0 * np.arange(12))
        ]
        pieces += [
            Piece("guide_petals", "brushed-metal", merge(petals)),
            Piece("guide_ring", "brushed-metal", revolve([(r, h - 0.06) for r, h in guide], n)),
            Piece("docking_hooks", "brushed-metal", merge(hooks)),
        ]
    return pieces


def _skin(level: Level) -> list[Piece]:
    """Return the blankets in a grid, radiators on the propulsion module, rings, rails, boxes."""
    n = level.segments(RIM_SEGMENTS)
    rows = np.linspace(CARGO_LOW_M + 0.06, CARGO_HIGH_M - 0.06, 6)
    blankets = _grid(rows, 12, level)
    heights = np.linspace(5.20, 6.16, 3)
    cone = [
        sector(CONE, (a + 0.008, a + np.deg2rad(30) - 0.008), heights, BLANKET_M, 0.01, n // 12)
        for a in np.deg2rad(30.0 * np.arange(12))
    ]
    radiators = [
        sector(DRIVE, (a + 0.01, a + np.deg2rad(22.5) - 0.01), heights, 0.008, 0.01, 6)
        for a in np.deg2rad(22.5 * np.arange(16))
        for heights in ([-3.28, -2.02], [-1.90, -0.56])
    ]
    pieces = [
        Piece("cargo_blankets", "white-cloth", merge(blankets)),
        Piece("cone_blankets", "white-cloth", merge(cone)),
        Piece("radiators", "radiator", merge(radiators)),
        Piece("forward_ring", "grey-paint", hoop(CARGO, CARGO_HIGH_M - 0.03, 0.05, 0.006, n)),
        Piece("aft_ring", "grey-paint", hoop(CARGO, CARGO_LOW_M + 0.03, 0.05, 0.006, n)),
        Piece("drive_ring", "grey-paint", hoop(DRIVE, -1.96, 0.06, 0.014, n)),
        Piece("equipment_boxes", "mli-gold", merge(_boxes())),
    ]
    if level.fine:
        pieces.append(Piece("handrails", "machined-aluminium", merge(_rails())))
        lines = seams(CARGO, [15.0 + 30.0 * k for k in range(12)], [0.08, CARGO_HIGH_M - 0.08], 0.014, 0.012)
        pieces.append(Piece("blanket_seams", "white-seam", lines))
    return pieces


def _grid(rows: np.ndarray, count: int, level: Level) -> list[Mesh]:
    blankets, pitch = [], 2 * np.pi / count
    for row, (a, b) in enumerate(itertools.pairwise(rows)):
        for k in range(count):
            az = k * pitch
            lift = BLANKET_M * (0.6 + 0.4 * np.sin(2.1 * k + 1.3 * row) ** 2)
            columns = level.segments(RIM_SEGMENTS) // count
            blankets.append(
                sector(CARGO, (az + 0.006, az + pitch - 0.006), [a + 0.008, b - 0.008], lift, 0.01, columns)
            )
    return blankets


def _rails() -> list[Mesh]:
    rails = []
    for az in (20.0, 65.0, 115.0, 160.0, 200.0, 245.0, 295.0, 340.0):
        a = np.deg2rad(az)
        for z in (0.7, 1.7, 2.7, 3.7, 4.6):
            p, q = CARGO.point(a, z - 0.28, 0.004), CARGO.point(a, z + 0.28, 0.004)
            rails.append(handrail(p, q, CARGO.normal(a, z), 0.08, 0.014))
    for az in (45.0, 135.0, 225.0, 315.0):
        a = np.deg2rad(az)
        p, q = CONE.point(a, 5.45, 0.004), CONE.point(a, 5.95, 0.004)
        rails.append(handrail(p, q, CONE.normal(a, 5.7), 0.08, 0.014))
    return rails


def _boxes() -> list[Mesh]:
    """Return the electronics on the propulsion module's forward end."""
    return [
        box((-0.14, -0.20, -0.16), (0.12, 0.20, 0.16), 0.015)
        .moved((DRIVE_RADIUS_M + 0.06, 0, -0.80))
        .rotated(turn_z(np.deg2rad(a)))
        for a in (60.0, 120.0, 240.0, 300.0)
    ]


def _engines(level: Level) -> list[Piece]:
    """Return four main engines on the base, clusters of attitude thrusters."""
    n = level.segments(36)
    length = DRIVE_LOW_M - NOZZLE_LOW_M + 0.02
    main = [
        bell(polar(0.58, az, DRIVE_LOW_M + 0.02), (0, 0, -1), length, 0.06, 0.19, n)
        for az in (45, 135, 225, 315)
    ]
    pieces = [Piece("main_engines", "nozzle-alloy", merge(main))]
    if not level.fittings:
        return pieces
    small, mounts = [], []
    for az in (45.0, 135.0, 225.0, 315.0):
        small += [
            bell(polar(1.18, az + d, DRIVE_LOW_M + 0.01), (0, 0, -1), 0.14, 0.025, 0.06, n // 2)
            for d in (-4.0, 4.0)
        ]
    for az in (40.0, 140.0, 220.0, 320.0):
        a = np.deg2rad(az)
        for z, surface in ((-3.05, DRIVE), (4.85, CARGO)):
            out = surface.normal(a, z)
            position = surface.point(a, z) + 0.03 * out
            tangent = np.array([-np.sin(a), np.cos(a), 0.0])
            mounts.append(pad(surface, a, z, (0.20, 0.14), lift_m=0.05, exponent=4.0, segments=n))
            small += [
                bell(position + side * 0.09 * tangent, out + 0.7 * side * tangent, 0.12, 0.02, 0.05, n // 2)
                for side in (-1.0, 1.0)
            ]
    low, high = DRIVE_LOW_M - 0.03, DRIVE_LOW_M + 0.01
    heat = revolve([(0, low), (1.30, low), (1.34, high), (0, high)], 2 * n)
    pieces += [
        Piece("attitude_thrusters", "nozzle-alloy", merge(small)),
        Piece("thruster_mounts", "mli-gold", merge(mounts)),
        Piece("base_blanket", "mli-gold", heat),
    ]
    return pieces
