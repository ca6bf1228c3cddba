"""Events to jump to: the next eclipse entry or exit, and the next terminator crossing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.open_end import orbit_ahead
from flyaround.simulator.world.ephemeris.body import bodies_at
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.world.flight.flight import Flight

Event = Literal["eclipse", "sunrise", "terminator"]

EVENTS: dict[Event, str] = {
    "eclipse": "the target begins to enter the shadow",
    "sunrise": "the target is in full sunlight again",
    "terminator": "the target crosses the terminator between day and night",
}

# Tolerance of the time of an event [s].
TIME_TOLERANCE_S = 0.01

SEARCH_MARGIN_S = 300.0
"""Largest delay of an event relative to its time on a simplified orbit [s]."""

_STEPS_PER_ORBIT = 200
"""Steps per orbit: an eclipse lasts a third of a low orbit, and a twentieth of a geostationary one."""


def event_ahead_s(plan: Plan, flight: Flight, event: Event, now_s: float) -> float:
    """Return the time of the next event, beyond the propagated flight if necessary.

    Raises
    ------
    UserError
        If there is none within two orbits.
    """
    end_s = now_s + search_s(flight)
    if end_s <= flight.duration_s:
        when = next_event_s(flight, event, now_s)
    else:
        # two days with all forces take 15 s: search first with a simplified orbit, then precisely
        when = next_event_s(orbit_ahead(plan, end_s + 1.0, quick=True), event, now_s)
        if when is not None:
            near_s = when + SEARCH_MARGIN_S
            near = orbit_ahead(plan, near_s + 1.0, quick=False)
            when = next_event_s(near, event, now_s, until_s=near_s)
    if when is None:
        raise UserError(f"the next two orbits contain no time at which {EVENTS[event]}")
    return when


def search_s(flight: Flight) -> float:
    """Return the search span: two orbits [s]."""
    return 2 * 2 * np.pi / flight.n_rad_s


def next_event_s(flight: Flight, event: Event, after_s: float, until_s: float | None = None) -> float | None:
    """Return the time of the next event to a hundredth of a second, or None within the next two orbits.

    Parameters
    ----------
    flight : Flight
        Must reach ``until_s``, or else `search_s` beyond ``after_s``.
    event : Event
        Kind of event.
    after_s : float
        Time after which to search [s].
    until_s : float or None, optional
        End of the search [s]; None for two orbits.
    """
    margin = margin_of(flight, event)
    end_s = after_s + search_s(flight) if until_s is None else until_s
    step = search_s(flight) / (2 * _STEPS_PER_ORBIT)
    # do not find the event again that was jumped to
    low_s = after_s + 2 * TIME_TOLERANCE_S
    low = margin(low_s)
    while low_s < end_s:
        high_s = min(low_s + step, end_s)
        high = margin(high_s)
        if (low > 0) != (high > 0) and (event == "terminator" or high > 0):
            return _crossing_s(margin, low_s, high_s)
        low_s, low = high_s, high
    return None


def margin_of(flight: Flight, event: Event) -> Callable[[float], float]:
    """Return a function of time that is positive after the event."""
    margins: dict[Event, Callable[[float], float]] = {
        "eclipse": lambda t_s: 1.0 - 1e-9 - sun_fraction(flight, t_s),
        "sunrise": lambda t_s: sun_fraction(flight, t_s) - (1.0 - 1e-9),
        "terminator": lambda t_s: sun_height(flight, t_s),
    }
    return margins[event]


def sun_fraction(flight: Flight, t_s: float) -> float:
    """Return the share of the Sun's disc that the target sees, 0 to 1."""
    now = flight.epoch.plus(t_s)
    r_body, _ = flight.body.geocentric_state(now)
    r = r_body + flight.orbit(t_s)[0]
    return sun_fraction_past_bodies(bodies_at(now, flight.body), r, sun_eci_m(now.tt1, now.tt2))


def sun_height(flight: Flight, t_s: float) -> float:
    """Return the sine of the Sun's elevation on the ground below the target, on a spherical Earth."""
    now = flight.epoch.plus(t_s)
    r_body, _ = flight.body.geocentric_state(now)
    up = flight.orbit(t_s)[0]
    to_sun = sun_eci_m(now.tt1, now.tt2) - r_body
    return float(up @ to_sun / (np.linalg.norm(up) * np.linalg.norm(to_sun)))


def _crossing_s(margin: Callable[[float], float], low_s: float, high_s: float) -> float:
    """Return the time just after a margin changes sign, by bisection."""
    before = margin(low_s) > 0
    while high_s - low_s > TIME_TOLERANCE_S:
        middle = (low_s + high_s) / 2
        if (margin(middle) > 0) == before:
            low_s = middle
        else:
            high_s = middle
    return high_s
