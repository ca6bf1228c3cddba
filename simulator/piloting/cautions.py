"""Cautions of a flight, reported once when they begin; and ends of cautions and of notes on a present condition."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from flyaround.simulator.piloting.chaser_control import HOLD_COSTS, PLUME_CAUTION, UNGUIDED
from flyaround.simulator.piloting.docking_watch import CONTACT, STOPS
from flyaround.simulator.piloting.orders import (
    ABORTS,
    LIFTED,
    SCENARIOS,
    WITH_IT,
    WOULD_TAKE_BACK,
    planned_text,
)
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.piloting.clock import FlightClock
    from flyaround.simulator.piloting.docking_watch import News
    from flyaround.simulator.piloting.piloted_craft import PilotedCraft
    from flyaround.simulator.piloting.propellant import Propellant
    from flyaround.simulator.world.flight.world_state import WorldState

GUARD_RELEASE_S = 5.0
"""Minimum time without an intervention after which the keep-out guard counts as released [s]."""

DRIFTED_AWAY = 4.0
"""Ratio of the range to the least one since the drift began, from which on it is a caution."""

AT_REST_M_S = 1e-3
"""Speed below which the chaser counts as at rest beside the target."""

FUEL_SHARE = 0.04
"""Propellant as a share of the chaser's initial mass; the tanks of small craft hold some 5 %."""

AWAY, OVERRULED, ECLIPSE, FUEL = "drifts away", "the steering is overruled", "eclipse:", "fuel is low"
NOT_REACHED, DRIFT, FLIES_TO = "is not reached", "the free drift", "the autopilot flies to"


class PilotedFlight(Protocol):
    """The parts of a session that decide whether a cause has ended."""

    clock: FlightClock
    craft: PilotedCraft
    cautions: CautionWatch

    @property
    def t_s(self) -> float:
        """Simulated time [s]."""

    @property
    def at_hold_point(self) -> bool:
        """True if the chaser may leave the next hold point."""

    @property
    def waits_for_go(self) -> bool:
        """True while the autopilot waits at a hold point."""


def is_low(propellant: Propellant) -> bool:
    """Return True if little propellant is left."""
    return propellant.used_kg >= FUEL_SHARE * propellant.thrusters.mass_kg


def recedes(world: WorldState) -> bool:
    """Return True if the range from the chaser to the target grows."""
    r, v = np.array(world.relative_eci_m), np.array(world.relative_eci_m_s)
    return float(r @ v) > AT_REST_M_S * float(np.linalg.norm(r))


class CautionWatch:
    """Compares a flight with its last state, and reports each caution once when it begins."""

    def __init__(self) -> None:
        self._guarded_s = -GUARD_RELEASE_S
        self._nearest_m, self._flown_s = np.inf, -np.inf
        self._before: tuple[bool, bool] | None = None
        self._drift_risk = ""

    def guarded(self, t_s: float) -> bool:
        """Return True until the keep-out guard has been released."""
        return self._guarded_s <= t_s < self._guarded_s + GUARD_RELEASE_S

    def news(
        self,
        world: WorldState,
        propellant: Propellant,
        *,
        guarded: bool,
        drifts: bool = False,
        drift_risk: str = "",
    ) -> list[News]:
        """Return the cautions that began since the last call; of sunlight and propellant none at the first."""
        t_s = world.t_s
        is_sunlit, fuel_low = world.sun_visible_fraction > 0.0, is_low(propellant)
        was_lit, was_low = self._before or (is_sunlit, fuel_low)
        news: list[News] = []
        range_m = float(np.linalg.norm(world.relative_eci_m))
        # the least range of a part that was discarded does not count
        drifted, self._flown_s = drifts and t_s >= self._flown_s, t_s
        if drifted and recedes(world) and range_m > DRIFTED_AWAY * self._nearest_m:
            self._nearest_m = range_m
            news.append(("caution", f"the chaser {AWAY}: {range_m:.0f} m from the target, without guidance"))
        self._nearest_m = min(self._nearest_m, range_m) if drifted else range_m
        if drift_risk and drift_risk != self._drift_risk:
            news.append(("caution", f"{DRIFT} {drift_risk}"))
        self._drift_risk = drift_risk
        if guarded and not self.guarded(t_s):
            news.append(("caution", f"keep-out sphere: {OVERRULED}, the chaser turned away"))
        if is_sunlit and not was_lit:
            news.append(("note", "the target is in sunlight again"))
        if was_lit and not is_sunlit:
            news.append(("caution", f"{ECLIPSE} the target has lost the Sun"))
        if fuel_low and not was_low:
            news.append(("caution", f"{FUEL}: {propellant.used_kg:.1f} kg of propellant are burnt"))
        if guarded:
            self._guarded_s = t_s
        self._before = is_sunlit, fuel_low
        return news


