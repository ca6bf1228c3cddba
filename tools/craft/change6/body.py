"""Body, tanks and propulsion of Chang'e-6's ascent vehicle."""

from __future__ import annotations

import itertools

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.change6.dimensions import (
    BODY_TOP_M,
    CORE_INSET_M,
    DECK_M,
    ENGINE_EXIT_M,
    ENGINE_LENGTH_M,
    ENGINE_TOP_M,
    ENGINE_WALL_M,
    TANK_RADIUS_M,
    TANK_XY_M,
    TANK_Z_M,
    octagon,
)
from tools.craft.hardware import bolts, nozzle, sphere, thruster, tube
from tools.craft.level import facets
from tools.craft.place import turn_z
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.prism import prism
from tools.craft.shapes.solids import box, lathe, rod, truss


def build_body(detail: Detail) -> list[Piece]:
    """Return two decks, the insulated walls between them, uprights at the corners, seams of the blankets."""
    core = prism(octagon(CORE_INSET_M), BODY_TOP_M - 2 * DECK_M, origin_m=(0, 0, DECK_M))
    lower = prism(octagon(), DECK_M)
    upper = prism(octagon(), DECK_M, origin_m=(0, 0, BODY_TOP_M - DECK_M))
    blanket = prism(octagon(0.02), 0.006, origin_m=(0, 0, BODY_TOP_M - 0.001))
    pieces = [
        Piece("body_walls", "mli-gold", core),
        Piece("deck_lower", "brushed-aluminium", lower),
        Piece("deck_upper", "brushed-aluminium", upper),
        Piece("deck_blanket", "mli-gold", blanket),
    ]
    if detail != "low":
        ring = octagon(CORE_INSET_M - 0.006)
        n = facets(detail, 12)
        uprights = [rod((x, y, DECK_M), (x, y, BODY_TOP_M - DECK_M), 0.014, n) for x, y in ring]
        pieces.append(Piece("body_uprights", "carbon-fibre", merge(uprights)))
    if detail == "full":
        tape = [
            prism(octagon(CORE_INSET_M - 0.003), 0.018, origin_m=(0, 0, z)) for z in (0.06, BODY_TOP_M - 0.09)
        ]
        pieces.append(Piece("body_seams", "kapton-substrate", merge(tape)))
        points = [(x, y, BODY_TOP_M + 0.005) for x, y in _along(octagon(0.045), 4)]
        pieces.append(Piece("deck_buttons", "bare-aluminium", bolts(points, (0, 0, 1), 0.011, 0.004, detail)))
    return pieces


def _along(outline: FloatArray, count: int) -> list[tuple[float, float]]:
    """Return points spread over the sides of a polygon."""
    turned = np.roll(outline, -1, axis=0)
    return [
        (float(x), float(y))
        for a, b in zip(outline, turned, strict=True)
        for x, y in a + (np.arange(count) + 0.5)[:, None] / count * (b - a)
    ]


def build_tanks(detail: Detail) -> list[Piece]:
    """Return four tanks that bulge out of the cut corners, each in a skirt with struts to the decks."""
    balls, skirts, struts = [], [], []
    for sx, sy in itertools.product((-1, 1), repeat=2):
        c = (sx * TANK_XY_M, sy * TANK_XY_M, TANK_Z_M)
        balls.append(sphere(c, TANK_RADIUS_M, 48, detail))
        skirts.append(
            tube(
                (c[0], c[1], c[2] - 0.02),
                (0, 0, 1),
                TANK_RADIUS_M + 0.014,
                TANK_RADIUS_M - 0.004,
                0.04,
                64,
                detail,
            )
        )
        along = np.array([sx, -sy, 0.0]) / 2**0.5
        out = np.array([sx, sy, 0.0]) / 2**0.5
        rim = [np.asarray(c) + 0.16 * out + s * 0.30 * along for s in (-1, 1)]
        feet = [
            np.array([sx * TANK_XY_M, sy * TANK_XY_M, z]) + s * 0.15 * along
            for s in (-1, 1)
            for z in (0.03, 0.99)
        ]
        nodes = np.array([*rim, *feet])
        struts.append(truss(nodes, [(0, 2), (0, 3), (1, 4), (1, 5)], 0.010, facets(detail, 12)))
    pieces = [Piece("tanks", "mli-silver", merge(balls)), Piece("tank_skirts", "titanium", merge(skirts))]
    if detail != "low":
        pieces.append(Piece("tank_struts", "carbon-fibre", merge(struts)))
    return pieces


def build_propulsion(detail: Detail) -> list[Piece]:
    """Return the main engine with its heat shield, and the attitude thrusters in four pods."""
    bell = nozzle(
        (0, 0, ENGINE_TOP_M), (0, 0, -1), 0.050, ENGINE_EXIT_M, ENGINE_LENGTH_M, ENGINE_WALL_M, 64, detail
    )
    n = facets(detail, 48)
    chamber = lathe(
        [(0, 0), (0.075, 0), (0.075, 0.05), (0.056, 0.085), (0, 0.085)],
        (0, 0, ENGINE_TOP_M - 0.02),
        (0, 0, 1),
        n,
    )
    shield = lathe(
        [(0, 0.0), (0.42, 0.0), (0.40, 0.016), (0, 0.016)], (0, 0, -0.016), (0, 0, 1), facets(detail, 64)
    )
    pieces = [
        Piece("engine_nozzle", "nozzle", bell),
        Piece("engine_chamber", "titanium", chamber),
        Piece("engine_shield", "mli-silver", shield),
    ]
    if detail != "low":
        stiffeners = [
            tube(
                (0, 0, ENGINE_TOP_M - h),
                (0, 0, -1),
                r + ENGINE_WALL_M + 0.006,
                r + ENGINE_WALL_M - 0.002,
                0.008,
                64,
                detail,
            )
            for h, r in ((0.20, 0.1471), (0.38, 0.2000))
        ]
        pieces.append(Piece("engine_rings", "nozzle", merge(stiffeners)))
    pods, jets = [], []
    for k in range(4):
        R = turn_z(np.pi / 4 + k * np.pi / 2)
        pod = box((0.772, -0.075, BODY_TOP_M - 0.15), (0.845, 0.075, BODY_TOP_M - 0.01), 0.006)
        pods.append(pod.rotated(R))
        group = [
            thruster((0.845, s * 0.045, z), (1, 0, 0), 0.019, 0.060, detail)
            for s in (-1, 1)
            for z in (BODY_TOP_M - 0.045,)
        ]
        group += [
            thruster((0.808, s * 0.045, BODY_TOP_M - 0.15), (0, 0, -1), 0.019, 0.060, detail) for s in (-1, 1)
        ]
        group.append(thruster((0.808, 0.0, BODY_TOP_M - 0.01), (0, 0, 1), 0.019, 0.060, detail))
        jets += [m.rotated(R) for m in group]
    return [
        *pieces,
        Piece("thruster_pods", "mli-silver", merge(pods)),
        Piece("thrusters", "nozzle", merge(jets)),
    ]
