"""Open-ended flight: the propagated span is extended on demand."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.flight import PLACEHOLDER_CHASER, fly
from flyaround.simulator.world.attitude.target_attitude import Attitude
from flyaround.simulator.world.orbit.forces import Forces

if TYPE_CHECKING:
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.world.flight.flight import Flight


def orbit_ahead(plan: Plan, span_s: float, *, quick: bool) -> Flight:
    """Propagate only the target's orbit over a span, for sky events; attitudes differ from the scenario's.

    Parameters
    ----------
    plan : Plan
        Plan of the flight.
    span_s : float
        Duration to propagate [s].
    quick : bool
        True for a point mass with J2 instead of the scenario's forces: seconds off after some orbits.
    """
    plain = msgspec.structs.replace(
        plan.scenario, chaser=PLACEHOLDER_CHASER, attitude=Attitude(motion="fixed")
    )
    if quick:
        plain = msgspec.structs.replace(plain, forces=Forces())
    return fly(plain, plan.target, span_s)


def longer_flight(plan: Plan, flight: Flight, spans_s: tuple[float, ...], *, guided: bool) -> Flight:
    """Return the flight over a longer span; the camera's reference does not change.

    Guidance by thrusters runs once a second, so that extending its track is slow. Under manual control the track is not
    needed and is not extended.

    Parameters
    ----------
    plan : Plan
        Plan of the scenario.
    flight : Flight
        Present flight.
    spans_s : tuple of float
        Spans from the start in order of preference; a later one is used if an earlier one is impossible.
    guided : bool
        True if guidance flies to its end.

    Raises
    ------
    UserError
        If the last one is impossible too.
    """
    for span_s in spans_s[:-1]:
        with contextlib.suppress(UserError):
            return _extend_flight(plan, flight, span_s, guided=guided)
    return _extend_flight(plan, flight, spans_s[-1], guided=guided)


def _extend_flight(plan: Plan, flight: Flight, span_s: float, *, guided: bool) -> Flight:
    scenario = plan.scenario
    costly = flight.controlled is not None or flight.scripted is not None or flight.wheels is not None
    # a target with a pointing attitude may point at the chaser
    if guided or not costly or scenario.attitude.motion == "point":
        return replace(fly(scenario, plan.target, span_s), pointing=flight.pointing)
    extended = fly(msgspec.structs.replace(scenario, chaser=PLACEHOLDER_CHASER), plan.target, span_s)
    return replace(
        extended,
        pointing=flight.pointing,
        guidance=flight.guidance,
        controlled=flight.controlled,
        scripted=flight.scripted,
        wheels=flight.wheels,
    )
