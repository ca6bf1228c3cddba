"""Keep-out sphere around the target with an approach corridor, and the guard that overrides commands."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.runtime.sections import DirectionXyz, Range, Section


class KeepOut(Section, frozen=True, kw_only=True):
    """A sphere around the target that may be entered only through a cone; otherwise the chaser aborts and retreats."""

    # about the target's centre of mass
    radius_m: Range
    # axis of the cone, outward from the target; None closes the sphere
    corridor_axis_lvlh: DirectionXyz | None = None
    corridor_half_angle_deg: Annotated[float, Meta(ge=0, le=90)] = 10.0
    # outward speed after an abort, until twice the radius; then free drift
    retreat_m_s: Annotated[float, Meta(gt=0, le=10)] = 0.1

    def violated(self, position_lvlh_m: FloatArray) -> bool:
        """Return True if a position is inside the sphere and outside the corridor."""
        distance = float(np.linalg.norm(position_lvlh_m))
        if distance >= self.radius_m:
            return False
        if self.corridor_axis_lvlh is None or distance == 0.0:
            return True
        axis = np.array(self.corridor_axis_lvlh, float)
        cosine = float(position_lvlh_m @ axis) / (distance * float(np.linalg.norm(axis)))
        return cosine < np.cos(np.radians(self.corridor_half_angle_deg))

    def guard(
        self,
        position_lvlh_m: FloatArray,
        velocity_lvlh_m_s: FloatArray,
        asked_m_s2: FloatArray,
        dt_s: float,
        brake_m_s2: float,
    ) -> tuple[FloatArray, bool]:
        """Limit an operator's acceleration to what the sphere allows; return it, and True if it was overridden.

        The command passes if the chaser could still stop outside the sphere or inside the corridor after this step.
        Otherwise its inward part is removed and the chaser brakes; inside the sphere it is driven out at the retreat
        speed. The lateral part is kept.

        Parameters
        ----------
        position_lvlh_m : (3,) array
            Position of the chaser [m].
        velocity_lvlh_m_s : (3,) array
            Velocity of the chaser [m s-1].
        asked_m_s2 : (3,) array
            Commanded acceleration [m s-2].
        dt_s : float
            Duration of the command.
        brake_m_s2 : float
            Available deceleration.
        """
        p, v, a = position_lvlh_m, velocity_lvlh_m_s, asked_m_s2
        distance = float(np.linalg.norm(p))
        out = p / max(distance, 1e-9)
        later_p, later_v = p + v * dt_s + a * (dt_s * dt_s / 2), v + a * dt_s
        # the braking distance is half the braking time times the present speed
        stopped = later_p + later_v * (float(np.linalg.norm(later_v)) / (2 * brake_m_s2))
        closing = max(-float(later_v @ out), 0.0)
        reach = float(np.linalg.norm(later_p)) - closing * closing / (2 * brake_m_s2)
        inside = self.violated(p)
        if not inside and (
            reach >= self.radius_m
            or not (self.violated(stopped) or self.violated(later_p) or self._crosses(p))
        ):
            return a, False
        rate = float(v @ out)
        outward_m_s = self.retreat_m_s if inside else 0.0
        push = float(np.clip((outward_m_s - rate) / dt_s, 0.0, brake_m_s2))
        outward = float(a @ out)
        return a - outward * out + max(outward, push) * out, True

    def _crosses(self, position_lvlh_m: FloatArray) -> bool:
        """Return True if a straight line inward from here would enter the sphere outside the corridor."""
        distance = float(np.linalg.norm(position_lvlh_m))
        return distance >= self.radius_m and self.violated(
            position_lvlh_m * (self.radius_m * (1 - 1e-9) / distance)
        )
