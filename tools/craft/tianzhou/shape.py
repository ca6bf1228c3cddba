"""Dimensions of Tianzhou, for its geometry and its labels alike.

Frame: z along the long axis towards the docking port, origin where propulsion and cargo module meet, x along the solar
wings, whose cells look to +y.

References
----------
Chinese Academy of Sciences, news release of 21 April 2017: length 10.6 m, greatest diameter 3.35 m, launch mass 13.5 t.
Wikipedia (de), Tianzhou: cargo module 6.3 m, propulsion module 3.3 m long and 2.8 m wide, span 14.9 m. Fittings: judged
from photographs.
"""

from __future__ import annotations

from tools.craft.shapes.wrapped import Revolved
from tools.craft.wings import SideWings, Wing

CARGO_RADIUS_M, CARGO_LOW_M, CARGO_HIGH_M = 1.675, 0.0, 5.15
CONE_RADIUS_M, CONE_HIGH_M = 0.78, 6.28
"""Forward end of the docking end's cone."""
PORT_RADIUS_M, PORT_M = 0.70, 6.80
"""Docking adapter: outer radius, docking plane."""
DRIVE_RADIUS_M, DRIVE_LOW_M, DRIVE_HIGH_M = 1.40, -3.40, -0.42
"""Propulsion module: radius, base plate, start of the cone to the cargo module."""
NECK_RADIUS_M = 1.64
"""Radius of the propulsion module's forward cone at the cargo module."""
NOZZLE_LOW_M = -3.80

CARGO = Revolved.from_profile([(CARGO_RADIUS_M, CARGO_LOW_M), (CARGO_RADIUS_M, CARGO_HIGH_M)])
CONE = Revolved.from_profile([(CARGO_RADIUS_M, CARGO_HIGH_M), (CONE_RADIUS_M, CONE_HIGH_M)])
DRIVE = Revolved.from_profile([(DRIVE_RADIUS_M, DRIVE_LOW_M), (DRIVE_RADIUS_M, DRIVE_HIGH_M)])

WINGS = SideWings(
    wing=Wing(
        panels=3,
        first_m=2.24,
        length_m=1.71,
        gap_m=0.04,
        chord_m=2.10,
        thickness_m=0.028,
        cells=(14, 30),
        margin_m=0.035,
    ),
    root_m=1.36,
    z_m=-1.55,
    spread=0.62,
    section_m=0.06,
    ribs=4,
    rib_m=0.025,
    cells="solar-cell-blue",
    panels="cell-substrate",
    back="panel-back",
)
