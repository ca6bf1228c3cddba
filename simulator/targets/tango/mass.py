"""Tango's mass distribution: 50 kg shared out over the parts of the model.

Public figures for Tango are 40 to 50 kg; how the mass is spread is not public. The shares below follow
common small-satellite budgets (structure 20 to 25 %, power 20 to 30 %, the rest avionics and payload).
"""

from __future__ import annotations

from simulator.targets.builders.mass import Lump, mass_properties
from simulator.targets.model import MassProperties
from simulator.targets.tango.dimensions import ANTENNA_ROOTS, ANTENNA_TIPS

LUMPS = (
    Lump(name="avionics and battery", mass_kg=30.0, centre_m=(0.0, 0.02, 0.115), size_m=(0.62, 0.46, 0.19)),
    Lump(
        name="bottom plate and instruments",
        mass_kg=5.5,
        centre_m=(0.0, 0.02, 0.011),
        size_m=(0.74, 0.568, 0.022),
    ),
    Lump(name="side plate -x", mass_kg=2.4, centre_m=(-0.362, 0.02, 0.145), size_m=(0.016, 0.568, 0.29)),
    Lump(name="side plate +x", mass_kg=2.4, centre_m=(0.362, 0.02, 0.145), size_m=(0.016, 0.568, 0.29)),
    Lump(name="cover -y", mass_kg=1.2, centre_m=(0.0, -0.262, 0.145), size_m=(0.708, 0.004, 0.246)),
    Lump(name="cover +y", mass_kg=1.6, centre_m=(0.0, 0.302, 0.145), size_m=(0.708, 0.004, 0.246)),
    Lump(name="solar panel", mass_kg=4.6, centre_m=(0.0, 0.0, 0.3105), size_m=(0.74, 0.77, 0.022)),
    *(
        Lump(name=f"antenna {k + 1}", mass_kg=0.6, centre_m=root, tip_m=tip)
        for k, (root, tip) in enumerate(zip(ANTENNA_ROOTS, ANTENNA_TIPS, strict=True))
    ),
    Lump(name="connectors and fittings", mass_kg=0.5, centre_m=(0.01, 0.42, 0.30), size_m=(0.14, 0.08, 0.03)),
)


def build_mass() -> MassProperties:
    """Mass properties of Tango."""
    return mass_properties(LUMPS)
