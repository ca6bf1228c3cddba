"""Envisat's dimensions [m] in the frame of the launcher interface.

Frame: origin at the middle of the launcher's interface plane, x along the long axis out of it (towards the array),
z towards the Earth in its former attitude, y completes; the bus lies at negative x. In such a frame ESA quotes the
centre of mass of the dead craft at x = -3.9 m.

Sources: ESA and eoPortal, Envisat: bus 10 x 2.75 x 1.6 m, deployed 26 x 10 x 5 m, solar array 14 x 5 m of 14
panels, ASAR antenna 10 x 1.3 m of 5 panels with 4 tiles each; Estable et al., Capturing and deorbiting Envisat
with an airbus spacetug, CEAS Space Journal 12 (2020), for about 7,800 kg, centre of mass and inertia. Places of the
instruments follow ESA's drawings by eye; the interface ring is drawn as wide as the bus is high.
"""

from __future__ import annotations

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3

BUS_END_X_M = -10.0
BUS_HALF_Y_M, BUS_HALF_Z_M = 1.375, 0.800
SERVICE_END_X_M = -2.6
"""The service module ends here and the payload module begins."""
SKIN_M = 0.020
"""The payload module's blankets lie this far inside the service module's faces; its decks do not."""

ARRAY_ROOT_X_M, ARRAY_LENGTH_M = 2.0, 14.0
ARRAY_HALF_Y_M = 2.5
ARRAY_PANELS, ARRAY_PITCH_M, ARRAY_GAP_M = 14, 1.0, 0.020
ARRAY_PLATE_M = 0.024
ARRAY_TILT_RAD = np.deg2rad(22.0)
"""Angle at which the drive rests: the cells' normal leans from -z towards -y, about x."""
ARRAY_U: Vec3 = (1.0, 0.0, 0.0)
ARRAY_V: Vec3 = (0.0, -float(np.cos(ARRAY_TILT_RAD)), float(np.sin(ARRAY_TILT_RAD)))

ASAR_HALF_Y_M, ASAR_HALF_WIDTH_M, ASAR_PLATE_M = 5.0, 0.65, 0.070
ASAR_PANELS, ASAR_GAP_M = 5, 0.012
ASAR_CENTRE: Vec3 = (-4.10, 0.0, 1.38)
"""Middle of the antenna's radiating face, which crosses the bus on the Earth side."""
ASAR_TILT_RAD = np.deg2rad(20.0)
"""The antenna looks down and aside: its normal leans from z towards x."""
ASAR_U: Vec3 = (0.0, 1.0, 0.0)
ASAR_V: Vec3 = (-float(np.cos(ASAR_TILT_RAD)), 0.0, float(np.sin(ASAR_TILT_RAD)))

DISH_X_M, DISH_RADIUS_M, DISH_DEPTH_M = -6.55, 0.60, 0.20
"""RA-2, the altimeter: a dish of 1.2 m that looks at the Earth."""
KA_MAST_X_M, KA_TOP_M, KA_RADIUS_M = -3.2, 2.30, 0.45
"""Ka-band antenna of 0.9 m on a mast of some two metres on the zenith side."""
RING_RADIUS_M, RING_M = 0.76, 0.11
"""The interface ring, which a debris remover would grasp."""
