"""Cargo Dragon's dimensions (2010 to 2020), for its geometry and its labels alike.

Frame: z along the axis of symmetry towards the berthing port, origin where capsule and trunk meet, x along the solar
wings, whose cells look to +y.

References
----------
SpaceX and NASA, CRS-6 press kit (2015): capsule 4.4 m and trunk 2.8 m high, both 3.66 m wide, wings 16.5 m from tip
to tip. The 6.1 m that others give is taken as the height without the nose cap, which is left on the way to orbit.
Common Berthing Mechanism, passive half: ring about 2 m wide. Fittings: judged from photographs.
"""

from __future__ import annotations

import numpy as np

from tools.craft.shapes.wrapped import Revolved
from tools.craft.wings import SideWings, Wing

RIM_RADIUS_M, RIM_TOP_M = 1.83, 0.26
"""The black rim of the heat shield and its upper end."""
DECK_M = 2.72
DECK_RADIUS_M = float(RIM_RADIUS_M - (DECK_M - RIM_TOP_M) * np.tan(np.deg2rad(15.0)))
SLOPE = (float(np.cos(np.deg2rad(15.0))), float(np.sin(np.deg2rad(15.0))))
"""Outward normal of the sidewall: radial and axial."""
PORT_RADIUS_M, PORT_M = 1.02, 3.30
SHOULDER_RADIUS_M, SHOULDER_HIGH_M = 0.97, 2.82
"""Inner end of the shoulder between sidewall and port."""
CAP_HEIGHT_M = 1.10
"""Height of the nose cap above the berthing plane at launch."""
TRUNK_RADIUS_M, TRUNK_INNER_M = 1.83, 1.78
TRUNK_LOW_M, TRUNK_HIGH_M = -2.80, -0.03
BAY_AZIMUTH_DEG, BAY_Z_M = 90.0, 0.78
"""Sensor bay behind its open door, with the grapple fixture."""
HATCH_HALF_M = 0.60
CLAW_LOW_M, CLAW_HIGH_M = (-0.16, -2.03, -0.50), (0.16, -1.73, 0.36)
"""Fairing of the umbilical between capsule and trunk."""

SIDEWALL = Revolved.from_profile([(RIM_RADIUS_M, RIM_TOP_M), (DECK_RADIUS_M, DECK_M)])
TRUNK = Revolved.from_profile([(TRUNK_RADIUS_M, TRUNK_LOW_M), (TRUNK_RADIUS_M, TRUNK_HIGH_M)])
WINGS = SideWings(
    wing=Wing(
        panels=4,
        first_m=2.48,
        length_m=1.4125,
        gap_m=0.04,
        chord_m=1.75,
        thickness_m=0.026,
        cells=(17, 22),
        margin_m=0.03,
    ),
    root_m=TRUNK_RADIUS_M - 0.02,
    z_m=-1.50,
    spread=0.50,
    section_m=0.055,
    ribs=3,
    rib_m=0.02,
    cells="solar-cell-blue",
    panels="panel-back",
    back="white-seam",
)
