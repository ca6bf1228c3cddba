"""Sizes of Chang'e-6's ascent vehicle [m], and the two outlines that its parts share."""

from __future__ import annotations

from flyaround.simulator.runtime.arrays import FloatArray
from tools.craft.shapes.prism import circle, clipped_rectangle

WIDTH_M = 1.50
CUT_M = 0.36
"""The octagon is the square of the body's width with its corners cut by this much."""
DECK_M = 0.035
BODY_TOP_M = 1.02
CORE_INSET_M = 0.035
"""The insulated walls stand this far inside the decks' rims."""
TANK_RADIUS_M, TANK_XY_M, TANK_Z_M = 0.330, 0.535, 0.44
ENGINE_EXIT_M, ENGINE_WALL_M, ENGINE_LENGTH_M, ENGINE_TOP_M = 0.235, 0.006, 0.560, -0.06
WING_RADIUS_M, WING_Y_M, WING_Z_M, WING_PLATE_M = 0.70, 1.56, 0.93, 0.022
WING_SIDES = 16
GRIP_RADIUS_M, GRIP_TOP_M = 0.40, BODY_TOP_M + 0.17
PORT_RADIUS_M, PORT_TOP_M = 0.240, BODY_TOP_M + 0.12
CELL_M = (0.0612, 0.0412)


def octagon(inset_m: float = 0.0) -> FloatArray:
    """Return the (8, 2) outline of a deck, counter-clockwise, moved inwards by ``inset_m``."""
    h = WIDTH_M / 2 - inset_m
    # the cut faces move along the diagonal by the same distance
    return clipped_rectangle(2 * h, 2 * h, CUT_M - inset_m * (2 - 2**0.5), "all")


def wing_outline() -> FloatArray:
    """Return the (16, 2) outline of the wing on +y, a vertex furthest out."""
    return circle((0.0, WING_Y_M), WING_RADIUS_M, WING_SIDES)
