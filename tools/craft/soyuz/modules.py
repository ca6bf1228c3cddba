"""The three modules of Soyuz: orbital spheroid, descent bell, service drum with its flared skirt."""

from __future__ import annotations

import itertools

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.hardware import bell, hoop, revolve, seams, window
from tools.craft.labels import RIM_SEGMENTS, polar
from tools.craft.level import Level
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.solids import truss
from tools.craft.shapes.wrapped import Revolved, sector
from tools.craft.soyuz.shape import (
    BASE_LOW_M,
    COLLAR_M,
    COLLAR_RADIUS_M,
    DESCENT,
    DESCENT_PROFILE,
    DRUM,
    DRUM_HIGH_M,
    DRUM_LOW_M,
    DRUM_RADIUS_M,
    ORBITAL,
    ORBITAL_HIGH_M,
    ORBITAL_LOW_M,
    ORBITAL_PROFILE,
    SKIRT,
    SKIRT_EDGE_M,
    SKIRT_LOW_M,
    SKIRT_PROFILE,
)

BLANKET_M = 0.012  # thickness of the insulation


def build_modules(level: Level) -> list[Piece]:
    """Return the shells, blankets, windows, radiators, engines."""
    return [*_orbital(level), *_descent(level), *_service(level)]


def _blanket(level: Level) -> str:
    """Return the material of the shells: what shows between blankets, or the blankets' own where they are left out."""
    return "blanket-dark" if level.fittings else "blanket-grey-green"


def _thinned(profile: tuple[tuple[float, float], ...], level: Level) -> list[tuple[float, float]]:
    step = {"full": 1, "medium": 2, "low": 4}[level.detail]
    return [*profile[:-1:step], profile[-1]]


