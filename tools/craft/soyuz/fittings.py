"""Docking probe, antennas and wings of Soyuz."""

from __future__ import annotations

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.hardware import dish, handrail, revolve
from tools.craft.labels import polar
from tools.craft.level import Level
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.solids import bar, box, lathe, rod
from tools.craft.soyuz.shape import COLLAR_M, ORBITAL, PROBE_TIP_M, SKIRT_EDGE_M, SKIRT_RADIUS_M, WINGS

KURS_BOOM_FOOT_M = (0.0, 0.95, 3.75)
KURS_DISH_M = (0.0, 1.62, 4.42)
MAST_TIP_M = (0.0, -1.95, -2.42)


def build_fittings(level: Level) -> list[Piece]:
    """Return the probe, antennas, both wings."""
    return [*_probe(level), *WINGS.pieces(level), *(_antennas(level) if level.fittings else [])]


def _probe(level: Level) -> list[Piece]:
    """Return the probe on its base cone, its head retracted to 0.4 m before the docking plane, with four guide arms."""
    n = level.segments(36)
    base = revolve(
        [(0, 4.30), (0.50, 4.30), (0.50, COLLAR_M - 0.03), (0.30, COLLAR_M), (0.14, 4.64), (0, 4.64)], n
    )
    t = PROBE_TIP_M
    rod_ = [
        (0, 4.60), (0.055, 4.60), (0.055, t - 0.16), (0.085, t - 0.15), (0.085, t - 0.06), (0.045, t - 0.015),
        (0.02, t), (0, t),
    ]  # fmt: skip
    pieces = [
        Piece("probe_base", "brushed-metal", base),
        Piece("probe", "machined-aluminium", revolve(rod_, n)),
    ]
    if level.fittings:
        arms = [
            rod(polar(0.44, az, COLLAR_M - 0.06), polar(0.06, az, 4.74), 0.016, 8)
            for az in (45.0, 135.0, 225.0, 315.0)
        ]
        pieces.append(Piece("probe_arms", "brushed-metal", merge(arms)))
        hooks = [
            rod(polar(0.605, az, COLLAR_M - 0.06), polar(0.605, az, COLLAR_M + 0.025), 0.025, 12)
            for az in np.arange(22.5, 360.0, 45.0)
        ]
        pieces.append(Piece("docking_hooks", "brushed-metal", merge(hooks)))
    return pieces


def _antennas(level: Level) -> list[Piece]:
    """Return the rendezvous dish on its boom, aft mast with a horn, whip antennas, periscope, handrails."""
    n = level.segments(36)
    foot, hub = np.array(KURS_BOOM_FOOT_M), np.array(KURS_DISH_M)
    look = np.array([0.0, 0.25, 1.0])
    pieces = [
        Piece("rendezvous_boom", "grey-paint", bar(foot, hub, 0.05, 0.05, (1, 0, 0))),
        Piece("rendezvous_dish", "white-paint", dish(hub, look, 0.22, 0.07, n)),
        Piece(
            "dish_gimbal",
            "black-paint",
            box(hub - (0.06, 0.07, 0.13), np.add(hub, (0.06, 0.05, -0.005)), 0.01),
        ),
    ]
    feed = [
        rod(hub + 0.02 * look, hub + 0.16 * look, 0.012, 8),
        rod(hub + 0.13 * look, hub + 0.17 * look, 0.028, 12),
    ]
    pieces.append(Piece("dish_feed", "black-paint", merge(feed)))
    mast = [
        bar((0, -SKIRT_RADIUS_M + 0.03, -2.20), MAST_TIP_M, 0.045, 0.045, (1, 0, 0)),
        box((-0.10, -2.02, -2.48), (0.10, -1.90, -2.34), 0.01),
    ]
    pieces.append(Piece("aft_mast", "grey-paint", merge(mast)))
    spirals = []
    for az in (-60.0, 60.0, 120.0, 240.0):
        a = np.deg2rad(az)
        p, out = ORBITAL.point(a, 3.95), ORBITAL.normal(a, 3.95)
        spirals.append(
            lathe([(0, -0.02), (0.05, -0.02), (0.05, 0.06), (0.028, 0.20), (0, 0.20)], p, out, n // 2)
        )
    pieces.append(Piece("spiral_antennas", "white-paint", merge(spirals)))
    whips = [
        rod(
            polar(SKIRT_RADIUS_M - 0.01, az, SKIRT_EDGE_M),
            polar(SKIRT_RADIUS_M + 0.55, az, SKIRT_EDGE_M - 0.10),
            0.008,
            6,
        )
        for az in (60.0, 120.0, 240.0, 300.0)
    ]
    pieces.append(Piece("whip_antennas", "brushed-metal", merge(whips)))
    periscope = [
        box((-0.09, 0.98, 0.36), (0.09, 1.26, 0.52), 0.012),
        box((-0.06, 1.20, 0.50), (0.06, 1.27, 0.66), 0.010),
    ]
    pieces.append(Piece("periscope", "black-paint", merge(periscope)))
    if level.fine:
        rails = []
        for az in range(30, 390, 60):
            a = np.deg2rad(az)
            for z in (2.75, 3.60):
                lo, hi = ORBITAL.point(a, z - 0.24, 0.005), ORBITAL.point(a, z + 0.24, 0.005)
                rails.append(handrail(lo, hi, ORBITAL.normal(a, z), 0.07, 0.011))
        pieces.append(Piece("handrails", "machined-aluminium", merge(rails)))
        cables = [
            bar(polar(1.10, az, -0.46), polar(1.12, az, 0.20), 0.05, 0.03, polar(1, az, 0))
            for az in (75.0, 255.0)
        ]
        pieces.append(Piece("umbilicals", "blanket-dark", merge(cables)))
    return pieces
