"""Tango's dimensions in the SPEED frame [m]: origin on the bottom plate, z out of the solar panel.

Keypoints: the SPEED data set's published labels. Sizes of the fittings: measured from public images of
the PRISMA mission's Tango. Two views of one feature agree to 1 to 5 mm for most, to 10 to 16 mm for the
bar and the rod, and to 25 mm for the faint tips of the spikes.
"""

from __future__ import annotations

from dataclasses import dataclass

from flyaround.simulator.runtime.arrays import Vec3

PANEL_X_M = 0.370
PANEL_Y_M = 0.385
PANEL_TOP_M = 0.3215
PANEL_BOTTOM_M = 0.3010
FRAME_X_M = 0.024
"""Width of the panel frame along its +-x edges; with the strip and eight cells it makes 0.74 m."""
FRAME_Y_M = 0.017
STRIP_M = 0.028
CELL_PITCH_X_M = 0.083
CELL_PITCH_Y_M = 0.0433

BODY_X_M = 0.370
BODY_Y_LOW_M = -0.264
BODY_Y_HIGH_M = 0.304
BODY_TOP_M = 0.2895
CORE_TOP_M = 0.268
SIDE_PLATE_M = 0.016
BOTTOM_PLATE_M = 0.022

ANTENNA_TIPS: tuple[Vec3, Vec3, Vec3] = (
    (-0.5427, 0.4877, 0.2535),
    (0.5427, 0.4877, 0.2591),
    (0.3050, -0.5790, 0.2515),
)
ANTENNA_ROOTS: tuple[Vec3, Vec3, Vec3] = (
    (-0.300, 0.346, 0.256),
    (0.300, 0.350, 0.255),
    (0.306, -0.299, 0.250),
)
ANTENNA_COLLAR_M = 0.066
"""Distance from the root, along the axis, of the collar where the thick part starts."""
ANTENNA_RADIUS_COLLAR_M = 0.030
ANTENNA_RADIUS_TIP_M = 0.0245
ANTENNA_RADIUS_STUB_M = 0.018

SPIKE_Y_M = 0.0205
SPIKE_Z_M = 0.2405
SPIKE_TIP_M = 0.538
SPIKE_RADIUS_M = 0.0025

ROD_X_M, ROD_Y_M = -0.3935, 0.2315
ROD_RADIUS_M = 0.0082
ROD_BOTTOM_M, ROD_TOP_M = -0.083, 0.300

CONNECTOR_OUTLINE_M = (
    (-0.0465, 0.3925),
    (0.0665, 0.3925),
    (0.0665, 0.4340),
    (-0.0062, 0.4340),
    (-0.0062, 0.4590),
    (-0.0465, 0.4590),
)
CONNECTOR_BOTTOM_M, CONNECTOR_TOP_M = 0.3005, 0.3175

SIDE_BOX_LOW_M: Vec3 = (0.3700, 0.1160, 0.2640)
SIDE_BOX_HIGH_M: Vec3 = (0.3960, 0.1550, 0.3195)

WHITE_PLATE_LOW_M: Vec3 = (-0.0780, 0.3120, 0.0200)
WHITE_PLATE_HIGH_M: Vec3 = (0.1930, 0.3280, 0.1610)

BAR_LOW_M: Vec3 = (-0.3290, -0.2710, -0.0335)
BAR_HIGH_M: Vec3 = (-0.1375, -0.2670, -0.0075)


@dataclass(frozen=True, kw_only=True)
class TangoDimensions:
    """Differences of the two published geometries of Tango [m]; builders take one set whole, never a mixture.

    Parameters
    ----------
    panel_x_m : float
        Half extent of the solar panel along x.
    panel_y_m : float
        Half extent of the solar panel along y.
    panel_bottom_m : float
        Height of the panel's lower face.
    panel_top_m : float
        Height of the panel's upper face.
    columns : int
        Number of cell columns in each of the panel's two fields.
    rows : int
        Number of cell rows in each of the panel's two fields.
    cell_pitch_x_m : float
        Spacing of the cells along x.
    cell_pitch_y_m : float
        Spacing of the cells along y.
    body_x_m : float
        Half extent of the body along x.
    body_y_low_m : float
        Lower y of the body.
    body_y_high_m : float
        Upper y of the body.
    body_top_m : float
        Height of the body.
    core_top_m : float
        Height of the core below the panel.
    antenna_roots : tuple of Vec3
        Root of each rod antenna.
    antenna_tips : tuple of Vec3
        Tip of each rod antenna.
    antenna_collar_m : float
        From the root to the thick part.
    """

    panel_x_m: float
    panel_y_m: float
    panel_bottom_m: float
    panel_top_m: float
    columns: int
    rows: int
    cell_pitch_x_m: float
    cell_pitch_y_m: float
    body_x_m: float
    body_y_low_m: float
    body_y_high_m: float
    body_top_m: float
    core_top_m: float
    antenna_roots: tuple[Vec3, ...]
    antenna_tips: tuple[Vec3, ...]
    antenna_collar_m: float


SPEED = TangoDimensions(
    panel_x_m=PANEL_X_M,
    panel_y_m=PANEL_Y_M,
    panel_bottom_m=PANEL_BOTTOM_M,
    panel_top_m=PANEL_TOP_M,
    columns=4,
    rows=17,
    cell_pitch_x_m=CELL_PITCH_X_M,
    cell_pitch_y_m=CELL_PITCH_Y_M,
    body_x_m=BODY_X_M,
    body_y_low_m=BODY_Y_LOW_M,
    body_y_high_m=BODY_Y_HIGH_M,
    body_top_m=BODY_TOP_M,
    core_top_m=CORE_TOP_M,
    antenna_roots=ANTENNA_ROOTS,
    antenna_tips=ANTENNA_TIPS,
    antenna_collar_m=ANTENNA_COLLAR_M,
)
"""The geometry of the SPEED data sets; the thesis's stands in craft/tango_thesis.py."""
