"""Base of the chaser's guidance modes, with camera pointing, thrusters, reaction wheels and keep-out sphere."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from flyaround.simulator.runtime.sections import Range, Section
from flyaround.simulator.world.attitude.pointing import Pointing
from flyaround.simulator.world.attitude.reaction_wheels import Wheels
from flyaround.simulator.world.guidance.keep_out import KeepOut
from flyaround.simulator.world.guidance.thrusters import Thrusters
from flyaround.simulator.world.relative.clohessy_wiltshire import mean_motion_rad_s

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.orbit.propagation import Elements


class Chaser(Section, frozen=True, kw_only=True):
    """Base of all modes of motion; positions are in LVLH: radial outward, along-track, cross-track.

    ``keep_out`` applies to a chaser under thrusters or manual control.
    """

    ballistic: ClassVar[bool] = False
    """True for free flight from the state at t = 0, or along the states of a file.

    Any other mode defines a path in LVLH, which the chaser follows exactly unless it flies by thrusters.
    """

    pointing: Pointing = Pointing()
    thrusters: Thrusters | None = None
    wheels: Wheels | None = None
    keep_out: KeepOut | None = None
    minimum_start_range_m: Range = 1.5

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the state that the guidance prescribes.

        ``n_rad_s`` is the target's mean motion.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position relative to the target, LVLH [m].
        velocity_lvlh_m_s : (3,) array
            Its derivative in the rotating frame [m s-1].
        """
        raise NotImplementedError

    def start_lvlh(self, orbit: Elements, mu_m3_s2: float) -> tuple[FloatArray, FloatArray]:
        """Return the state at t = 0 next to a target on an osculating orbit.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position relative to the target, LVLH [m].
        velocity_lvlh_m_s : (3,) array
            Its derivative in the rotating frame [m s-1].
        """
        return self.state_lvlh(0.0, mean_motion_rad_s(orbit.semi_major_axis_m, mu_m3_s2))

    def phase(self, t_s: float) -> str:  # noqa: ARG002 - most modes have one
        """Return the phase of the motion ``t_s`` seconds after its start.

        Returns
        -------
        str
            One or two words in lower case, such as cruise, braking and hold; by default the name of the mode.
        """
        return str(self.__struct_config__.tag).replace("_", " ")

    @property
    def acting_thrusters(self) -> Thrusters | None:
        """The chaser's thrusters; None if it follows its path exactly."""
        return self.thrusters
