"""Envisat's bus: service module with its interface ring, payload module with insulation, radiators and seams."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.envisat.dimensions import (
    BUS_END_X_M,
    BUS_HALF_Y_M,
    BUS_HALF_Z_M,
    RING_M,
    RING_RADIUS_M,
    SERVICE_END_X_M,
    SKIN_M,
)
from tools.craft.hardware import bolts, thruster, tube
from tools.craft.level import facets
from tools.craft.place import both_sides
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.solids import box, rod

BAY_M = 1.85
"""The payload module is four bays long: a panel each side."""
Y, Z = BUS_HALF_Y_M, BUS_HALF_Z_M


def bays() -> list[float]:
    """Return the x coordinates of the frames between the payload module's bays."""
    return [SERVICE_END_X_M - k * BAY_M for k in range(5)]


def build_bus(detail: Detail) -> list[Piece]:
    """Return both modules and all that is fixed to their faces."""
    return [*_service_module(detail), *_payload_module(detail), *_radiators(detail)]


def _service_module(detail: Detail) -> list[Piece]:
    body = box((SERVICE_END_X_M, -Y, -Z), (-0.02, Y, Z), 0.03 if detail == "full" else 0.0)
    deck = box((-0.06, -0.94 * Y, -0.92 * Z), (0.0, 0.94 * Y, 0.92 * Z))
    ring = tube((0, 0, 0), (1, 0, 0), RING_RADIUS_M, RING_RADIUS_M - 0.045, RING_M, 96, detail)
    pieces = [
        Piece("service_module", "mli-gold", body),
        Piece("interface_deck", "mli-black", deck),
        Piece("interface_ring", "bare-aluminium", ring),
    ]
    if detail != "low":
        tanks = [box((-0.01, s * 1.12 - 0.09, -0.35), (0.10, s * 1.12 + 0.09, 0.35), 0.01) for s in (-1, 1)]
        jets = [
            thruster((0.0, sy * 1.2, sz * 0.62), (1, 0, 0), 0.035, 0.14, detail)
            for sy in (-1, 1)
            for sz in (-1, 1)
        ]
        jets += [
            thruster((-0.35, sy * Y, sz * 0.55), (0, sy, 0), 0.03, 0.11, detail)
            for sy in (-1, 1)
            for sz in (-1, 1)
        ]
        pieces += [
            Piece("service_boxes", "mli-silver", merge(tanks)),
            Piece("thrusters", "nozzle", merge(jets)),
        ]
    if detail == "full":
        rim = [
            (RING_M, (RING_RADIUS_M - 0.022) * np.cos(a), (RING_RADIUS_M - 0.022) * np.sin(a))
            for a in 2 * np.pi * np.arange(48) / 48
        ]
        pieces.append(Piece("ring_bolts", "titanium", bolts(rim, (1, 0, 0), 0.009, 0.006, detail)))
        pieces.append(
            Piece("service_seams", "kapton-substrate", merge(_belts([-0.6, -1.25, -1.9], 0.04, 0.0)))
        )
    return pieces


def _belts(xs: list[float], width_m: float, inset_m: float) -> list[Mesh]:
    """Return the strips of tape round the bus at given x, four to a belt, 4 mm proud."""
    belts = []
    y, z, t = Y - inset_m, Z - inset_m, 0.004
    for x in xs:
        lo, hi = x - width_m / 2, x + width_m / 2
        top = box((lo, -0.96 * y, z - 0.002), (hi, 0.96 * y, z + t))
        side = box((lo, y - 0.002, -0.94 * z), (hi, y + t, 0.94 * z))
        belts += [*both_sides(top, 2), *both_sides(side, 1)]
    return belts


