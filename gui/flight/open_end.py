"""A flight that goes on as long as one likes, at no more cost than what is asked of it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec

from simulator.scenario.flight import fly
from simulator.world.attitude.target_attitude import Attitude
from simulator.world.guidance.paths import Hold
from simulator.world.orbit.forces import Forces

if TYPE_CHECKING:
    from simulator.scenario.plan import Plan
    from simulator.world.flight.flight import Flight


STILL = Hold(position_lvlh_m=(0.0, 100.0, 0.0))
"""A chaser that costs nothing, in place of one that does."""


def orbit_ahead(plan: Plan, span_s: float, *, quick: bool) -> Flight:
    """The target's orbit alone over a span, for what happens in the sky; neither craft's attitude is the scenario's.

    Parameters
    ----------
    quick : by a point mass with J2, whatever forces the scenario asks for: seconds off after some orbits.
    """
    plain = msgspec.structs.replace(plan.scenario, chaser=STILL, attitude=Attitude(motion="fixed"))
    if quick:
        plain = msgspec.structs.replace(plain, forces=Forces())
    return fly(plain, plan.target, span_s)


def longer_flight(plan: Plan, flight: Flight, span_s: float, *, guided: bool) -> Flight:
    """The flight over a longer span; its camera keeps the reference it was planned with.

    A chaser that flies by thrusters is decided for once a second, which takes a minute for two days. While it is
    steered nobody asks where the scenario's guidance would have it later, so its track is left as long as it was.

    Parameters
    ----------
    plan : of the scenario. flight : as it is. span_s : from the start. guided : whether guidance flies to its end.
    """
    scenario = plan.scenario
    costly = flight.controlled is not None or flight.scripted is not None or flight.wheels is not None
    # a target that points may point at the chaser
    if guided or not costly or scenario.attitude.motion == "point":
        return replace(fly(scenario, plan.target, span_s), pointing=flight.pointing)
    longer = fly(msgspec.structs.replace(scenario, chaser=STILL), plan.target, span_s)
    return replace(
        longer,
        pointing=flight.pointing,
        guidance=flight.guidance,
        controlled=flight.controlled,
        scripted=flight.scripted,
        wheels=flight.wheels,
    )
