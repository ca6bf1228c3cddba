"""Tango's sensors and small antennas: on the bottom, the holed bar, and the domes and spikes of the sides."""

from __future__ import annotations

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.level import facets
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import circle, prism, rectangle
from tools.craft.shapes.solids import box, cone, dome, lathe, rod
from tools.craft.tango.dimensions import (
    BAR_HIGH_M,
    BAR_LOW_M,
    BODY_X_M,
    SPIKE_RADIUS_M,
    SPIKE_TIP_M,
    SPIKE_Y_M,
    SPIKE_Z_M,
)

RING_CENTRE_Y_M, RING_RADIUS_M = 0.041, 0.247
"""The three outer instruments lie on this circle about (0, RING_CENTRE_Y_M)."""
BAR_TUBES_X_M = (-0.320, -0.277, -0.234, -0.190, -0.147)
BAR_Z_M = -0.0205
DOME_Y_M, DOME_Z_M, DOME_RADIUS_M = -0.083, 0.2435, 0.044


def build_instruments(detail: Detail = "full") -> list[Piece]:
    """Return all sensors and transmitters except the rod antennas."""
    return [*build_bottom_instruments(detail), *_holed_bar(detail), *_side_antennas(detail)]


def build_bottom_instruments(detail: Detail = "full") -> list[Piece]:
    """Return the instruments of the bottom plate, which both geometries of Tango carry."""
    dark, bright, grey = _bottom_instruments(detail)
    return [
        Piece("bottom_instruments", "instrument-black", merge(dark)),
        Piece("bottom_instrument_caps", "white-paint", merge(bright)),
        Piece("bottom_covers", "plate-edge", merge(grey)),
    ]


def _bottom_instruments(detail: Detail) -> tuple[list[Mesh], list[Mesh], list[Mesh]]:
    """Return four dark instruments, their bright fittings and the grey covers, all below z = 0."""
    shield = [
        (-0.0210, 0.0440), (-0.0120, 0.0390), (0.0120, 0.0390), (0.0210, 0.0440), (0.0240, 0.0270),
        (0.0290, 0.0080),
        (0.0285, -0.0080), (0.0230, -0.0260), (0.0130, -0.0430), (-0.0130, -0.0430), (-0.0230, -0.0260),
        (-0.0285, -0.0080), (-0.0290, 0.0080), (-0.0240, 0.0270),
    ]  # fmt: skip
    dark, bright, grey = [], [], []
    for angle in np.deg2rad([-90.0, 30.0, 150.0]):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        aside = np.array([-np.sin(angle), np.cos(angle), 0.0])
        o = np.array([0.0, RING_CENTRE_Y_M, 0.0]) + RING_RADIUS_M * out
        # out x aside is +z, so -aside turns the plate's outside to -z
        dark.append(prism([(b, -a) for a, b in shield], 0.013, origin_m=o, u=out, v=-aside))
        grey.append(cone(o - (0, 0, 0.012), o - (0, 0, 0.0240), 0.0060, 0.0060, facets(detail, 6)))
        for side in (-1, 1):
            p = o + side * 0.0325 * aside - 0.004 * out
            bright.append(rod(p, p - (0, 0, 0.0175), 0.0040, facets(detail, 10)))
    centre = np.array([0.0004, RING_CENTRE_Y_M, 0.0])
    corner = np.deg2rad([-102.0, 15.0, 135.0])
    plate = [(0.050 * np.cos(t), -0.050 * np.sin(t)) for t in corner]
    dark.append(prism(plate, 0.012, origin_m=centre - (0, 0, 0.003), u=(1, 0, 0), v=(0, -1, 0)))
    for t in corner:
        p = centre + 0.0525 * np.array([np.cos(t), np.sin(t), 0])
        grey.append(rod(p, p - (0, 0, 0.018), 0.0055, facets(detail, 12)))
    bright.append(cone(centre, centre - (0, 0, 0.030), 0.0100, 0.0085, facets(detail, 20)))
    for k in range(5):
        t = np.deg2rad(72.0 * k - 102.0)
        p = centre + 0.0160 * np.array([np.cos(t), np.sin(t), 0]) - (0, 0, 0.015)
        bright.append(dome(p, (0, 0, -1), 0.0065, 0.0050, facets(detail, 12), 4))
    # face covers, three sighting holes, and the sensor on the +y edge
    grey.append(box((-0.1242, -0.1961, -0.003), (-0.0897, -0.1744, 0.0)))
    grey.append(box((0.0187, 0.1850, -0.003), (0.0524, 0.2051, 0.0)))
    dark += [
        rod((x, y, 0), (x, y, -0.0015), 0.003, facets(detail, 12))
        for x, y in ((-0.0495, -0.14), (-0.0862, 0.2307), (0.15, 0.2306))
    ]
    bright.append(box((-0.0230, 0.2740, -0.020), (0.0250, 0.3130, 0.0), 0.002))
    bright.append(cone((0.0, 0.2860, -0.020), (0.0, 0.2860, -0.027), 0.014, 0.012, facets(detail, 20)))
    dark.append(rod((0.0060, 0.3125, -0.0105), (0.0060, 0.3145, -0.0105), 0.0055, facets(detail, 16)))
    return dark, bright, grey


