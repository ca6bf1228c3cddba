"""Mass of round bodies: cylinders and tubes about the craft's z axis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.targets.builders.mass import MassElement


@dataclass(frozen=True, kw_only=True)
class Tube(MassElement):
    """A uniform cylinder about z through ``centre_m``, hollow inside ``inner_m``.

    Parameters
    ----------
    radius_m : outer radius. length_m : along z. inner_m : inner radius, zero when solid.
    """

    radius_m: float
    length_m: float
    inner_m: float = 0.0

    def inertia(self) -> FloatArray:
        """(3, 3) about its own centre of mass [kg m2]."""
        square = self.radius_m**2 + self.inner_m**2
        across = self.mass_kg / 12 * (3 * square + self.length_m**2)
        return np.diag([across, across, self.mass_kg / 2 * square])
