"""Dimensions of Soyuz MS, for its geometry and its labels alike.

Frame: z along the long axis towards the docking probe, origin where descent and service module meet, x along the
solar wings, whose cells look to +y.

References
----------
Wikipedia, Soyuz MS (2024): greatest diameter 2.72 m, wings 10.7 m from tip to tip, 7,080 kg. Hall & Shayler (2003),
Soyuz: A Universal Spacecraft: length 7.48 m, crew modules 2.2 m wide, modules 2.6 to 3.0, 2.1 to 2.2 and 2.3 to 2.5 m
long. Fittings: judged from photographs.
"""

from __future__ import annotations

import numpy as np

from tools.craft.shapes.wrapped import Revolved
from tools.craft.wings import SideWings, Wing

SKIRT_RADIUS_M = 1.36
SKIRT_LOW_M = -2.52
SKIRT_EDGE_M = -2.30
"""The flared skirt is widest from ``SKIRT_EDGE_M`` down to the base plane."""
DRUM_RADIUS_M = 1.075
DRUM_LOW_M, DRUM_HIGH_M = -1.50, -0.42
BASE_LOW_M = -2.20
"""Bottom plate of the service module, inside the skirt."""
DESCENT_RADIUS_M = 1.085
ORBITAL_RADIUS_M = 1.13
ORBITAL_LOW_M, ORBITAL_HIGH_M = 3.02, 3.34
"""Centres of the two hemispheres of the orbital module."""
COLLAR_RADIUS_M, COLLAR_M = 0.68, 4.55
"""Docking collar: outer radius and docking plane."""
PROBE_TIP_M = 4.96


def _orbital() -> list[tuple[float, float]]:
    """Return the orbital module's profile from its lower collar to the docking collar."""
    low = [
        (float(ORBITAL_RADIUS_M * np.cos(t)), float(ORBITAL_LOW_M + ORBITAL_RADIUS_M * np.sin(t)))
        for t in np.linspace(np.deg2rad(-60), 0, 9)
    ]
    high = [
        (float(ORBITAL_RADIUS_M * np.cos(t)), float(ORBITAL_HIGH_M + ORBITAL_RADIUS_M * np.sin(t)))
        for t in np.linspace(0, np.deg2rad(54), 9)
    ]
    return [*low, *high]


ORBITAL_PROFILE = tuple(_orbital())
DESCENT_PROFILE = (
    (1.085, 0.04), (1.092, 0.16), (1.075, 0.40), (1.045, 0.65), (1.000, 0.92), (0.935, 1.18), (0.845, 1.42),
    (0.730, 1.62), (0.600, 1.77),
)  # fmt: skip
"""The descent module's bell: radius and height."""
SKIRT_PROFILE = ((SKIRT_RADIUS_M, SKIRT_LOW_M), (SKIRT_RADIUS_M, SKIRT_EDGE_M), (DRUM_RADIUS_M, DRUM_LOW_M))

ORBITAL = Revolved.from_profile(ORBITAL_PROFILE)
DESCENT = Revolved.from_profile(DESCENT_PROFILE)
DRUM = Revolved.from_profile([(DRUM_RADIUS_M, DRUM_LOW_M), (DRUM_RADIUS_M, DRUM_HIGH_M)])
SKIRT = Revolved.from_profile(SKIRT_PROFILE)

WINGS = SideWings(
    wing=Wing(
        panels=4,
        first_m=2.02,
        length_m=0.81,
        gap_m=0.03,
        chord_m=1.35,
        thickness_m=0.025,
        cells=(9, 18),
        margin_m=0.03,
    ),
    root_m=1.18,
    z_m=-1.86,
    spread=0.55,
    section_m=0.045,
    ribs=3,
    rib_m=0.02,
    cells="solar-cell-blue",
    panels="panel-back",
    back="white-seam",
)