def _holed_bar(detail: Detail) -> list[Piece]:
    """Return a white bar with three round holes, five tubes behind it and two brackets up to the bottom plate."""
    x0, y0, z0 = BAR_LOW_M
    x1, y1, z1 = BAR_HIGH_M
    holes = [circle((x, BAR_Z_M), 0.0098, facets(detail, 24)) for x in BAR_TUBES_X_M[1:4]]
    # u = x, v = z: the prism thickens to -y
    plate = prism(
        rectangle((x0, z0), (x1, z1)), y1 - y0, holes=holes, origin_m=(0, y1, 0), u=(1, 0, 0), v=(0, 0, 1)
    )
    white = [plate]
    black = []
    for k, x in enumerate(BAR_TUBES_X_M):
        if 0 < k < 4:
            black.append(
                cone((x, y1 - 0.0005, BAR_Z_M), (x, -0.2540, BAR_Z_M), 0.0120, 0.0120, facets(detail, 24))
            )
        else:
            white.append(
                cone((x, y1 - 0.001, BAR_Z_M), (x, -0.2480, BAR_Z_M), 0.0105, 0.0105, facets(detail, 24))
            )
            rim = [(0.0065, 0), (0.0085, 0), (0.0085, 0.0012), (0.0065, 0.0012), (0.0065, 0)]
            white.append(lathe(rim, (x, y0 + 0.0004, BAR_Z_M), (0, -1, 0), facets(detail, 24)))
        white.append(cone((x, -0.2560, BAR_Z_M), (x, -0.2050, BAR_Z_M), 0.0075, 0.0065, facets(detail, 16)))
    white.append(box((x0 + 0.006, -0.2480, -0.024), (x1 - 0.006, -0.2440, -0.017)))
    posts = [box((x - 0.004, -0.2500, -0.026), (x + 0.004, -0.2420, 0.0)) for x in (-0.2985, -0.1685)]
    return [
        Piece("bar", "white-paint", merge(white)),
        Piece("bar_apertures", "instrument-black", merge(black)),
        Piece("bar_posts", "plate-edge", merge(posts)),
    ]


def _side_antennas(detail: Detail) -> list[Piece]:
    """Return the parts on both +-x faces: a shallow dome with four bolts, a triangular plate with a dark dome, a
    spike.
    """
    x = BODY_X_M
    t = np.linspace(0, np.pi / 2, 7)[:-1]
    arc = [(DOME_RADIUS_M * np.cos(a), 0.004 + 0.007 * np.sin(a)) for a in t]
    domes = [
        lathe(
            [(0, 0), (DOME_RADIUS_M, 0), *arc, (0, 0.011)],
            (x, DOME_Y_M, DOME_Z_M),
            (1, 0, 0),
            facets(detail, 48),
        )
    ]
    bolts = [
        rod(
            (x + 0.004, DOME_Y_M + a * 0.0255, DOME_Z_M + b * 0.0255),
            (x + 0.0105, DOME_Y_M + a * 0.0255, DOME_Z_M + b * 0.0255),
            0.0030,
            facets(detail, 10),
        )
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    triangle = [(SPIKE_Y_M - 0.034, 0.2225), (SPIKE_Y_M + 0.034, 0.2225), (SPIKE_Y_M, 0.2810)]
    plate = prism(triangle, 0.002, origin_m=(x, 0, 0), u=(0, 1, 0), v=(0, 0, 1))
    bolts += [
        rod((x, SPIKE_Y_M + a, z), (x + 0.0045, SPIKE_Y_M + a, z), 0.0022, facets(detail, 8))
        for a, z in ((-0.0265, 0.2265), (0.0265, 0.2265), (0.0, 0.2725))
    ]
    knob = [(0.0150 * np.cos(a), 0.012 + 0.006 * np.sin(a)) for a in t]
    base = [
        lathe(
            [(0, 0), (0.0150, 0), *knob, (0, 0.018)], (x, SPIKE_Y_M, SPIKE_Z_M), (1, 0, 0), facets(detail, 24)
        ),
        cone(
            (x + 0.015, SPIKE_Y_M, SPIKE_Z_M),
            (x + 0.024, SPIKE_Y_M, SPIKE_Z_M),
            0.0060,
            0.0050,
            facets(detail, 16),
        ),
    ]
    spike = rod(
        (x + 0.015, SPIKE_Y_M, SPIKE_Z_M),
        (SPIKE_TIP_M, SPIKE_Y_M, SPIKE_Z_M),
        SPIKE_RADIUS_M,
        facets(detail, 10),
    )

    def both(meshes: list[Mesh]) -> Mesh:
        return merge([m for mesh in meshes for m in (mesh.mirrored(0), mesh)])

    return [
        Piece("side_domes", "antenna-grey", both(domes)),
        Piece("side_bolts", "interconnect", both(bolts)),
        Piece("spike_plates", "plate-edge", both([plate])),
        Piece("spike_bases", "instrument-black", both(base)),
        Piece("spikes", "interconnect", both([spike])),
    ]
