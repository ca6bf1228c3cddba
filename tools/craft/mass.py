"""Mass properties of a list of simple bodies of known mass."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import FloatArray, Vec3, vec3
from flyaround.simulator.targets.model import MassProperties

if TYPE_CHECKING:
    from collections.abc import Sequence


@dataclass(frozen=True)
class MassElement:
    """A uniform box, or a thin rod when ``tip_m`` is given.

    Parameters
    ----------
    name : str
        Name of the body.
    mass_kg : float
        Its mass.
    centre_m : Vec3
        Of the box. For a rod ``centre_m`` is one end and ``tip_m`` the other.
    size_m : Vec3, optional
        Of the box. For a rod ``centre_m`` is one end and ``tip_m`` the other.
    tip_m : Vec3, optional
        Other end of a rod.
    """

    name: str
    mass_kg: float
    centre_m: Vec3
    _: KW_ONLY
    size_m: Vec3 = (0.0, 0.0, 0.0)
    tip_m: Vec3 | None = None

    def centre(self) -> FloatArray:
        """Return the (3,) centre of mass [m]."""
        c = np.asarray(self.centre_m)
        return c if self.tip_m is None else (c + np.asarray(self.tip_m)) / 2

    def inertia(self) -> FloatArray:
        """Return the (3, 3) inertia about its own centre of mass [kg m2]."""
        if self.tip_m is not None:
            d = np.subtract(self.tip_m, self.centre_m)
            return self.mass_kg / 12 * (d @ d * np.eye(3) - np.outer(d, d))
        square = np.square(self.size_m)
        return self.mass_kg / 12 * np.diag(square.sum() - square)


def mass_properties(lumps: Sequence[MassElement]) -> MassProperties:
    """Return the mass, centre of mass and inertia of all elements, by Steiner's theorem."""
    mass = sum(lump.mass_kg for lump in lumps)
    com = sum((lump.mass_kg * lump.centre() for lump in lumps), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for lump in lumps:
        d = lump.centre() - com
        inertia += lump.inertia() + lump.mass_kg * (d @ d * np.eye(3) - np.outer(d, d))
    inertia = (inertia + inertia.T) / 2
    rows = (vec3(inertia[0]), vec3(inertia[1]), vec3(inertia[2]))
    return MassProperties(mass_kg=float(mass), com_m=vec3(com), inertia_kg_m2=rows)


@dataclass(frozen=True, kw_only=True)
class Tube(MassElement):
    """A uniform cylinder about z through ``centre_m``, hollow inside ``inner_m``.

    Parameters
    ----------
    radius_m : float
        Outer radius.
    length_m : float
        Along z.
    inner_m : float, optional
        Inner radius, zero when solid.
    """

    radius_m: float
    length_m: float
    inner_m: float = 0.0

    def inertia(self) -> FloatArray:
        """Return the (3, 3) inertia about its own centre of mass [kg m2]."""
        square = self.radius_m**2 + self.inner_m**2
        across = self.mass_kg / 12 * (3 * square + self.length_m**2)
        return np.diag([across, across, self.mass_kg / 2 * square])
