"""Wings, antennas and rendezvous sensors of Tianzhou."""

from __future__ import annotations

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.hardware import dish
from tools.craft.labels import polar
from tools.craft.level import Level
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.solids import bar, box, lathe, rod
from tools.craft.tianzhou.shape import CARGO, CARGO_RADIUS_M, CONE, DRIVE_RADIUS_M, WINGS

RELAY_FOOT_M = (0.0, -CARGO_RADIUS_M + 0.02, 4.30)
RELAY_HUB_M = (0.0, -2.45, 4.75)


def _drives(level: Level) -> Piece:
    """Return the housings of the wings' rotary drives."""
    n, z = level.segments(24), WINGS.z_m
    housings = [
        rod((s * (DRIVE_RADIUS_M - 0.05), 0, z), (s * (DRIVE_RADIUS_M + 0.12), 0, z), 0.14, n)
        for s in (1, -1)
    ]
    return Piece("wing_drives", "mli-gold", merge(housings))


def build_fittings(level: Level) -> list[Piece]:
    """Return both wings; from the medium level on antennas and sensors."""
    return [*WINGS.pieces(level), _drives(level), *(_antennas(level) if level.fittings else [])]


def _antennas(level: Level) -> list[Piece]:
    """Return the relay dish on its boom, rendezvous radar and camera at the docking end, whips."""
    n = level.segments(36)
    hub = np.array(RELAY_HUB_M)
    look = np.array([0.0, -0.8, 0.6])
    pieces = [
        Piece("relay_boom", "grey-paint", bar(RELAY_FOOT_M, hub, 0.07, 0.07, (1, 0, 0))),
        Piece("relay_dish", "white-paint", dish(hub + 0.05 * look, look, 0.36, 0.11, n)),
        Piece("relay_gimbal", "mli-gold", box(np.subtract(hub, 0.09), np.add(hub, 0.09), 0.01)),
        Piece("relay_feed", "black-paint", rod(hub + 0.06 * look, hub + 0.30 * look, 0.022, 12)),
    ]
    sensors, lenses = [], []
    for az in (90.0, 270.0):
        a = np.deg2rad(az)
        p, w = CONE.point(a, 6.02), np.array([np.cos(a), np.sin(a), 0.0])
        position = p + 0.04 * w + (0, 0, 0.06)
        sensors.append(box(position - (0.13, 0.12, 0.14), np.add(position, (0.13, 0.12, 0.14)), 0.015))
        lenses += [
            rod(np.add(position, (x, 0, 0.12)), np.add(position, (x, 0, 0.165)), 0.042, n // 2)
            for x in (-0.055, 0.06)
        ]
    radar = []
    for az in (30.0, 150.0, 210.0, 330.0):
        p, w = CONE.point(np.deg2rad(az), 5.62), CONE.normal(np.deg2rad(az), 5.62)
        radar.append(lathe([(0, -0.03), (0.08, -0.03), (0.08, 0.05), (0.045, 0.22), (0, 0.22)], p, w, n // 2))
    whips = []
    for az, z in ((55.0, 0.5), (125.0, 0.5), (235.0, 0.5), (305.0, 0.5)):
        a = np.deg2rad(az)
        p = CARGO.point(a, z)
        whips.append(
            rod(
                p - 0.02 * CARGO.normal(a, z),
                np.asarray(polar(CARGO_RADIUS_M + 0.42, az, z - 0.22)),
                0.010,
                6,
            )
        )
    return [
        *pieces,
        Piece("rendezvous_sensors", "black-paint", merge(sensors)),
        Piece("sensor_lenses", "window", merge(lenses)),
        Piece("radar_horns", "white-paint", merge(radar)),
        Piece("whip_antennas", "brushed-metal", merge(whips)),
    ]
