"""Free flight: drift, natural circumnavigation, the safe ellipse, and drift that thrusters keep within a shell."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from msgspec import Meta

from simulator.runtime.sections import Degrees, Metres, MetresXyz, Range, SpeedXyz
from simulator.world.guidance.chaser import Chaser
from simulator.world.guidance.thrusters import Thrusters
from simulator.world.relative.clohessy_wiltshire import bounded_ellipse

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray


class FreeDrift(Chaser, tag_field="mode", tag="drift", frozen=True, kw_only=True):
    """Free flight from a state in the rotating LVLH frame."""

    ballistic: ClassVar[bool] = True
    position_lvlh_m: MetresXyz
    velocity_lvlh_m_s: SpeedXyz = (0.0, 0.0, 0.0)

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The initial state."""
        return np.array(self.position_lvlh_m, float), np.array(self.velocity_lvlh_m_s, float)


class NaturalCircumnavigation(Chaser, tag_field="mode", tag="circumnavigation", frozen=True, kw_only=True):
    """Free flight on the 2:1 ellipse, once per orbit; ``cross_phase_deg = 90`` makes it passively safe."""

    ballistic: ClassVar[bool] = True
    # half the radial size; along-track it is twice that
    radial_m: Range
    # 0 at the top (radially outward), 90 behind the target
    phase_deg: Degrees = 0.0
    # out-of-plane swing and its lead over the radial one
    cross_track_m: Annotated[float, Meta(ge=0, le=1e5)] = 0.0
    cross_phase_deg: Degrees = 90.0
    centre_along_track_m: Metres = 0.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The initial state, by Clohessy-Wiltshire."""
        return bounded_ellipse(
            n_rad_s,
            self.radial_m,
            np.radians(self.phase_deg),
            self.cross_track_m,
            np.radians(self.cross_phase_deg),
            self.centre_along_track_m,
        )


class SafeEllipse(Chaser, tag_field="mode", tag="safe_ellipse", frozen=True, kw_only=True):
    """Free flight on an ellipse that stays clear of the along-track axis by the smaller of its two half sizes."""

    ballistic: ClassVar[bool] = True
    radial_m: Range
    cross_track_m: Range
    # 0 at the top (radially outward)
    phase_deg: Degrees = 0.0
    centre_along_track_m: Metres = 0.0

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The initial state, by Clohessy-Wiltshire.

        Radial and cross-track swing are a quarter turn apart, so that one is largest where the other is zero.

        References
        ----------
        D'Amico & Montenbruck (2006), J. Guidance 29(3): parallel eccentricity and inclination vectors.
        """
        return bounded_ellipse(
            n_rad_s,
            self.radial_m,
            np.radians(self.phase_deg),
            self.cross_track_m,
            np.pi / 2,
            self.centre_along_track_m,
        )

    @property
    def least_distance_m(self) -> float:
        """From the along-track axis, however the ellipse drifts along it [m]."""
        return min(self.radial_m, self.cross_track_m)


class RangeKeeping(Chaser, tag_field="mode", tag="keep_range", frozen=True, kw_only=True):
    """Free drift that thrusters turn back before the range leaves ``near_m`` to ``far_m``."""

    position_lvlh_m: MetresXyz
    near_m: Range
    far_m: Range
    # radial speed after each correction, and how far inside the shell corrections are made
    turn_m_s: Annotated[float, Meta(gt=0, le=1)] = 0.01
    margin_m: Annotated[float, Meta(gt=0, le=1e3)] = 1.0

    @property
    def acting_thrusters(self) -> Thrusters:
        """Its own, or default ones: the mode cannot do without."""
        return self.thrusters or Thrusters()

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """The start, at rest in LVLH."""
        return np.array(self.position_lvlh_m, float), np.zeros(3)

    def phase(self, t_s: float) -> str:  # noqa: ARG002
        """Always the same."""
        return "range keeping"

    def impulse_lvlh(self, p: FloatArray, v: FloatArray, n_rad_s: float) -> FloatArray:  # noqa: ARG002
        """Change of velocity [m s-1]: zero while the range is well inside or the chaser returns.

        Else the radial speed is reversed.
        """
        distance = float(np.linalg.norm(p))
        out = p / distance
        rate = float(v @ out)
        leaving_far = distance > self.far_m - self.margin_m and rate > -self.turn_m_s / 2
        leaving_near = distance < self.near_m + self.margin_m and rate < self.turn_m_s / 2
        if not (leaving_far or leaving_near):
            return np.zeros(3)
        sideways = v - rate * out
        speed = float(np.linalg.norm(sideways))
        # what goes sideways soon goes outward: it is held to the same speed
        kept = sideways * min(1.0, self.turn_m_s / max(speed, 1e-12))
        wanted = (-self.turn_m_s if leaving_far else self.turn_m_s) * out + kept
        return np.asarray(wanted - v)
