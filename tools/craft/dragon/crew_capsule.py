"""Crew Dragon's capsule: heat shield, sidewall, hatch, windows, thruster pods."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray
from tools.craft.assemble import Piece
from tools.craft.dragon.crew_shape import (
    CLAW_HIGH_M,
    CLAW_LOW_M,
    DECK_M,
    DECK_RADIUS_M,
    HATCH_Z_M,
    POD_AZIMUTHS_DEG,
    POD_Z_M,
    RIM_RADIUS_M,
    RIM_TOP_M,
    SIDEWALL,
    WINDOW_AZIMUTHS_DEG,
    WINDOW_Z_M,
)
from tools.craft.hardware import bell, hoop, revolve, seams, window
from tools.craft.labels import RIM_SEGMENTS
from tools.craft.level import Level
from tools.craft.shapes.mesh import merge
from tools.craft.shapes.solids import box
from tools.craft.shapes.wrapped import pad

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

POD_HALF_M = (0.46, 0.98)
POD_DOME_M = 0.21
POD_LIFT_M, POD_EXPONENT = 0.02, 3.0


def build_capsule(level: Level) -> list[Piece]:
    """Return the capsule without nose cone and docking port."""
    n = level.segments(RIM_SEGMENTS)
    # the shield's dome is inside the trunk, its rim outside
    shield = [
        (0, -0.42), (0.6, -0.39), (1.2, -0.27), (1.72, -0.04), (1.86, 0.0), (1.94, 0.05), (1.985, 0.14),
        (RIM_RADIUS_M, 0.24), (RIM_RADIUS_M, RIM_TOP_M), (0, RIM_TOP_M),
    ]  # fmt: skip
    step = 0.012
    wall = [
        (0, RIM_TOP_M - 0.02), (RIM_RADIUS_M - step, RIM_TOP_M - 0.02), (RIM_RADIUS_M - step, RIM_TOP_M),
        *_wall_points(level), (DECK_RADIUS_M - 0.05, DECK_M), (DECK_RADIUS_M - 0.07, DECK_M - 0.06),
        (0, DECK_M - 0.06),
    ]  # fmt: skip
    pieces = [
        Piece("heat_shield", "burnt-ablator", revolve(shield, n)),
        Piece("capsule_sidewall", "white-paint", revolve(wall, n)),
        *_pods(level),
        Piece(
            "umbilical_fairing", "white-paint", box(CLAW_LOW_M, CLAW_HIGH_M, 0.03 if level.fittings else 0.0)
        ),
    ]
    return [*pieces, *(_fittings(level) if level.fittings else [])]


def _wall_points(level: Level) -> list[tuple[float, float]]:
    count = 8 if level.fine else 2
    z = np.linspace(RIM_TOP_M, DECK_M, count)
    r = RIM_RADIUS_M + (DECK_RADIUS_M - RIM_RADIUS_M) * (z - RIM_TOP_M) / (DECK_M - RIM_TOP_M)
    return [(float(a), float(b)) for a, b in zip(r, z, strict=True)]


def pod_rise(flat_m: FloatArray, about_m: ArrayLike = (0.0, 0.0)) -> FloatArray:
    """Return the height of a pod over the sidewall at points (N, 2) round ``about_m``, itself counted from the pod's
    middle.
    """
    reach = (np.abs((flat_m + np.asarray(about_m)) / POD_HALF_M) ** POD_EXPONENT).sum(axis=-1) ** (
        1 / POD_EXPONENT
    )
    return np.asarray(POD_LIFT_M + POD_DOME_M * (1 - np.minimum(reach, 1.0) ** 2))


def _pods(level: Level) -> list[Piece]:
    """Return four fairings, each with two abort engines in black recesses below and four small thrusters above."""
    pieces = []
    for az in np.deg2rad(POD_AZIMUTHS_DEG):
        fairing = pad(
            SIDEWALL,
            az,
            POD_Z_M,
            POD_HALF_M,
            lift_m=POD_LIFT_M,
            sink_m=0.03,
            dome_m=POD_DOME_M,
            exponent=POD_EXPONENT,
            segments=level.segments(48),
            rings=8 if level.fine else 3,
        )
        pieces.append(Piece("thruster_pods", "white-paint", fairing))
        if level.fittings:
            pieces += _pod_engines(float(az), level)
    return pieces


def _pod_engines(az: float, level: Level) -> list[Piece]:
    tangent = np.array([-np.sin(az), np.cos(az), 0.0])
    slope = np.hypot(1.0, float(SIDEWALL.slope(POD_Z_M)))
    pieces = []

    def mount(x: float, y: float) -> tuple[float, float, float]:
        """Return the azimuth, height and rise of the pod's surface at a point round its middle."""
        z = POD_Z_M + y / slope
        return az + x / float(SIDEWALL.radius(z)), z, float(pod_rise(np.array([x, y])))

    for side in (-1.0, 1.0):
        middle = np.array([0.20 * side, -0.40])
        a, z, rise = mount(*middle)
        recess = pad(
            SIDEWALL,
            a,
            z,
            (0.165, 0.27),
            lift_m=0.006,
            sink_m=0.0,
            turn_rad=-0.18 * side,
            relief=functools.partial(pod_rise, about_m=middle),
            segments=level.segments(36),
            rings=6 if level.fine else 3,
        )
        pieces.append(Piece("abort_engine_recesses", "black-paint", recess))
        axis = SIDEWALL.normal(a, z) + side * 0.45 * tangent - (0, 0, 0.6)
        skirt = bell(SIDEWALL.point(a, z, rise - 0.045), axis, 0.10, 0.08, 0.135, level.segments(36))
        pieces.append(Piece("abort_engines", "nozzle-alloy", skirt))
        for y in (0.34, 0.60):
            a, z, rise = mount(0.15 * side, y)
            out = SIDEWALL.normal(a, z) + side * 0.6 * tangent
            thruster = bell(SIDEWALL.point(a, z, rise - 0.004), out, 0.045, 0.03, 0.050, level.segments(24))
            pieces.append(Piece("draco_thrusters", "nozzle-alloy", thruster))
    return pieces


