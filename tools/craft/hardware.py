"""Hardware that many craft carry: nozzles, tanks, star trackers, thrusters, tape antennas, bolts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.level_of_detail import Detail
from tools.craft.assemble import Piece
from tools.craft.level import facets
from tools.craft.shapes.mesh import Mesh, merge, unit
from tools.craft.shapes.solids import bar, cone, lathe, rod

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

BELL_STEPS: dict[Detail, int] = {"full": 12, "medium": 6, "low": 3}
TAPE_STEPS: dict[Detail, int] = {"full": 8, "medium": 4, "low": 2}


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
    """A bell nozzle, hollow, closed at the throat: a parabola from throat to exit, as Rao's optimum nearly is.

    Parameters
    ----------
    throat_m : (3,) centre of the throat. axis : (3,) direction of the exhaust.
    wall_m : thickness of the wall. segments : facets round the axis at full detail.

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
    """A ball with a meridian step equal to its facets, poles on z."""
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
    """An open ring or pipe: its bore goes through."""
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
    """A pot: a pipe with a closed bottom of thickness ``floor_m``."""
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
    """A conical baffle, black inside, on a short housing."""
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
    """A small thruster: a valve block, a neck and a cone with a hollow end."""
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
    """A tape antenna: a flat strip whose face looks along ``face``; a curl of ``sag_m`` stands as segments.

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
    """Heads of bolts at points of a face."""
    w = unit(axis)
    n = facets(detail, 12)
    return merge([rod(np.asarray(p, float), np.asarray(p, float) + w * height_m, radius_m, n) for p in at_m])


def socket_screws(
    at_m: Sequence[ArrayLike], axis: ArrayLike, radius_m: float, height_m: float, detail: Detail
) -> Mesh:
    """Screws with a rounded head and a socket in it, at points of a face (ISO 7380: button heads)."""
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
