"""Crew Dragon's forward end: open nose cone, docking port, forward thrusters."""

from __future__ import annotations

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.dragon.crew_shape import (
    DECK_M,
    DECK_RADIUS_M,
    HINGE_X_M,
    NOSE_HEIGHT_M,
    PORT_M,
    PORT_RADIUS_M,
    nose_point,
    nose_rotation,
)
from tools.craft.hardware import bell, revolve
from tools.craft.labels import RIM_SEGMENTS, polar
from tools.craft.level import Level
from tools.craft.place import turn_z
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import prism
from tools.craft.shapes.solids import bar, box, rod

SHELL_M = 0.05  # thickness of the nose cone


def nose_cone(level: Level, *, closed: bool) -> Mesh:
    """Return the nose cone as a shell; when closed its base stands on the deck."""
    steps = 12 if level.fine else 4
    t = np.linspace(0, np.pi / 2, steps + 1)
    # blunter than an ellipse: a super-ellipse of exponent 2.3
    r, h = np.cos(t) ** (2 / 2.3), np.sin(t) ** (2 / 2.3)
    r[-1] = 0.0
    outer = np.column_stack([DECK_RADIUS_M * r, DECK_M + NOSE_HEIGHT_M * h])
    inner = np.column_stack([(DECK_RADIUS_M - SHELL_M) * r, DECK_M + (NOSE_HEIGHT_M - SHELL_M) * h])
    mesh = revolve([*inner[::-1][:-1], inner[0], *outer], level.segments(RIM_SEGMENTS))
    if closed:
        return mesh
    R = nose_rotation()
    return mesh.rotated(R).moved(nose_point(np.zeros(3)))


def build_nose(level: Level, *, closed: bool = False) -> list[Piece]:
    """Return the nose cone, hinge, deck and docking port."""
    pieces = [Piece("nose_cone", "white-paint", nose_cone(level, closed=closed)), *_port(level)]
    if not level.fittings:
        return pieces
    arms = []
    for y in (-0.34, 0.34):
        end = nose_point(np.array([HINGE_X_M + 0.085, y, DECK_M + 0.03]))
        arms.append(
            bar((HINGE_X_M + 0.28, y, DECK_M - 0.05), (HINGE_X_M, y, DECK_M + 0.02), 0.06, 0.08, (0, 0, 1))
        )
        arms.append(bar((HINGE_X_M, y * 1.001, DECK_M + 0.02), end, 0.055, 0.075, (0, 0, 1)))
    arms.append(rod((HINGE_X_M, -0.42, DECK_M), (HINGE_X_M, 0.42, DECK_M), 0.035, level.segments(24)))
    if not closed:
        pieces.append(Piece("nose_hinge", "brushed-metal", merge(arms)))
    pieces += _forward_fittings(level)
    return pieces


def _port(level: Level) -> list[Piece]:
    """Return the tunnel, hard-capture ring and hatch, of the docking standard's proportions."""
    n = level.segments(48)
    low = DECK_M - 0.10
    tunnel = [
        (0.62, low), (0.80, low), (0.72, 3.56), (0.66, 3.66), (0.62, 3.84), (0.56, 3.84), (0.56, low),
        (0.62, low),
    ]  # fmt: skip
    ring = [
        (0.52, 3.80), (PORT_RADIUS_M, 3.80), (PORT_RADIUS_M, PORT_M), (0.52, PORT_M), (0.52, 3.80),
    ]  # fmt: skip
    hatch = [(0, 3.68), (0.575, 3.68), (0.575, 3.70), (0.40, 3.715), (0, 3.715)]
    pieces = [
        Piece("docking_tunnel", "white-paint", revolve(tunnel, n)),
        Piece("docking_ring", "machined-aluminium", revolve(ring, n)),
        Piece("docking_hatch", "grey-paint", revolve(hatch, n)),
    ]
    if not level.fittings:
        return pieces
    petal = prism(
        [(-0.19, 0.0), (0.19, 0.0), (0.08, 0.20), (-0.08, 0.20)], 0.022, u=(0, 1, 0), v=(-0.5, 0, 0.866)
    )
    petals = [petal.moved((0.545, 0, 3.78)).rotated(turn_z(np.deg2rad(a))) for a in (60.0, 180.0, 300.0)]
    soft = [(0.535, 3.93), (0.60, 3.93), (0.60, 3.985), (0.535, 3.985), (0.535, 3.93)]
    pieces.append(Piece("capture_petals", "black-paint", merge(petals)))
    pieces.append(Piece("soft_capture_ring", "black-paint", revolve(soft, n)))
    hooks = [
        box((-0.035, -0.03, -0.05), (0.012, 0.03, 0.03))
        .moved((PORT_RADIUS_M + 0.008, 0, 3.89))
        .rotated(turn_z(a))
        for a in np.deg2rad(15.0 + 30.0 * np.arange(12))
    ]
    pieces.append(Piece("docking_hooks", "brushed-metal", merge(hooks)))
    return pieces


def _forward_fittings(level: Level) -> list[Piece]:
    """Return four thrusters on the deck, navigation sensors, boxes of the mechanism."""
    deck = DECK_M - 0.055
    thrusters = [
        bell(polar(0.90, az, deck), (0, 0, 1), 0.14, 0.04, 0.085, level.segments(24))
        for az in (35.0, 145.0, 215.0, 325.0)
    ]
    sensors = []
    for az, size in ((75.0, 0.10), (105.0, 0.08), (-75.0, 0.10), (-105.0, 0.08)):
        x, y, z = polar(0.93, az, deck)
        sensors.append(box((x - size, y - size, z - 0.02), (x + size, y + size, z + 0.24), 0.015))
    lenses = [
        rod(polar(0.93, az, deck + 0.23), polar(0.93, az, deck + 0.262), 0.055, level.segments(24))
        for az in (75.0, -75.0)
    ]
    rails = revolve(
        [
            (1.05, deck - 0.01),
            (1.075, deck - 0.01),
            (1.075, deck + 0.03),
            (1.05, deck + 0.03),
            (1.05, deck - 0.01),
        ],
        level.segments(48),
    )
    return [
        Piece("forward_thrusters", "nozzle-alloy", merge(thrusters)),
        Piece("navigation_sensors", "grey-paint", merge(sensors)),
        Piece("sensor_lenses", "window", merge(lenses)),
        Piece("nose_seal", "black-paint", rails),
    ]