def _fittings(level: Level) -> list[Piece]:
    """Return the hatch, windows, seams of the back-shell tiles."""
    n = level.segments(36)
    hatch = pad(SIDEWALL, 0.0, HATCH_Z_M, (0.52, 0.62), lift_m=0.010, exponent=4.0, segments=2 * n, rings=5)
    gap = pad(SIDEWALL, 0.0, HATCH_Z_M, (0.545, 0.645), lift_m=0.004, exponent=4.0, segments=2 * n, rings=5)
    pieces = [
        Piece("hatch_seal", "grey-paint", gap),
        Piece("hatch", "white-paint", hatch),
        *window("hatch_window", SIDEWALL, 0.0, HATCH_Z_M + 0.22, (0.13, 0.13), level, frame_m=0.04),
    ]
    for az in WINDOW_AZIMUTHS_DEG:
        pieces += window("cabin", SIDEWALL, az, WINDOW_Z_M, (0.17, 0.21), level, exponent=3.0)
    for az in (-155.0, 155.0):
        pieces += window("rear", SIDEWALL, az, WINDOW_Z_M, (0.12, 0.12), level)
    if level.fine:
        rows = np.linspace(RIM_TOP_M + 0.02, DECK_M - 0.02, 6)
        lines = [seams(SIDEWALL, [15.0 + 30.0 * k for k in range(12)], list(rows), 0.014, 0.0025)]
        lines += [hoop(SIDEWALL, z, 0.014, 0.0035, RIM_SEGMENTS) for z in (0.86, 2.38, 3.02)]
        pieces.append(Piece("tile_seams", "white-seam", merge(lines)))
    return pieces