def _nothing_takes_back(session: PilotedFlight, caution: str) -> bool:
    steering = session.craft.steering
    named = [b for b in steering.burns.burns if planned_text(b) in caution]
    flies = SCENARIOS if session.craft.mode == "guidance" else steering.doing
    return not (named and flies and f"{flies} {WOULD_TAKE_BACK}" in caution)


def _burn_is_safe(session: PilotedFlight, caution: str) -> bool:
    burns = session.craft.steering.burns.burns
    is_planned = any(planned_text(b) in caution for b in burns)
    return not (is_planned and session.craft.burns_forecast()[1])


def _was_no_contact(session: PilotedFlight, caution: str) -> bool:
    docking = session.craft.docking
    return docking.docked or not any(mission_time(c.t_s) in caution for c in docking.contacts)


def _corridor_is_open(session: PilotedFlight, _: str) -> bool:
    return not session.craft.steering.autopilot or session.craft.steering.guard != "scenario"


def _hold_has_ended(session: PilotedFlight, caution: str) -> bool:
    return not (point := session.craft.steering.waits_at) or f"{point} {HOLD_COSTS}" not in caution


def _jump_may_go_on(session: PilotedFlight, _: str) -> bool:
    steering = session.craft.steering
    return bool(session.clock.jump) or not steering.autopilot or session.at_hold_point


ENDS: dict[str, Callable[[PilotedFlight, str], bool]] = {
    PLUME_CAUTION: lambda session, _: session.craft.steering.plume_clear(session.t_s),
    WOULD_TAKE_BACK: _nothing_takes_back,
    WITH_IT: _burn_is_safe,
    DRIFT: lambda session, caution: (
        session.craft.drift_risk() not in caution or not session.craft.drift_risk()
    ),
    UNGUIDED: lambda session, _: not session.craft.drifts,
    AWAY: lambda session, _: not (session.craft.drifts and recedes(session.craft.world)),
    OVERRULED: lambda session, _: not session.cautions.guarded(session.t_s),
    ECLIPSE: lambda session, _: session.craft.world.sun_visible_fraction > 0.0,
    FUEL: lambda session, _: not is_low(session.craft.steering.propellant),
    ABORTS: lambda session, _: not session.craft.steering.aborting,
    LIFTED: lambda session, _: session.craft.steering.guard != "lifted",
    STOPS: _corridor_is_open,
    HOLD_COSTS: _hold_has_ended,
    CONTACT: _was_no_contact,
    NOT_REACHED: _jump_may_go_on,
}
"""Phrase in each caution and warning of a flight, and the function that returns True once its cause has ended."""


def _flies_otherwise(session: PilotedFlight, note: str) -> bool:
    return not note.startswith(f"guidance: {session.craft.steering.doing or 'none'}")


def _has_left_rest(session: PilotedFlight, _: str) -> bool:
    speed_m_s = float(np.linalg.norm(session.craft.world.velocity_lvlh_m_s))
    return not session.craft.drifts or speed_m_s > AT_REST_M_S


def _flies_elsewhere(session: PilotedFlight, note: str) -> bool:
    point = session.craft.docking.hold_points.next
    goal = "the port" if point is None else f"{point.name},"
    return not session.craft.steering.autopilot or not note.startswith(f"{FLIES_TO} {goal}")


NOTE_ENDS: dict[str, Callable[[PilotedFlight, str], bool]] = {
    "guidance: ": _flies_otherwise,
    "at rest; ": _has_left_rest,
    "the autopilot is off": lambda session, _: not session.craft.drifts,
    FLIES_TO: _flies_elsewhere,
    "the jump has ended": lambda session, note: "waits at" in note and not session.waits_for_go,
    "the autopilot waits at ": lambda session, _: not session.waits_for_go,
    "no-go: ": lambda session, _: getattr(session.craft.docking.hold_points.next, "decision", "") != "no-go",
    "a burn of ": lambda session, note: (
        not any(planned_text(b) in note for b in session.craft.steering.burns.burns)
    ),
    "on the way to ": lambda session, _: not session.clock.jump,
    "REPLAY, paused": lambda session, _: not session.clock.paused,
    "the target is in sunlight": lambda session, _: session.craft.world.sun_visible_fraction == 0.0,
}
"""Beginning of each note that states a present condition, and the function that returns True once it is untrue."""


def cause_ended(session: PilotedFlight, message: str) -> bool:
    """Return True if a message is no longer true of the flight; False for a text that is none of a flight's."""
    cautions = any(phrase in message and ended(session, message) for phrase, ended in ENDS.items())
    notes = any(message.startswith(start) and ended(session, message) for start, ended in NOTE_ENDS.items())
    return cautions or notes
