"""Fittings that several craft carry: nozzles, handrails, seams, dishes, windows with their frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tools.craft.assemble import Piece
from tools.craft.shapes.mesh import Mesh, merge, unit
from tools.craft.shapes.solids import lathe, rod, truss
from tools.craft.shapes.wrapped import Revolved, pad, sector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tools.craft.level import Level


def revolve(profile: ArrayLike, segments: int) -> Mesh:
    """A body of revolution about z; the profile as for :func:`lathe`."""
    return lathe(profile, (0, 0, 0), (0, 0, 1), segments)


def open_tube(inner_m: float, outer_m: float, low_m: float, high_m: float, segments: int) -> Mesh:
    """A pipe about z, open at both ends."""
    ring = [(inner_m, low_m), (outer_m, low_m), (outer_m, high_m), (inner_m, high_m), (inner_m, low_m)]
    return revolve(ring, segments)


def bell(
    throat_m: ArrayLike,
    axis: ArrayLike,
    length_m: float,
    throat_radius_m: float,
    exit_radius_m: float,
    segments: int,
) -> Mesh:
    """A nozzle that opens along ``axis``: a parabolic bell, 8 % of its exit radius thick, closed at the throat."""
    t = np.linspace(0, 1, 6)
    inner = throat_radius_m + (exit_radius_m - throat_radius_m) * np.sqrt(t)
    wall = 0.08 * exit_radius_m
    outer = [(float(r + wall), float(h * length_m)) for r, h in zip(inner, t, strict=True)]
    inside = [(float(r), float(h * length_m)) for r, h in zip(inner[:0:-1], t[:0:-1], strict=True)]
    floor = 0.08 * length_m
    profile = [(0, 0), *outer, *inside, (throat_radius_m, floor), (0, floor)]
    return lathe(profile, throat_m, axis, segments)


def dish(vertex_m: ArrayLike, axis: ArrayLike, radius_m: float, depth_m: float, segments: int) -> Mesh:
    """A parabolic reflector that looks along ``axis``, 1.5 % of its diameter thick."""
    t = np.linspace(0, 1, 6)
    wall = 0.03 * radius_m
    back = [(float(radius_m * s), float(depth_m * s * s)) for s in t]
    front = [(float(radius_m * s), float(depth_m * s * s + wall)) for s in t[::-1]]
    return lathe([*back, *front], vertex_m, axis, segments)


def handrail(a_m: ArrayLike, b_m: ArrayLike, out: ArrayLike, height_m: float, radius_m: float) -> Mesh:
    """A rail between two feet, ``height_m`` along ``out``."""
    a, b, n = (np.asarray(x, float) for x in (a_m, b_m, out))
    rise = unit(n) * height_m
    return truss([a, a + rise, b + rise, b], [(0, 1), (1, 2), (2, 3)], radius_m, 6)


def seams(
    surface: Revolved,
    azimuths_deg: Sequence[float],
    heights_m: Sequence[float],
    width_m: float,
    lift_m: float,
) -> Mesh:
    """Narrow strips along the surface at the given azimuths, from the first height to the last."""
    strips = []
    for az in np.deg2rad(azimuths_deg):
        half = width_m / 2 / float(np.mean(surface.radius(list(heights_m))))
        strips.append(sector(surface, (az - half, az + half), heights_m, lift_m, 0.01, 1))
    return merge(strips)


def hoop(surface: Revolved, z_m: float, width_m: float, lift_m: float, segments: int) -> Mesh:
    """A band round the surface."""
    a, b = z_m - width_m / 2, z_m + width_m / 2
    ra, rb = (float(r) for r in surface.radius([a, b]))
    ring = [(ra - 0.01, a), (ra + lift_m, a), (rb + lift_m, b), (rb - 0.01, b), (ra - 0.01, a)]
    return revolve(ring, segments)


def window(
    name: str,
    surface: Revolved,
    azimuth_deg: float,
    z_m: float,
    half_m: tuple[float, float],
    level: Level,
    *,
    exponent: float = 2.0,
    frame: str = "grey-paint",
    frame_m: float = 0.035,
    lift_m: float = 0.012,
) -> list[Piece]:
    """A pane in a frame that stands slightly proud."""
    az = np.deg2rad(azimuth_deg)
    n = level.segments(36)
    outer = (half_m[0] + frame_m, half_m[1] + frame_m)
    rim = pad(surface, az, z_m, outer, lift_m=lift_m, exponent=exponent, segments=n)
    pane = pad(surface, az, z_m, half_m, lift_m=lift_m + 0.004, exponent=exponent, segments=n)
    return [Piece(f"{name}_frames", frame, rim), Piece(f"{name}_panes", "window", pane)]


def stub(
    surface: Revolved, azimuth_deg: float, z_m: float, height_m: float, radius_m: float, segments: int
) -> Mesh:
    """A short cylinder that stands on the surface."""
    az = np.deg2rad(azimuth_deg)
    p, n = surface.point(az, z_m), surface.normal(az, z_m)
    return rod(p - 0.02 * n, p + height_m * n, radius_m, segments)
