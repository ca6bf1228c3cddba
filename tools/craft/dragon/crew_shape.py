"""Crew Dragon's dimensions, for its geometry and its labels alike.

Frame: z along the axis of symmetry towards the docking port, origin where capsule and trunk meet, x towards the side
hatch; the solar half of the trunk and the hinge of the nose cone are on the -x side.

References
----------
SpaceX, Dragon (spacex.com/vehicles/dragon): height 8.1 m with trunk, diameter 4 m. Costello (2020),
Meet Crew Dragon, spaceflightinsider.com: capsule about 4.5 m high and 3.7 m wide, four fins. The widths are taken as
those of the heat shield's rim and of the trunk. International Docking System Standard: hard-capture ring 1.2 to 1.3 m
wide. Heights of seams, windows and pods, and the angle of the open nose cone: judged from photographs.
"""

from __future__ import annotations

import numpy as np

from tools.craft.shapes.wrapped import Revolved

WALL_RAD = np.deg2rad(15.0)
RIM_RADIUS_M = 2.0
RIM_TOP_M = 0.30
"""Upper end of the black rim of the heat shield, where the white sidewall starts."""
DECK_M = 3.40
DECK_RADIUS_M = float(RIM_RADIUS_M - (DECK_M - RIM_TOP_M) * np.tan(WALL_RAD))
"""Forward edge of the sidewall, under the nose cone."""
PORT_M, PORT_RADIUS_M = 3.95, 0.64
"""Docking plane and outer radius of the hard-capture ring."""
NOSE_HEIGHT_M = 1.05
NOSE_OPEN_RAD = np.deg2rad(172.0)
HINGE_X_M = -(DECK_RADIUS_M + 0.06)
TRUNK_RADIUS_M, TRUNK_INNER_M = 1.85, 1.80
TRUNK_LOW_M, TRUNK_HIGH_M = -3.65, -0.03
FIN_AZIMUTHS_DEG = (45.0, 135.0, 225.0, 315.0)
FIN_THICK_M = 0.06
FIN_M = ((1.83, -3.55), (2.36, -3.55), (2.36, -2.85), (1.83, -1.75))
"""Outline of a fin as (radius, height), counter-clockwise; its root lies 2 cm inside the trunk's skin."""
POD_AZIMUTHS_DEG = (48.0, 132.0, 228.0, 312.0)
POD_Z_M = 1.35
HATCH_Z_M = 1.45
WINDOW_AZIMUTHS_DEG = (-25.0, 25.0)
WINDOW_Z_M = 1.85
CLAW_LOW_M, CLAW_HIGH_M = (-2.11, -0.17, -0.55), (-1.80, 0.17, 0.42)
"""Fairing of the umbilical between capsule and trunk."""

SIDEWALL = Revolved.from_profile([(RIM_RADIUS_M, RIM_TOP_M), (DECK_RADIUS_M, DECK_M)])
TRUNK = Revolved.from_profile([(TRUNK_RADIUS_M, TRUNK_LOW_M), (TRUNK_RADIUS_M, TRUNK_HIGH_M)])


def nose_rotation() -> np.ndarray:
    """Return the (3, 3) rotation of the open nose cone about the hinge's axis, along y."""
    c, s = np.cos(-NOSE_OPEN_RAD), np.sin(-NOSE_OPEN_RAD)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def nose_point(p: np.ndarray) -> np.ndarray:
    """Return the place of a point of the closed nose cone when the cone is open."""
    hinge = np.array([HINGE_X_M, 0.0, DECK_M])
    return np.asarray(nose_rotation() @ (p - hinge) + hinge)