def _payload_module(detail: Detail) -> list[Piece]:
    """Return a carbon core under gold and black blankets, frames at the bays, corner beams."""
    x0, x1 = BUS_END_X_M, SERVICE_END_X_M
    y, z = Y - SKIN_M, Z - SKIN_M
    core = box((x0 + 0.02, -y, -z), (x1, y, z))
    end = box((x0, -0.96 * Y, -0.94 * Z), (x0 + 0.03, 0.96 * Y, 0.94 * Z))
    frames = []
    for x in bays()[1:-1]:
        side = box((x - 0.035, -Y + 0.004, -Z + 0.004), (x + 0.035, Y - 0.004, Z - 0.004))
        frames.append(side)
    beams = [
        box((x0 + 0.001, sy * Y - 0.07 * (sy > 0), sz * Z - 0.07 * (sz > 0)),
            (x1 - 0.001, sy * Y + 0.07 * (sy < 0), sz * Z + 0.07 * (sz < 0)))
        for sy in (-1, 1)
        for sz in (-1, 1)
    ]  # fmt: skip
    pieces = [
        Piece("payload_module", "mli-black", core),
        Piece("payload_end", "mli-black", end),
        Piece("payload_beams", "mli-gold", merge(beams)),
    ]
    if detail != "low":
        pieces.append(Piece("payload_frames", "mli-gold", merge(frames)))
        rails = [
            rod(
                (x0 + 0.3, s * (Y - 0.25), -Z - 0.03),
                (x1 - 0.2, s * (Y - 0.25), -Z - 0.03),
                0.025,
                facets(detail, 16),
            )
            for s in (-1, 1)
        ]
        posts = [
            rod((x, s * (Y - 0.25), -Z - 0.03), (x, s * (Y - 0.25), -z + 0.01), 0.018, facets(detail, 12))
            for s in (-1, 1)
            for x in np.linspace(x0 + 0.35, x1 - 0.25, 9)
        ]
        pieces.append(Piece("handling_rails", "bare-aluminium", merge([*rails, *posts])))
    if detail == "full":
        middles = [x - BAY_M / 2 for x in bays()[:-1]]
        pieces.append(Piece("payload_seams", "kapton-substrate", merge(_belts(middles, 0.05, SKIN_M))))
        points = [
            (x + dx, sy * (Y - SKIN_M), h)
            for x in middles
            for dx in (-0.8, -0.4, 0.4, 0.8)
            for h in (-0.68, 0.68)
            for sy in (-1, 1)
        ]
        heads = [bolts([p], (0, 1 if p[1] > 0 else -1, 0), 0.02, 0.006, detail) for p in points]
        pieces.append(Piece("blanket_buttons", "bare-aluminium", merge(heads)))
    return pieces


def _radiators(detail: Detail) -> list[Piece]:
    """Return the mirror panels on +-y of the bays, white ones on the service module, each with its joints."""
    mirrors, joints = [], []
    for k, x in enumerate(bays()[:-1]):
        lo, hi = x - BAY_M + 0.22, x - 0.22
        for s in (-1, 1):
            # the cold instruments' bays on -y carry the larger radiators
            h = 0.56 if s < 0 or k % 2 else 0.36
            mirrors.append(_on_side(s, lo, hi, -h, h, SKIN_M, 0.015))
            if detail == "full":
                columns, rows = np.linspace(lo, hi, 8)[1:-1], np.linspace(-h, h, 7)[1:-1]
                out = SKIN_M - 0.015
                joints += [_on_side(s, a - 0.004, a + 0.004, -h, h, out, 0.002) for a in columns]
                joints += [_on_side(s, lo, hi, b - 0.004, b + 0.004, out, 0.0012) for b in rows]
    white = [_on_side(s, -2.25, -0.55, -0.48, 0.48, 0.0, 0.015) for s in (-1, 1)]
    pieces = [
        Piece("payload_radiators", "radiator-mirror", merge(mirrors)),
        Piece("service_radiators", "white-paint", merge(white)),
    ]
    if joints:
        pieces.append(Piece("radiator_joints", "grey-paint", merge(joints)))
    return pieces


def _on_side(
    side: int, x0_m: float, x1_m: float, z0_m: float, z1_m: float, inset_m: float, thickness_m: float
) -> Mesh:
    """Return a plate on the +y or -y face, ``inset_m`` inside the bus's width."""
    y = Y - inset_m
    plate = box((x0_m, y, z0_m), (x1_m, y + thickness_m, z1_m))
    return plate if side > 0 else plate.mirrored(1)
