"""Envisat's instruments and antennas as recognisable bodies on the payload module."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.envisat.dimensions import (
    BUS_END_X_M,
    BUS_HALF_Y_M,
    BUS_HALF_Z_M,
    DISH_DEPTH_M,
    DISH_RADIUS_M,
    DISH_X_M,
    KA_MAST_X_M,
    KA_RADIUS_M,
    KA_TOP_M,
    SKIN_M,
)
from tools.craft.hardware import cup, star_tracker
from tools.craft.level import facets
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.solids import box, cone, dome, lathe, rod, truss

EARTH_M = BUS_HALF_Z_M - SKIN_M
"""Height of the payload module's Earth face along z; the zenith face is opposite."""
KA_AXIS = (-0.5, 0.0, -(0.75**0.5))
KA_DEPTH_M = 0.13  # depth of the dish
KA_VERTEX = (KA_MAST_X_M + KA_AXIS[0] * 0.20, 0.75, -KA_TOP_M + 0.10 + KA_AXIS[2] * 0.20)
RING_STEPS: dict[Detail, int] = {"full": 10, "medium": 5, "low": 3}  # rings of a disc or dish


def build_instruments(detail: Detail) -> list[Piece]:
    """Return all sensors and antennas."""
    return [
        *_altimeter(detail),
        *_ka_band(detail),
        *_optical(detail),
        *_end_instruments(detail),
        *_antennas(detail),
        *_zenith_side(detail),
    ]


def reflector(
    vertex_m: tuple[float, float, float],
    axis: tuple[float, float, float],
    radius_m: float,
    depth_m: float,
    segments: int,
    detail: Detail,
) -> Mesh:
    """Return a paraboloid dish of 15 mm wall, its rim ``depth_m`` above its vertex."""
    r = np.linspace(0, radius_m, RING_STEPS[detail] + 1)
    h = depth_m * (r / radius_m) ** 2
    wall = 0.015
    outer = [(float(a), float(b) - wall) for a, b in zip(r, h, strict=True)]
    inner = [(float(a), float(b)) for a, b in zip(r, h, strict=True)][::-1]
    return lathe([*outer, *inner], vertex_m, axis, facets(detail, segments))


def _altimeter(detail: Detail) -> list[Piece]:
    """Return RA-2: dish, feed on a tripod, foot."""
    z = EARTH_M + 0.24
    dish = reflector((DISH_X_M, 0, z), (0, 0, 1), DISH_RADIUS_M, DISH_DEPTH_M, 64, detail)
    foot = cone((DISH_X_M, 0, EARTH_M - 0.01), (DISH_X_M, 0, z - 0.008), 0.22, 0.14, facets(detail, 32))
    feed = cone((DISH_X_M, 0, z + 0.50), (DISH_X_M, 0, z + 0.62), 0.05, 0.08, facets(detail, 24))
    legs = [
        rod(
            (DISH_X_M + 0.55 * np.cos(a), 0.55 * np.sin(a), z + 0.165),
            (DISH_X_M + 0.04 * np.cos(a), 0.04 * np.sin(a), z + 0.58),
            0.012,
            facets(detail, 12),
        )
        for a in np.deg2rad([90, 210, 330])
    ]
    return [
        Piece("ra2_dish", "white-paint", dish),
        Piece("ra2_foot", "mli-gold", foot),
        Piece("ra2_feed", "grey-paint", merge([feed, *legs])),
    ]


