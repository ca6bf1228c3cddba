"""Burns of either craft along the target's LVLH axes: impulsive, or of constant acceleration."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.runtime.sections import Section, SpeedXyz
from flyaround.simulator.world.frames.vectors import cross_product

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


class Burn(Section, frozen=True, kw_only=True):
    """A velocity change of either craft along the target's LVLH axes: impulsive, or uniform over ``duration_s``.

    The chaser's burns require free flight (drift, circumnavigation, safe_ellipse).
    """

    craft: Literal["target", "chaser"]
    start_s: Annotated[float, Meta(ge=0, le=1e6)]
    # radial, along-track, cross-track; the axes rotate with the orbit
    delta_v_lvlh_m_s: SpeedXyz
    duration_s: Annotated[float, Meta(ge=0, le=1e6)] = 0.0

    @property
    def end_s(self) -> float:
        """End of the burn [s]."""
        return self.start_s + self.duration_s

    @property
    def acceleration_lvlh_m_s2(self) -> Vec3:
        """Acceleration of a burn of finite duration [m s-2]."""
        x, y, z = self.delta_v_lvlh_m_s
        return (x / self.duration_s, y / self.duration_s, z / self.duration_s)

    def thrusts_throughout(self, start_s: float, end_s: float) -> bool:
        """Return True if it acts throughout a span that contains no start or end of a burn.

        Returns
        -------
        bool
            Always False for an impulsive burn. A span without length counts as inside at the start and the end of
            the burn.
        """
        return self.start_s <= start_s and end_s <= self.end_s and self.duration_s > 0


def burn_edges_s(burns: tuple[Burn, ...], start_s: float, end_s: float) -> list[float]:
    """Return the starts and ends of burns strictly inside a span, in order [s]."""
    edges = {t for b in burns for t in (b.start_s, b.end_s)}
    return sorted(t for t in edges if start_s < t < end_s)


def eci_from_own_lvlh(vector_lvlh: Vec3, r_eci_m: FloatArray, v_eci_m_s: FloatArray) -> FloatArray:
    """Convert a vector (3,) from the LVLH frame of a craft with position and velocity (3,) to GCRS axes."""
    r, v = r_eci_m.tolist(), v_eci_m_s.tolist()
    h = cross_product(r, v)
    axes = np.array([r, cross_product(h, r), h])
    return np.asarray(np.array(vector_lvlh) @ (axes / np.linalg.norm(axes, axis=1, keepdims=True)))
