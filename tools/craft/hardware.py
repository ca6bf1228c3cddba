"""Hardware that many craft carry: nozzles, tanks, dishes, antennas, star trackers, windows, rails, bolts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.level import facets
from tools.craft.shapes.mesh import Mesh, merge, unit
from tools.craft.shapes.solids import bar, cone, lathe, rod, truss
from tools.craft.shapes.wrapped import Revolved, pad, sector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tools.craft.level import Level

BELL_STEPS: dict[Detail, int] = {"full": 12, "medium": 6, "low": 3}  # rings along a nozzle


def nozzle(
    throat_m: ArrayLike,
    axis: ArrayLike,
    throat_radius_m: float,
    exit_radius_m: float,
    length_m: float,
    wall_m: float,
    segments: int,
    detail: Detail,
) -> Mesh:
    """Return a bell nozzle, hollow, closed at the throat: a parabola from throat to exit, as Rao's optimum nearly is.

    Parameters
    ----------
    throat_m : (3,) array
        Centre of the throat.
    axis : (3,) array
        Direction of the exhaust.
    throat_radius_m : float
        Inner radius of the throat.
    exit_radius_m : float
        Inner radius of the exit.
    length_m : float
        Distance from throat to exit.
    wall_m : float
        Thickness of the wall.
    segments : int
        Facets round the axis at full detail.
    detail : Detail
        Level of detail.

    References
    ----------
    Sutton & Biblarz, Rocket Propulsion Elements, sec. 3.4 (parabolic approximation of bell nozzles).
    """
    s = np.linspace(0.0, 1.0, BELL_STEPS[detail] + 1)
    # steep at the throat, nearly along the axis at the exit
    r = throat_radius_m + (exit_radius_m - throat_radius_m) * (1.6 * s - 0.6 * s**2)
    h = length_m * s
    outside = [(a + wall_m, b) for a, b in zip(r, h, strict=True)]
    inside = [(a, b) for a, b in zip(r, h, strict=True)][::-1]
    floor = wall_m
    inside[-1] = (float(r[0]), floor)
    profile = [(0, 0), *outside, *inside, (0, floor)]
    return lathe(profile, throat_m, axis, facets(detail, segments))


def sphere(centre_m: ArrayLike, radius_m: float, segments: int, detail: Detail) -> Mesh:
    """Return a ball with a meridian step equal to its facets, poles on z."""
    n = facets(detail, segments)
    t = np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1)[1:-1]
    arc = [(radius_m * np.cos(a), radius_m * np.sin(a)) for a in t]
    return lathe([(0, -radius_m), *arc, (0, radius_m)], centre_m, (0, 0, 1), n)


def tube(
    origin_m: ArrayLike,
    axis: ArrayLike,
    outer_m: float,
    inner_m: float,
    height_m: float,
    segments: int,
    detail: Detail,
) -> Mesh:
    """Return an open ring or pipe: its bore goes through."""
    ring = [(inner_m, 0), (outer_m, 0), (outer_m, height_m), (inner_m, height_m), (inner_m, 0)]
    return lathe(ring, origin_m, axis, facets(detail, segments))


def cup(
    origin_m: ArrayLike,
    axis: ArrayLike,
    outer_m: float,
    inner_m: float,
    height_m: float,
    floor_m: float,
    segments: int,
    detail: Detail,
) -> Mesh:
    """Return a pot: a pipe with a closed bottom of thickness ``floor_m``."""
    profile = [
        (0, 0),
        (outer_m, 0),
        (outer_m, height_m),
        (inner_m, height_m),
        (inner_m, floor_m),
        (0, floor_m),
    ]
    return lathe(profile, origin_m, axis, facets(detail, segments))


def star_tracker(
    name: str, origin_m: ArrayLike, axis: ArrayLike, radius_m: float, length_m: float, detail: Detail
) -> list[Piece]:
    """Return a conical baffle, black inside, on a short housing."""
    o, w = np.asarray(origin_m, float), unit(axis)
    n = facets(detail, 32)
    wall = 0.06 * radius_m
    foot = cone(o, o + w * 0.35 * length_m, 0.62 * radius_m, 0.62 * radius_m, n)
    low, high = 0.35 * length_m, length_m
    shell = lathe(
        [
            (0, low),
            (0.55 * radius_m, low),
            (radius_m, high),
            (radius_m - wall, high),
            (0.5 * radius_m, low + wall),
            (0, low + wall),
        ],
        o,
        w,
        n,
    )
    glass = cone(o + w * (low + wall), o + w * (low + 2 * wall), 0.46 * radius_m, 0.46 * radius_m, n)
    return [
        Piece(f"{name}_housing", "grey-paint", foot),
        Piece(f"{name}_baffle", "black-paint", shell),
        Piece(f"{name}_lens", "lens", glass),
    ]


def thruster(
    origin_m: ArrayLike, axis: ArrayLike, exit_radius_m: float, length_m: float, detail: Detail
) -> Mesh:
    """Return a small thruster: a valve block, a neck and a cone with a hollow end."""
    o, w = np.asarray(origin_m, float), unit(axis)
    n = facets(detail, 16)
    r, L = exit_radius_m, length_m
    profile = [
        (0, 0),
        (0.75 * r, 0),
        (0.75 * r, 0.35 * L),
        (0.35 * r, 0.42 * L),
        (r, L),
        (0.86 * r, L),
        (0.22 * r, 0.5 * L),
        (0, 0.5 * L),
    ]
    return lathe(profile, o, w, n)


def tape(
    root_m: ArrayLike,
    tip_m: ArrayLike,
    width_m: float,
    thickness_m: float,
    face: ArrayLike,
    sag_m: float = 0.0,
) -> list[Mesh]:
    """Return a tape antenna: a flat strip whose face looks along ``face``; a curl of ``sag_m`` stands as segments.

    The strip bends along ``face`` as a parabola that leaves the root straight.
    """
    a, b = np.asarray(root_m, float), np.asarray(tip_m, float)
    n = unit(face)
    steps = 1 if sag_m == 0 else 8
    s = np.linspace(0, 1, steps + 1)
    points = a + s[:, None] * (b - a) + (sag_m * (s**2 - s))[:, None] * n
    return [bar(points[k], points[k + 1], width_m, thickness_m, n) for k in range(steps)]


def bolts(
    at_m: Sequence[ArrayLike], axis: ArrayLike, radius_m: float, height_m: float, detail: Detail
) -> Mesh:
    """Return the heads of bolts at points of a face."""
    w = unit(axis)
    n = facets(detail, 12)
    return merge([rod(np.asarray(p, float), np.asarray(p, float) + w * height_m, radius_m, n) for p in at_m])


def socket_screws(
    at_m: Sequence[ArrayLike], axis: ArrayLike, radius_m: float, height_m: float, detail: Detail
) -> Mesh:
    """Return the screws with a rounded head and a socket in it, at points of a face (ISO 7380: button heads)."""
    r, h = radius_m, height_m
    profile = [
        (0, 0),
        (r, 0),
        (r, 0.45 * h),
        (0.93 * r, 0.75 * h),
        (0.75 * r, h),
        (0.52 * r, h),
        (0.52 * r, 0.4 * h),
    ]
    n = facets(detail, 24)
    return merge([lathe([*profile, (0, 0.4 * h)], p, unit(axis), n) for p in at_m])


def revolve(profile: ArrayLike, segments: int) -> Mesh:
    """Return a body of revolution about z; the profile as for :func:`lathe`."""
    return lathe(profile, (0, 0, 0), (0, 0, 1), segments)


def open_tube(inner_m: float, outer_m: float, low_m: float, high_m: float, segments: int) -> Mesh:
    """Return a pipe about z, open at both ends."""
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
    """Return a nozzle that opens along ``axis``: a parabolic bell, 8 % of its exit radius thick, closed at the
    throat.
    """
    t = np.linspace(0, 1, 6)
    inner = throat_radius_m + (exit_radius_m - throat_radius_m) * np.sqrt(t)
    wall = 0.08 * exit_radius_m
    outer = [(float(r + wall), float(h * length_m)) for r, h in zip(inner, t, strict=True)]
    inside = [(float(r), float(h * length_m)) for r, h in zip(inner[:0:-1], t[:0:-1], strict=True)]
    floor = 0.08 * length_m
    profile = [(0, 0), *outer, *inside, (throat_radius_m, floor), (0, floor)]
    return lathe(profile, throat_m, axis, segments)


def dish(vertex_m: ArrayLike, axis: ArrayLike, radius_m: float, depth_m: float, segments: int) -> Mesh:
    """Return a parabolic reflector that looks along ``axis``, 1.5 % of its diameter thick."""
    t = np.linspace(0, 1, 6)
    wall = 0.03 * radius_m
    back = [(float(radius_m * s), float(depth_m * s * s)) for s in t]
    front = [(float(radius_m * s), float(depth_m * s * s + wall)) for s in t[::-1]]
    return lathe([*back, *front], vertex_m, axis, segments)


def handrail(a_m: ArrayLike, b_m: ArrayLike, out: ArrayLike, height_m: float, radius_m: float) -> Mesh:
    """Return a rail between two feet, ``height_m`` along ``out``."""
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
    """Return the narrow strips along the surface at the given azimuths, from the first height to the last."""
    strips = []
    for az in np.deg2rad(azimuths_deg):
        half = width_m / 2 / float(np.mean(surface.radius(list(heights_m))))
        strips.append(sector(surface, (az - half, az + half), heights_m, lift_m, 0.01, 1))
    return merge(strips)


def hoop(surface: Revolved, z_m: float, width_m: float, lift_m: float, segments: int) -> Mesh:
    """Return a band round the surface."""
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
    """Return a pane in a frame that stands slightly proud."""
    az = np.deg2rad(azimuth_deg)
    n = level.segments(36)
    outer = (half_m[0] + frame_m, half_m[1] + frame_m)
    rim = pad(surface, az, z_m, outer, lift_m=lift_m, exponent=exponent, segments=n)
    pane = pad(surface, az, z_m, half_m, lift_m=lift_m + 0.004, exponent=exponent, segments=n)
    return [Piece(f"{name}_frames", frame, rim), Piece(f"{name}_panes", "window", pane)]


def stub(
    surface: Revolved, azimuth_deg: float, z_m: float, height_m: float, radius_m: float, segments: int
) -> Mesh:
    """Return a short cylinder that stands on the surface."""
    az = np.deg2rad(azimuth_deg)
    p, n = surface.point(az, z_m), surface.normal(az, z_m)
    return rod(p - 0.02 * n, p + height_m * n, radius_m, segments)