def _ka_band(detail: Detail) -> list[Piece]:
    """Return the Ka-band relay antenna on its mast over the zenith side."""
    x, n = KA_MAST_X_M, facets(detail, 24)
    base = -BUS_HALF_Z_M
    mast = rod((x, 0.75, base + 0.03), (x, 0.75, -KA_TOP_M + 0.12), 0.06, n)
    head = box((x - 0.14, 0.61, -KA_TOP_M + 0.02), (x + 0.14, 0.89, -KA_TOP_M + 0.26), 0.02)
    axis, vertex = KA_AXIS, KA_VERTEX
    dish = reflector(vertex, axis, KA_RADIUS_M, KA_DEPTH_M, 48, detail)
    tip = np.asarray(vertex) + 0.34 * np.asarray(axis)
    feed = cone(np.asarray(vertex) - 0.14 * np.asarray(axis), tip, 0.035, 0.035, n)
    return [
        Piece("ka_mast", "carbon-fibre", mast),
        Piece("ka_head", "mli-silver", head),
        Piece("ka_dish", "white-paint", dish),
        Piece("ka_feed", "grey-paint", feed),
    ]


def _optical(detail: Detail) -> list[Piece]:
    """Return MERIS, AATSR and the microwave radiometer on the Earth side."""
    z = EARTH_M
    meris = box((-8.05, -1.15, z - 0.02), (-7.30, -0.25, z + 0.55), 0.02)
    fans = [box((-7.98 + 0.13 * k, -1.05, z + 0.54), (-7.90 + 0.13 * k, -0.80, z + 0.565)) for k in range(5)]
    aatsr = box((-9.75, -1.20, z - 0.02), (-8.60, -0.35, z + 0.60), 0.02)
    drum = cup((-9.2, -0.78, z + 0.59), (0, 0, 1), 0.30, 0.26, 0.32, 0.05, 48, detail)
    hood = cup((-8.75, -0.78, z + 0.59), (0.5, 0, 0.866), 0.14, 0.12, 0.30, 0.03, 32, detail)
    mwr = box((-8.0, 0.40, z - 0.02), (-7.4, 1.15, z + 0.30), 0.02)
    # an offset reflector on two posts
    dish = reflector((-8.25, 0.80, z + 0.42), (0.5, 0, 0.866), 0.30, 0.07, 48, detail)
    nodes = np.array(
        [(-8.4, 0.62, z - 0.01), (-8.30, 0.70, z + 0.40), (-8.4, 0.98, z - 0.01), (-8.30, 0.90, z + 0.40)]
    )
    posts = truss(nodes, [(0, 1), (2, 3)], 0.02, facets(detail, 12))
    return [
        Piece("meris", "mli-gold", meris),
        Piece("meris_apertures", "black-paint", merge(fans)),
        Piece("aatsr", "mli-gold", aatsr),
        Piece("aatsr_baffles", "black-paint", merge([drum, hood])),
        Piece("mwr", "mli-silver", mwr),
        Piece("mwr_dish", "white-paint", dish),
        Piece("mwr_posts", "carbon-fibre", posts),
    ]


def _end_instruments(detail: Detail) -> list[Piece]:
    """Return MIPAS, GOMOS and SCIAMACHY at the far end of the bus, within the bus's own length."""
    x0 = BUS_END_X_M
    y = BUS_HALF_Y_M
    mipas = box((x0 + 0.05, -0.55, -EARTH_M - 0.62), (x0 + 1.45, 0.65, -EARTH_M + 0.01), 0.03)
    baffle = cup((x0 + 0.60, -0.54, -EARTH_M - 0.32), (0, -1, 0), 0.22, 0.19, 0.42, 0.03, 48, detail)
    cooler = cup((x0 + 0.50, 0.05, -EARTH_M - 0.61), (0, 0, -1), 0.28, 0.25, 0.25, 0.03, 48, detail)
    gomos = box((x0 + 0.10, y - SKIN_M - 0.01, -0.45), (x0 + 0.95, y + 0.48, 0.35), 0.03)
    steering = cup((x0 + 0.52, y + 0.47, -0.05), (0, 1, 0), 0.24, 0.21, 0.30, 0.03, 48, detail)
    scia = box((x0 + 0.15, -y - 0.42, -0.40), (x0 + 1.10, -y + SKIN_M + 0.01, 0.45), 0.03)
    limb = box((x0 + 0.35, -y - 0.47, 0.02), (x0 + 0.85, -y - 0.41, 0.26))
    radiator = box((x0 + 0.20, -y - 0.35, -0.42), (x0 + 1.05, -y - 0.06, -0.395))
    return [
        Piece("mipas", "mli-gold", mipas),
        Piece("mipas_baffle", "black-paint", merge([baffle, cooler])),
        Piece("gomos", "mli-silver", gomos),
        Piece("gomos_baffle", "black-paint", steering),
        Piece("sciamachy", "mli-gold", scia),
        Piece("sciamachy_slits", "black-paint", limb),
        Piece("sciamachy_radiator", "radiator-mirror", radiator),
    ]


