"""Craft that follow an ephemeris: the target, with a chaser in free flight or on its own ephemeris."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.orbit.dense_output import DenseOutput, integrate
from flyaround.simulator.world.orbit.propagation import OrbitTrack, Solution, propagate

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.orbit.burns import Burn
    from flyaround.simulator.world.orbit.forces import ForceModel

_CHECK_STEP_S = 60.0
"""Spans over which velocity changes are compared with gravity; a shorter burn counts with its mean over a span [s].
Simpson's rule integrates the gravity of a low orbit over it to 1e-5 m/s."""
_THRUST_M_S2 = 2e-3
"""Mean acceleration in excess of the force model that counts as a burn [m s-2]. Chosen by eye: above the gravity
anomalies in low orbit, below the acceleration of a space station's reboost."""


class Ephemeris(Protocol):
    """A craft's motion over time, from its central body, GCRS axes."""

    @property
    def where(self) -> str:
        """Name of the file in messages."""
        ...

    @property
    def end_s(self) -> float:
        """End of the span without a gap [s]."""
        ...

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the position [m], velocity [m s-1] and acceleration [m s-2]."""
        ...


@dataclass(frozen=True, eq=False)
class FollowedCraft:
    """A craft that follows its ephemeris and, after its end, the forces.

    Parameters
    ----------
    ephemeris : Ephemeris
        Motion up to ``end_s``.
    end_s : float
        Time of the ephemeris's last state [s].
    tail : DenseOutput or None
        [r, v] after ``end_s``; None if the ephemeris covers the flight.
    """

    ephemeris: Ephemeris
    end_s: float
    tail: DenseOutput | None

    def __call__(self, t_s: float) -> FloatArray:
        """Return the position and velocity (6,)."""
        if self.tail is not None and t_s > self.end_s:
            return self.tail(t_s)
        return np.concatenate(self.ephemeris(t_s)[:2])

    def rate(self, t_s: float) -> FloatArray:
        """Return the velocity and acceleration (6,)."""
        if self.tail is not None and t_s > self.end_s:
            return self.tail.rate(t_s)
        return np.concatenate(self.ephemeris(t_s)[1:])


@dataclass(frozen=True, eq=False)
class CraftPair:
    """The target and, optionally, the chaser.

    Parameters
    ----------
    target : Solution
        [r, v, ...].
    chaser : Solution, optional
        [r, v] of a chaser on its own ephemeris, from the same centre.
    relative_solution : Solution, optional
        [..., rho, rho'] of a chaser in free flight, relative to the target.
    """

    target: Solution
    chaser: Solution | None = None
    relative_solution: Solution | None = None

    def __call__(self, t_s: float) -> FloatArray:
        """Return the state (6,) or, with a chaser, (12,)."""
        return self._combine(
            self.target(t_s)[:6],
            None if self.chaser is None else self.chaser(t_s),
            None if self.relative_solution is None else self.relative_solution(t_s),
        )

    def rate(self, t_s: float) -> FloatArray:
        """Return its derivative."""
        return self._combine(
            self.target.rate(t_s)[:6],
            None if self.chaser is None else self.chaser.rate(t_s),
            None if self.relative_solution is None else self.relative_solution.rate(t_s),
        )

    @staticmethod
    def _combine(
        target: FloatArray, chaser: FloatArray | None, relative_solution: FloatArray | None
    ) -> FloatArray:
        if chaser is not None:
            return np.concatenate([target, chaser - target])
        return target if relative_solution is None else np.concatenate([target, relative_solution[6:]])


@dataclass(frozen=True, eq=False)
class FollowedTrack(OrbitTrack):
    """A target that follows an ephemeris, which includes its burns."""

    def acceleration(self, t_s: float) -> FloatArray:
        """Return the target's acceleration in GCRS: the derivative of the ephemeris's velocity [m s-2]."""
        return self.solution.rate(t_s)[3:6]


def followed_craft(ephemeris: Ephemeris, duration_s: float, forces: ForceModel) -> FollowedCraft:
    """Return a craft that follows an ephemeris to its end, and is propagated from there to ``duration_s``."""
    tail, end_s = None, ephemeris.end_s
    if duration_s > end_s:
        tail = integrate(
            lambda t, y: np.concatenate([y[3:], forces.target(t, y[:3], y[3:])]),
            np.concatenate(ephemeris(end_s)[:2]),
            (end_s, duration_s),
            rtol=1e-12,
            atol=1e-7,
            max_step_s=60.0,
        )
    return FollowedCraft(ephemeris, end_s, tail)


def follow(
    target: FollowedCraft,
    duration_s: float,
    forces: ForceModel,
    relative: tuple[FloatArray, FloatArray] | None = None,
    burns: tuple[Burn, ...] = (),
) -> FollowedTrack:
    """Return the track of a target on an ephemeris and, if ``relative`` is given, of a chaser in free flight.

    Accelerations of the ephemeris beyond the scenario's forces (higher harmonics, air of the day) act on both craft;
    their relative motion depends on the difference of the forces alone.

    Parameters
    ----------
    target : FollowedCraft
        Target on its ephemeris.
    duration_s : float
        Span [s].
    forces : ForceModel
        Forces whose difference moves the chaser relative to the target.
    relative : tuple of array, optional
        Chaser minus target at t = 0, GCRS axes.
    burns : tuple of Burn, optional
        Burns of the chaser.

    Raises
    ------
    UserError
        If the target fires its engines while the chaser flies freely, or drag acts on a craft below 80 km.
    """
    relative_solution = None
    if relative is not None:
        refuse_thrust(target, duration_s, forces)
        y = target(0.0)
        relative_solution = propagate(
            y[:3], y[3:], duration_s, forces, relative, burns, along=target
        ).solution
    return FollowedTrack(forces, duration_s, CraftPair(target, relative_solution=relative_solution))


def refuse_thrust(target: FollowedCraft, duration_s: float, forces: ForceModel) -> None:
    """Raise UserError if an ephemeris contains a burn: a mean acceleration that the forces do not explain.

    A burn of less than 0.12 m/s within a minute is not noticed.
    """
    edges = np.linspace(0.0, min(duration_s, target.end_s), max(int(duration_s / _CHECK_STEP_S) + 1, 2))
    for a, b in pairwise(edges.tolist()):
        times = (a, (a + b) / 2, b)
        states = [target(t) for t in times]
        gravity = np.array(
            [
                # an ephemeris computed with a point mass only is accepted too
                (forces.target(t, y[:3], y[3:]), -forces.mu_m3_s2 * y[:3] / np.linalg.norm(y[:3]) ** 3)
                for t, y in zip(times, states, strict=True)
            ]
        )
        velocity_change = (
            states[2][3:]
            - states[0][3:]
            - (b - a) / 6 * np.array([1.0, 4.0, 1.0]) @ gravity.transpose(1, 0, 2)
        )
        excess = float(np.linalg.norm(velocity_change, axis=1).min())
        if excess > _THRUST_M_S2 * (b - a):
            raise UserError(
                f"{target.ephemeris.where} changes the target's velocity by {excess:.3g} m/s in addition to gravity "
                f"between {a:.0f} and {b:.0f} s, and a chaser in free flight or under thrusters cannot be flown "
                'relative to a burning target: give orbit.motion = "propagate" with [[burns]], the chaser its own file '
                'by mode "oem", or the forces that the file was made with'
            )