def quilt(surface: Revolved, rows_m: list[float], count: int, start_deg: float, level: Level) -> list[Mesh]:
    """Return the blankets laid edge to edge round a surface, one row between each two heights, each at its own lift."""
    blankets = []
    pitch = 2 * np.pi / count
    for row, (a, b) in enumerate(itertools.pairwise(rows_m)):
        heights = np.linspace(a + 0.008, b - 0.008, level.segments(12) // 2)
        for k in range(count):
            az = np.deg2rad(start_deg) + (k + 0.5 * (row % 2)) * pitch
            gap = 0.010 / float(surface.radius((a + b) / 2))
            lift = BLANKET_M * (0.55 + 0.45 * np.sin(2.4 * k + 1.7 * row) ** 2)
            columns = max(2, level.segments(72) // count)
            blankets.append(sector(surface, (az + gap, az + pitch - gap), heights, lift, 0.01, columns))
    return blankets


def _orbital(level: Level) -> list[Piece]:
    n = level.segments(RIM_SEGMENTS)
    top = ORBITAL_PROFILE[-1]
    shell = [(0, ORBITAL_PROFILE[0][1] - 0.05), (ORBITAL_PROFILE[0][0], ORBITAL_PROFILE[0][1] - 0.05)]
    shell += [*_thinned(ORBITAL_PROFILE, level), (top[0] - 0.03, top[1] + 0.02), (0, top[1] + 0.02)]
    c, z = COLLAR_RADIUS_M, COLLAR_M
    collar = [
        (0.40, 4.20), (c - 0.02, 4.20), (c - 0.02, 4.38), (c - 0.06, 4.42), (c - 0.06, 4.49), (c, 4.50), (c, z),
        (0.40, z), (0.40, 4.20),
    ]  # fmt: skip
    neck = [(0, 1.70), (0.61, 1.70), (0.66, 1.98), (0.585, 2.06), (0, 2.06)]
    pieces = [
        Piece("orbital_shell", _blanket(level), revolve(shell, n)),
        Piece("docking_collar", "machined-aluminium", revolve(collar, level.segments(48))),
        Piece("orbital_neck", _blanket(level), revolve(neck, level.segments(48))),
    ]
    if level.fittings:
        rows = [2.12, 2.55, ORBITAL_LOW_M, ORBITAL_HIGH_M, 3.80, 4.18]
        pieces.append(
            Piece("orbital_blankets", "blanket-grey-green", merge(quilt(ORBITAL, rows, 12, 6.0, level)))
        )
        pieces.append(Piece("orbital_belt", "grey-paint", hoop(ORBITAL, 3.18, 0.05, 0.022, n)))
        for az in (0.0, 180.0):
            pieces += window(
                "orbital_porthole", ORBITAL, az + 40.0, 3.50, (0.13, 0.13), level, frame_m=0.06, lift_m=0.03
            )
    return pieces


def _descent(level: Level) -> list[Piece]:
    n = level.segments(RIM_SEGMENTS)
    first, last = DESCENT_PROFILE[0], DESCENT_PROFILE[-1]
    shell = [(0, -0.02), (1.0, -0.02), first]
    shell += [*_thinned(DESCENT_PROFILE, level)[1:], (last[0], last[1] + 0.02), (0, last[1] + 0.02)]
    pieces = [Piece("descent_shell", _blanket(level), revolve(shell, n))]
    if level.fittings:
        rows = [0.14, 0.70, 1.22, 1.70]
        pieces.append(
            Piece("descent_blankets", "blanket-grey-green", merge(quilt(DESCENT, rows, 9, 20.0, level)))
        )
        for az in (35.0, 145.0):
            pieces += window(
                "descent_porthole",
                DESCENT,
                az,
                0.98,
                (0.11, 0.11),
                level,
                lift_m=0.03,
                frame="burnt-ablator",
                frame_m=0.05,
            )
        pieces.append(Piece("descent_rim", "burnt-ablator", hoop(DESCENT, 0.09, 0.08, 0.010, n)))
    return pieces


def _service(level: Level) -> list[Piece]:
    n = level.segments(RIM_SEGMENTS)
    r, lo, hi = DRUM_RADIUS_M, DRUM_LOW_M, DRUM_HIGH_M
    drum = revolve([(0, lo - 0.10), (r, lo - 0.10), (r, hi), (r - 0.04, hi + 0.04), (0, hi + 0.04)], n)
    # the skirt is a shell: one looks into it from below
    (ra, za), (rb, zb), (rc, zc) = SKIRT_PROFILE
    inside = [(rc - 0.03, zc), (rb - 0.03, zb), (ra - 0.025, za)]
    skirt = [inside[-1], *SKIRT_PROFILE, *inside]
    base = revolve(
        [(0, BASE_LOW_M), (1.29, BASE_LOW_M), (1.29, BASE_LOW_M + 0.05), (0, BASE_LOW_M + 0.05)], n
    )
    adapter = revolve([(0, hi), (0.80, hi), (0.80, -0.01), (0, -0.01)], level.segments(36))
    pieces = [
        Piece("service_drum", _blanket(level), drum),
        Piece("service_skirt", "white-cloth", revolve(skirt, n)),
        Piece("service_base", "mli-silver", base),
        Piece("transfer_core", "dark-interior", adapter),
        *_engines(level),
    ]
    ring = [polar(1.055, 15.0 * k, (hi + 0.02, -0.03)[k % 2]) for k in range(24)]
    members = [(k, (k + 1) % 24) for k in range(24)]
    if level.fittings:
        pieces.append(
            Piece("transfer_truss", "grey-paint", truss(ring, members, 0.018, 6 if level.fine else 4))
        )
        pieces += _service_skin(level)
    return pieces


def _service_skin(level: Level) -> list[Piece]:
    """Return the radiator strips round drum and skirt, blankets between them."""
    n = level.segments(RIM_SEGMENTS)
    drum_rows = [DRUM_LOW_M + 0.04, DRUM_HIGH_M - 0.03]
    blankets = quilt(DRUM, drum_rows, 12, 0.0, level)
    rows, pitch = [SKIRT_EDGE_M + 0.05, DRUM_LOW_M - 0.05], np.deg2rad(15.0)
    panels = [
        sector(SKIRT, (az + 0.008, az + pitch - 0.008), rows, 0.012, 0.02, 3) for az in pitch * np.arange(24)
    ]
    pieces = [
        Piece("drum_blankets", "blanket-grey-green", merge(blankets)),
        Piece("radiators", "radiator", merge(panels)),
        Piece("skirt_rim", "grey-paint", hoop(SKIRT, SKIRT_LOW_M + 0.14, 0.05, 0.006, n)),
    ]
    if level.fine:
        pieces.append(Piece("drum_bands", "grey-paint", hoop(DRUM, -0.95, 0.03, 0.018, RIM_SEGMENTS)))
        ribs = seams(
            SKIRT, [7.5 + 15.0 * k for k in range(24)], [SKIRT_EDGE_M + 0.04, DRUM_LOW_M - 0.06], 0.012, 0.018
        )
        pieces.append(Piece("radiator_ribs", "white-seam", ribs))
    return pieces


def _engines(level: Level) -> list[Piece]:
    """Return the main engine in the middle of the base, attitude thrusters round it and on the skirt."""
    n = level.segments(36)
    main = bell((0, 0, BASE_LOW_M + 0.02), (0, 0, -1), 0.30, 0.10, 0.27, n)
    pieces = [Piece("main_engine", "nozzle-alloy", main)]
    if not level.fittings:
        return pieces
    small = []
    for az in (45.0, 135.0, 225.0, 315.0):
        for d in (-5.0, 5.0):
            small.append(bell(polar(1.06, az + d, BASE_LOW_M + 0.01), (0, 0, -1), 0.13, 0.03, 0.065, n // 2))
            out = SKIRT.normal(np.deg2rad(az + d), SKIRT_EDGE_M - 0.08)
            position = SKIRT.point(np.deg2rad(az + d), SKIRT_EDGE_M - 0.08, -0.01)
            small.append(bell(position, out, 0.10, 0.02, 0.05, n // 2))
    for az in (0.0, 90.0, 180.0, 270.0):
        out = DRUM.normal(np.deg2rad(az + 22.0), -0.60)
        position = DRUM.point(np.deg2rad(az + 22.0), -0.60, -0.01)
        small.append(bell(position, out, 0.09, 0.02, 0.05, n // 2))
    pieces.append(Piece("attitude_thrusters", "nozzle-alloy", merge(small)))
    return pieces
