"""A piloted flight stepped by commands, without window, keys or images."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.cautions import NOT_REACHED, CautionWatch, cause_ended
from flyaround.simulator.piloting.clock import FlightClock
from flyaround.simulator.piloting.jumps import event_ahead_s
from flyaround.simulator.piloting.look_back import LookBack, Mark
from flyaround.simulator.piloting.orders import Abort
from flyaround.simulator.piloting.piloted_craft import PilotedCraft
from flyaround.simulator.piloting.planned_burns import BurnPlan
from flyaround.simulator.piloting.readouts import duration_text, mission_time
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from flyaround.simulator.piloting.chaser_control import AttitudeMode
    from flyaround.simulator.piloting.docking_figures import Contact
    from flyaround.simulator.piloting.docking_watch import News
    from flyaround.simulator.piloting.jumps import Event
    from flyaround.simulator.piloting.orders import Order, PilotCommand
    from flyaround.simulator.piloting.piloted_craft import Mode
    from flyaround.simulator.piloting.propellant import Propellant
    from flyaround.simulator.piloting.recorder import FlightRecorder
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.flight.world_state import WorldState
    from flyaround.simulator.world.guidance.manual_control import ChaserState

MAX_JUMP_S, PATIENCE_S = 7200.0, 400.0
"""Longest jump to a hold point, and the longest time for which it does not come nearer [s]: that of a way round the
target."""

NEARER = 0.98
"""Ratio of the distance to the least one, below which the chaser has come nearer."""

FRAME_STEP_S = 0.1
"""Simulated time of a single frame at 1x [s]."""

LIT_S = 300.0
"""Less than the time between two eclipses, and more than that between two calls of `FlightSession.step` [s]."""

ECLIPSE_STEP_S, MAX_ECLIPSE_STEPS = 20.0, 500
"""Interval at which a recording is searched for eclipses [s], and the largest number of intervals."""


@dataclass(frozen=True, kw_only=True)
class FlightState:
    """State of a piloted flight at one time.

    Parameters
    ----------
    t_s : float
        Simulated time since the scenario's start [s].
    world : WorldState
        Both craft, Sun and Moon: relative position and velocity, attitudes, rates.
    chaser : ChaserState
        The chaser relative to its target.
    mode : str
        ``guidance`` under the scenario's guidance, ``steer`` once the pilot has taken over.
    attitude : str
        Attitude mode while steering.
    doing : str
        Automatic mode that flies the chaser under ``steer``; empty if it coasts.
    propellant : Propellant
        Delta-v and propellant used under ``steer``.
    contact : Contact or None
        The last contact, with its score.
    docked : bool
        True while the port holds the chaser.
    braking : bool
        True while the brake is active.
    guarded : bool
        True while the keep-out guard overrides the pilot.
    plume : bool
        True while the plume strikes the target.
    news : tuple of News, optional
        Notes, cautions and warnings that began in the last step, as (level, text).
    """

    t_s: float
    world: WorldState
    chaser: ChaserState
    mode: Mode
    attitude: AttitudeMode
    doing: str
    propellant: Propellant
    contact: Contact | None
    docked: bool
    braking: bool
    guarded: bool
    plume: bool
    news: tuple[News, ...] = ()


LEFT = frozenset({"go", "passed"})
"""Decisions on a hold point that the chaser has left behind."""


class FlightSession:
    """A flight that a pilot can watch, slow down, speed up and take over.

    The scenario's guidance flies until the first thrust or rotation is commanded; from then on the chaser is integrated
    from its state. Steps are fixed, so the result depends on the commands and the simulated time alone, not on how
    often `step` is called.

    Parameters
    ----------
    plan : Plan
        Plan from `flyaround.simulator.scenario.plan.plan_flight`; its camera, sensor and seed are used.
    recorder : FlightRecorder, optional
        Records the states for a replay.

    Attributes
    ----------
    clock : FlightClock
        Pause, rate and jumps.
    craft : PilotedCraft
        The chaser with its control, docking and guidance.
    look_back : LookBack
        The recorded flight, for seeking.
    eclipses_s : list of tuple of float
        Start and end of each eclipse that was flown through [s], in the order flown. Pilots do not change them, so a
        seek or a restart leaves them.
    cautions : CautionWatch
        Cautions that began.
    """

    def __init__(self, plan: Plan, recorder: FlightRecorder | None = None) -> None:
        self.plan = plan
        self.clock = FlightClock()
        self.craft = PilotedCraft(plan)
        self.look_back = LookBack(self.craft, self.clock, recorder)
        self.cautions = CautionWatch()
        self.eclipses_s: list[tuple[float, float]] = []
        self._left: frozenset[str] = frozenset()
        self._jump_from, self._nearest = 0.0, (0.0, 0.0)

    @staticmethod
    def of(
        scenario: Scenario, *, seed: int | None = None, recorder: FlightRecorder | None = None
    ) -> FlightSession:
        """Return a session on a scenario.

        Returns
        -------
        FlightSession
            Session at the scenario's start.
        """
        return FlightSession(plan_flight(scenario, n=1, seed=seed), recorder)

    @property
    def t_s(self) -> float:
        """Simulated time since the scenario's start [s]."""
        return self.craft.t_s

    @property
    def flight(self) -> Flight:
        """The flight, as far as it is propagated."""
        return self.craft.flight

    @property
    def marks(self) -> list[Mark]:
        """Hold points and contacts of the flight in order of time, also those after a time that was sought."""
        return self.look_back.marks

    @property
    def state(self) -> FlightState:
        """Present state, without news."""
        craft, steering = self.craft, self.craft.steering
        return FlightState(
            t_s=craft.t_s,
            world=craft.world,
            chaser=craft.chaser,
            mode=craft.mode,
            attitude=steering.attitude,
            doing=steering.doing,
            propellant=steering.propellant,
            contact=craft.docking.contact,
            docked=craft.docking.docked,
            braking=steering.braking,
            guarded=steering.guarded,
            plume=steering.plume,
        )

    def is_over(self, message: str) -> bool:
        """Return True if the cause of a caution or warning of the flight has ended, or a note is no longer true.

        Returns
        -------
        bool
            True if it may go; False also for a text that is none of the flight's.
        """
        return cause_ended(self, message)

    def scene(self) -> SceneState:
        """Return the present scene, for the scenario's own camera.

        The frame number is the simulated time in hundredths of a second, so that the noise depends on the time only.

        Returns
        -------
        SceneState
            Scene at the session's time.
        """
        return self.plan.scene_of(self.craft.world, round(self.t_s * 100))

    # --- time

    def step(self, command: PilotCommand, dt_s: float) -> FlightState:
        """Carry out a command's orders, then fly with its thrust and rotation for ``dt_s``.

        Parameters
        ----------
        command : PilotCommand
            Command that is held over the whole span.
        dt_s : float
            Real time [s]: the flight advances by this times the clock's rate (by default 1), in whole steps of
            `STEP_S`; a remainder is added to the next call. While the clock is paused, only orders are carried out.

        Returns
        -------
        FlightState
            The state reached, with the news of this step.

        Raises
        ------
        UserError
            If the span is negative or not finite, an order is refused, or the flight cannot continue.
        """
        if not 0 <= dt_s * self.clock.rate < math.inf:
            raise UserError(
                f"a step of {dt_s} s at the rate {self.clock.rate}: give 0 or more, and finite numbers"
            )
        news = tuple(answer for order in command.orders if (answer := self.order(order)) is not None)
        steering = self.craft.steering
        steering.hold(command)
        if self.look_back.active and not (steering.takes_over or self.look_back.changed):
            self._left = self._hold_points_left()
            if not self.clock.paused and self.look_back.play(dt_s * self.clock.rate):
                if self.clock.rate > 1.0:
                    steering.news.append(("note", "the replay has ended; time runs at 1x again"))
                self.clock.rest()
            return replace(self.state, news=(*news, *steering.pop_news()))
        self.look_back.fly_on()
        if steering.takes_over:
            self.craft.take_over()
        if not self.clock.paused:
            self.clock.add(dt_s)
            self._run()
            self._note_eclipse(self.craft.world)
        self._note_marks()
        new_cautions = self.cautions.news(
            self.craft.world,
            steering.propellant,
            guarded=steering.guarded,
            drifts=self.craft.drifts,
            drift_risk=self.craft.drift_risk(),
        )
        return replace(self.state, news=(*news, *steering.pop_news(), *new_cautions))

    def order(self, order: Order) -> News | None:
        """Carry out one order now; return the answer to the pilot.

        Returns
        -------
        News or None
            Answer to the pilot; None if there is nothing to say.

        Raises
        ------
        UserError
            If it is refused; nothing has changed then.
        """
        craft = self.craft
        before = craft.t_s, craft.steered, craft.controls()
        try:
            news = order.carry_out(craft)
        except UserError:
            craft.restore(*before)
            raise
        if isinstance(order, Abort):
            self.clock.slow_down()
        return news

    def step_frame(self) -> None:
        """Advance by one frame and pause."""
        self.clock.paused = True
        if self.look_back.active:
            self.look_back.step(1)
            return
        end = self.t_s + FRAME_STEP_S * self.clock.rate
        while self.t_s < end - 1e-9 * self.clock.rate:
            self._fly(min(self._step_s(), end - self.t_s))

    def restart(self) -> None:
        """Return to the start, under guidance; pause, rate and the pilot's choices but for burns are kept."""
        choices = replace(self.craft.choices, burns=BurnPlan())
        self.look_back.restart()
        self.clock.reset()
        self.craft.restart()
        self.craft.choices = choices
        self.look_back.leave_trail()
        self.cautions = CautionWatch()

    def _run(self) -> None:
        while not self.clock.paused and self.clock.consume(h := self._step_s()):
            self._fly(h)

    def show_recording(self) -> None:
        """Let a replayed recording be sought through from now on, before it is flown; nothing happens without one."""
        if self.look_back.show_recording():
            end_s = self.look_back.timeline.end_s
            for t_s in np.linspace(0.0, end_s, min(int(end_s / ECLIPSE_STEP_S), MAX_ECLIPSE_STEPS) + 2):
                self._note_eclipse(self.flight.state(float(t_s)))

    def _note_eclipse(self, world: WorldState) -> None:
        """Extend the eclipse that the target is in, or add a new one."""
        if world.sun_visible_fraction > 0.0:
            return
        spans, t_s = self.eclipses_s, world.t_s
        k = next((k for k, (a, b) in enumerate(spans) if a - LIT_S < t_s < b + LIT_S), len(spans))
        start_s, end_s = (spans[k : k + 1] or [(t_s, t_s)])[0]
        spans[k : k + 1] = [(min(start_s, t_s), max(end_s, t_s))]

    def _hold_points_left(self) -> frozenset[str]:
        """Return the hold points that the chaser has left."""
        # the port is computed with the first hold points
        points = self.craft.docking.hold_points.points if self.craft.steered is not None else ()
        return frozenset(f"{p.name}, {p.axial_m:g} m" for p in points if p.decision in LEFT)

    def _note_marks(self) -> None:
        """Add what happened since the last call."""
        left, contacts, marks = self._hold_points_left(), self.craft.docking.contacts, self.look_back.marks
        known_s = {m.t_s for m in marks if m.kind == "contact"}
        marks += [Mark(self.t_s, "hold-point", name) for name in sorted(left - self._left)]
        marks += [
            Mark(c.t_s, "contact", f"docked, score {c.score}" if c.docked else "contact")
            for c in contacts
            if c.t_s not in known_s
        ]
        self._left = left

    def _step_s(self) -> float:
        h = self.craft.step_s(self.clock.step_s)
        return min(h, self.clock.jump_until_s - self.t_s) if self.clock.jump else h

    def _fly(self, h: float) -> None:
        self.craft.reach(self.t_s + 2 * h)
        self.look_back.record()
        steering, n_contacts = self.craft.steering, len(self.craft.docking.contacts)
        waited_at = steering.waits_at
        self.craft.step(h)
        if steering.waits_at not in ("", waited_at) and self.clock.jump != "hold-point":
            slowed = bool(self.clock.jump) or self.clock.rate > 1.0
            at_1x = "; time runs at 1x again" * slowed
            steering.news.append(("note", f"the autopilot waits at {steering.waits_at}: Go or No-go{at_1x}"))
            if slowed:
                self.clock.set_rate(1.0)
        if len(self.craft.docking.contacts) > n_contacts and (self.clock.jump or self.clock.rate > 1.0):
            # also ends a jump
            self.clock.set_rate(1.0)
            level, text = steering.news[-1]
            steering.news[-1] = level, f"{text}; time runs at 1x again"
        if self.clock.jump and (end := self._jump_end()):
            self.clock.end_jump()
            steering.news.append(end)

    # --- jumps

    def jump_to_event(self, event: Event) -> float:
        """Jump to the next event in the sky; return its time [s].

        Returns
        -------
        float
            Simulated time of the event [s].

        Raises
        ------
        UserError
            If there is none within two orbits.
        """
        when = event_ahead_s(self.plan, self.flight, event, self.t_s)
        self.look_back.fly_on()
        self.clock.start_jump("event", when)
        self._jump_from = self.t_s
        return when

    def jump_to_hold_point(self) -> None:
        """Jump until the autopilot rests at the next hold point, or has docked.

        Raises
        ------
        UserError
            If the autopilot does not fly.
        """
        if not self.craft.steering.autopilot:
            raise UserError("the chaser is not flying to a hold point; engage the autopilot first")
        self.look_back.fly_on()
        self.clock.start_jump("hold-point", self.t_s + MAX_JUMP_S)
        self._nearest = self._hold_point_away_m(), self.t_s
        self._jump_from = self._nearest[0]

    @property
    def at_hold_point(self) -> bool:
        """True if the chaser may leave the next hold point, or has left the last one."""
        craft = self.craft
        return craft.docking.hold_points.next is None or not craft.docking.not_ready(
            craft.chaser, craft.flight
        )

    @property
    def waits_for_go(self) -> bool:
        """True while the autopilot waits at a hold point for the operator's decision."""
        craft = self.craft
        return bool(craft.steering.autopilot and craft.docking.hold_points.next and self.at_hold_point)

    @property
    def jump_text(self) -> str:
        """Destination of a jump and what it waits for, in words; empty without a jump."""
        if self.clock.jump != "hold-point":
            return (
                self.clock.jump and f"the next {self.clock.jump}, at {mission_time(self.clock.jump_until_s)}"
            )
        craft = self.craft
        point = craft.docking.hold_points.next
        if point is None:
            return "the port"
        return f"{point.name}: {', '.join(craft.docking.not_ready(craft.chaser, craft.flight)[:1])}"

    @property
    def jump_share(self) -> float:
        """Flown share of a jump: of its time, or of the way to the hold point."""
        if self.clock.jump == "hold-point":
            return max(1.0 - self._nearest[0] / max(self._jump_from, 1e-9), 0.0)
        span_s = self.clock.jump_until_s - self._jump_from
        return (self.t_s - self._jump_from) / max(span_s, 1e-9)

    def _hold_point_away_m(self) -> float:
        """Return the distance of the docking point from the next hold point, or from the port."""
        craft = self.craft
        figures, point = (
            craft.docking.figures(craft.chaser, craft.flight),
            craft.docking.hold_points.next,
        )
        return float(np.hypot(figures.axial_m - (0.0 if point is None else point.axial_m), figures.lateral_m))

    def _jump_end(self) -> News | None:
        """Return the report on a jump that ends now; None if it goes on."""
        craft, at = self.craft, f"the jump has ended at {mission_time(self.t_s)}, at 1x"
        if self.clock.jump == "event":
            return ("note", at) if self.t_s >= self.clock.jump_until_s - 1e-9 else None
        if not craft.steering.autopilot:
            return "note", at
        point = craft.docking.hold_points.next
        if point is not None and self.at_hold_point:
            craft.steering.waits_at = point.name
            return "note", f"{at}: the chaser waits at {point.name}"
        away_m = self._hold_point_away_m()
        if away_m < NEARER * self._nearest[0]:
            self._nearest = away_m, self.t_s
        if self.t_s < min(self.clock.jump_until_s, self._nearest[1] + PATIENCE_S):
            return None
        goal = "the port" if point is None else point.name
        why = f"no nearer than {self._nearest[0]:.1f} m for {duration_text(self.t_s - self._nearest[1])}"
        held = craft.steering.guard == "scenario" and craft.docking.closed_by(craft.flight, self.t_s)
        return "caution", f"{at}: {goal} {NOT_REACHED}, {why}{f'; {held}' if held else ''}"