def _antennas(detail: Detail) -> list[Piece]:
    """Return DORIS, the laser retroreflector, X-band and S-band antennas on the Earth side."""
    z = EARTH_M
    n = facets(detail, 24)
    doris = [
        rod((-5.6, 0.95, z - 0.01), (-5.6, 0.95, z + 0.30), 0.05, n),
        cone((-5.6, 0.95, z + 0.29), (-5.6, 0.95, z + 0.62), 0.08, 0.06, n),
    ]
    xband = cup((-5.5, -0.90, z + 0.02), (0, 0, 1), 0.19, 0.17, 0.16, 0.02, 48, detail)
    post = cone((-5.5, -0.90, z - 0.01), (-5.5, -0.90, z + 0.03), 0.08, 0.08, n)
    sband = [
        lathe(
            [(0, 0), (0.03, 0), (0.03, 0.25), (0.10, 0.32), (0, 0.36)],
            (-1.2, sy, BUS_HALF_Z_M - 0.005),
            (0, 0, 1),
            n,
        )
        for sy in (-0.95, 0.95)
    ]
    retro = dome(
        (-2.15, 0.5, BUS_HALF_Z_M - 0.005), (0, 0, 1), 0.13, 0.11, facets(detail, 32), RING_STEPS[detail]
    )
    prisms = [
        rod(
            np.array([-2.15, 0.5, BUS_HALF_Z_M])
            + 0.09 * np.array([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)]),
            np.array([-2.15, 0.5, BUS_HALF_Z_M])
            + 0.135 * np.array([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), np.cos(t)]),
            0.02,
            facets(detail, 16),
        )
        for t, a in [(0.0, 0.0), *((0.85, a) for a in 2 * np.pi * np.arange(8) / 8)]
    ]
    return [
        Piece("doris", "white-paint", merge(doris)),
        Piece("x_band", "white-paint", merge([xband, post])),
        Piece("s_band", "white-paint", merge(sband)),
        Piece("retroreflector", "grey-paint", retro),
        Piece("retroreflector_prisms", "lens", merge(prisms)),
    ]


def _zenith_side(detail: Detail) -> list[Piece]:
    """Return the electronics under blankets on the zenith side, and two star trackers."""
    z = -EARTH_M
    boxes = [
        box((-8.2, 0.15, z - 0.28), (-7.1, 1.10, z + 0.01), 0.02),
        box((-8.0, -1.10, z - 0.20), (-6.9, -0.10, z + 0.01), 0.02),
        box((-6.5, 0.20, z - 0.34), (-5.3, 1.00, z + 0.01), 0.02),
        box((-6.3, -1.05, z - 0.24), (-5.2, -0.25, z + 0.01), 0.02),
        box((-4.8, -1.00, z - 0.18), (-3.7, 0.30, z + 0.01), 0.02),
    ]
    pieces = [
        Piece("electronics_black", "mli-black", merge(boxes[1::2])),
        Piece("electronics_gold", "mli-gold", merge(boxes[::2])),
    ]
    for k, y in enumerate((-0.5, 0.5)):
        pieces += star_tracker(
            f"star_tracker_{k + 1}",
            (-1.7, y, -BUS_HALF_Z_M),
            (0.0, 0.5 * np.sign(y), -0.866),
            0.13,
            0.42,
            detail,
        )
    return pieces
