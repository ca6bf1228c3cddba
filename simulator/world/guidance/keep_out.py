"""Keep-out sphere around the target with an approach corridor, and the guard that overrides commands."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.arrays import FloatArray
from flyaround.simulator.runtime.sections import DirectionXyz, Range, Section

Guard = Literal["scenario", "port", "lifted"]


class KeepOut(Section, frozen=True, kw_only=True):
    """A sphere around the target that may be entered only through a cone; otherwise the chaser aborts and retreats."""

    # about the target's centre of mass
    radius_m: Range
    # axis of the cone, outward from the target; None closes the sphere
    corridor_axis_lvlh: DirectionXyz | None = None
    corridor_half_angle_deg: Annotated[float, Meta(ge=0, le=90)] = 10.0
    # outward speed after an abort, until twice the radius; then free drift
    retreat_m_s: Annotated[float, Meta(gt=0, le=10)] = 0.1
    # the pilot's choice at the start: this corridor, one that turns with the docking port, or no sphere
    pilot_choice: Guard = "scenario"

    def violated(self, position_lvlh_m: FloatArray) -> bool:
        """Return True if a position relative to the target is inside the sphere and outside the corridor.

        Returns
        -------
        bool
            False on the surfaces of the sphere and the cone; True at the target's centre of mass.
        """
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
        commanded_m_s2: FloatArray,
        dt_s: float,
        brake_m_s2: float,
    ) -> tuple[FloatArray, bool]:
        """Limit an operator's acceleration so that the chaser can stop before it enters the sphere.

        The command passes if after this step the chaser could still stop outside the sphere or inside the corridor.
        Otherwise its inward component is removed and the chaser brakes. Inside the sphere the chaser is driven outward
        at the retreat speed. The lateral component is kept.

        Parameters
        ----------
        position_lvlh_m : (3,) array
            Position of the chaser [m].
        velocity_lvlh_m_s : (3,) array
            Velocity of the chaser [m s-1].
        commanded_m_s2 : (3,) array
            Commanded acceleration [m s-2].
        dt_s : float
            Duration of the command.
        brake_m_s2 : float
            Available deceleration.

        Returns
        -------
        tuple
            Allowed acceleration (3,) [m s-2], and True if it differs from the commanded one.
        """
        p, v, a = position_lvlh_m, velocity_lvlh_m_s, commanded_m_s2
        distance = float(np.linalg.norm(p))
        radial = p / max(distance, 1e-9)
        next_p, next_v = p + v * dt_s + a * (dt_s * dt_s / 2), v + a * dt_s
        # point at which the chaser would come to rest, after half the braking time at the present speed
        stopped = next_p + next_v * (float(np.linalg.norm(next_v)) / (2 * brake_m_s2))
        closing = max(-float(next_v @ radial), 0.0)
        reach = float(np.linalg.norm(next_p)) - closing * closing / (2 * brake_m_s2)
        is_inside = self.violated(p)
        if not is_inside and (
            reach >= self.radius_m
            or not (self.violated(stopped) or self.violated(next_p) or self._crosses(p))
        ):
            return a, False
        speed_outward = float(v @ radial)
        outward_m_s = self.retreat_m_s if is_inside else 0.0
        correction = float(np.clip((outward_m_s - speed_outward) / dt_s, 0.0, brake_m_s2))
        command_outward = float(a @ radial)
        return a - command_outward * radial + max(command_outward, correction) * radial, True

    def _crosses(self, position_lvlh_m: FloatArray) -> bool:
        """Return True if a straight line towards the target would enter the sphere outside the corridor."""
        distance = float(np.linalg.norm(position_lvlh_m))
        return distance >= self.radius_m and self.violated(
            position_lvlh_m * (self.radius_m * (1 - 1e-9) / distance)
        )
