"""An operator's session: clock, guidance or manual control, and the scene to be drawn. No window, no GL."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.chaser_control import BORESIGHT, Steering
from flyaround.simulator.piloting.docking_watch import Docking
from flyaround.simulator.piloting.jumps import event_ahead_s
from flyaround.simulator.piloting.look_back import LookBack
from flyaround.simulator.piloting.open_end import longer_flight
from flyaround.simulator.piloting.planned_burns import predicted_path
from flyaround.simulator.piloting.recorder import FlightRecorder
from flyaround.simulator.piloting.trail import Trail
from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.guidance.manual_control import ChaserState, predicted_drift_lvlh_m, step

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from flyaround.simulator.piloting.chaser_control import AttitudeMode
    from flyaround.simulator.piloting.guidance_modes import LvlhState
    from flyaround.simulator.piloting.jumps import Event
    from flyaround.simulator.piloting.planned_burns import BurnPlan, PredictedPath
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.flight.world_state import WorldState

Mode = Literal["guidance", "steer"]

RATES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
STEP_S = 0.02
"""Step at 1x; it grows with the rate as far as what acts on the chaser allows (`chaser_control`)."""
MOST_STEPS_PER_S = 1000.0
"""Of operator's time. Where steps must be short the clock runs slower than its rate, and the window stays alive."""
HOLD_POINTS_EVERY_S = 0.5
"""How often it is looked whether one was flown past."""
JUMP_RATE = 1000.0
LONGEST_JUMP_S = 7200.0
"""A hold point that is not reached within this is not waited for."""
FRAME_STEP_S = 0.1
"""What one press of the single-frame key advances at 1x."""
LONGEST_TICK_S = 0.25
"""Wall time beyond this (a stalled window) is not made up for."""
FIRST_SPAN_S = 1800.0
MARGIN_S = 60.0
SWAPPED_TRAIL_POINTS = 400
"""Of a future that comes back."""
DRIFT_S = 600.0
"""How far ahead free drift is foretold."""

Jump = Literal["", "event", "hold-point"]


@dataclass(frozen=True)
class Moment:
    """What the session hands out: the world and the chaser in it at one time, and who flies."""

    world: WorldState
    chaser: ChaserState
    target: Target
    mode: Mode
    tracking: bool
    braking: bool
    guarded: bool


class Session:
    """A flight that an operator watches, slows, hurries and takes over.

    The scenario's guidance flies until the first steering key; from then on the chaser is integrated from the
    state it had. Time goes in fixed steps, so the result depends on the keys and the simulated time alone and
    not on how often the window is drawn.

    Parameters
    ----------
    plan : of the scenario, from `flyaround.simulator.scenario.plan.plan_flight`; its camera, sensor and seed are used.
    recorder : keeps the states for a replay, if given.
    """

    def __init__(self, plan: Plan, recorder: FlightRecorder | None = None) -> None:
        self.plan = plan
        self.recorder = recorder
        self.flight: Flight = plan.flight
        self._guided_until_s = plan.flight.duration_s
        self.paused = False
        self.rate = 1.0
        self.look_back = LookBack(self)
        self._reset_state()

    @staticmethod
    def of(scenario: Scenario, *, seed: int | None = None, recorder: FlightRecorder | None = None) -> Session:
        """A session on a scenario."""
        return Session(plan_flight(scenario, n=1, seed=seed), recorder)

    def _reset_state(self) -> None:
        self._t_s = 0.0
        self._owed_s = 0.0
        self._steered: ChaserState | None = None
        self._jump: Jump = ""
        self._jump_until_s = 0.0
        self._hold_points_at_s = 0.0
        chaser = self.plan.scenario.chaser
        self.docking = Docking(self.plan.target, self.plan.flight, chaser.keep_out)
        self.steering = Steering(self.docking, self.plan.scenario.chaser_thrusters, chaser.keep_out)
        self._trail = Trail()
        self._moment: Moment | None = None
        self._leave_trail()

    # --- the clock

    @property
    def t_s(self) -> float:
        """Simulated time since the scenario's start [s]."""
        return self._t_s

    def toggle_pause(self) -> None:
        """Stop or go on."""
        self.paused = not self.paused

    def set_rate(self, rate: float) -> None:
        """Simulated seconds per second.

        Raises
        ------
        ValueError
            If it is not one of ``RATES``.
        """
        if rate not in RATES:
            raise ValueError(f"rate {rate} is not one of {RATES}")
        self.end_jump()
        self.rate = rate

    def faster(self) -> None:
        """The next rate up."""
        self.end_jump()
        self.rate = RATES[min(RATES.index(self.rate) + 1, len(RATES) - 1)]

    def slower(self) -> None:
        """The next rate down."""
        self.end_jump()
        self.rate = RATES[max(RATES.index(self.rate) - 1, 0)]

    def restart(self) -> None:
        """Back to the beginning, with the guidance; pause and rate stay."""
        self.look_back.restart()
        self._reset_state()

    def advance(self, wall_s: float, held: AbstractSet[str] = frozenset()) -> None:
        """Let ``wall_s`` of the operator's time pass with these commands held (`manual_control.HELD`)."""
        self.steering.hold(held)
        if self.look_back.active and not (self.steering.takes_over or self.look_back.changed):
            self._play(min(wall_s, LONGEST_TICK_S) * self.rate)
            return
        self.look_back.fly_on()
        if self.steering.takes_over:
            self.take_over()
        if self.paused:
            return
        self._owed_s += min(wall_s, LONGEST_TICK_S)
        self._run_owed()

    def step_once(self) -> None:
        """One frame further, paused from then on."""
        self.paused = True
        if self.look_back.active:
            self.look_back.step(1)
            return
        end = self._t_s + FRAME_STEP_S * self.rate
        # the small term: sums of equal parts count as the whole
        try:
            while self._t_s < end - 1e-9 * self.rate:
                self._step(min(self._step_s(), end - self._t_s))
        finally:
            self._moment = None
            self._leave_trail()

    def _run_owed(self) -> None:
        """Step for step, each paid with the operator's time that it stands for."""
        stepped = False
        try:
            while not self.paused:
                h = self._step_s()
                costs = max(h / self._rate, 1 / MOST_STEPS_PER_S)
                # the small term: sums of equal parts count as the whole
                if self._owed_s < costs * (1 - 1e-9):
                    break
                self._owed_s = max(self._owed_s - costs, 0.0)
                self._step(h)
                stepped = True
        finally:
            # also where the flight cannot go on: it is shown where it got to
            if stepped:
                self._moment = None
                self._leave_trail()

    @property
    def _rate(self) -> float:
        return JUMP_RATE if self._jump else self.rate

    def _step_s(self) -> float:
        wanted = STEP_S * self._rate
        if self._steered is not None and not self.docking.docked:
            wanted = self.steering.step_s(self._steered, wanted)
        return min(wanted, self._jump_until_s - self._t_s) if self._jump else wanted

    def _step(self, h: float) -> None:
        self._reach(self._t_s + 2 * h)
        self._record()
        if self._steered is None:
            self._t_s += h
        elif self.docking.docked:
            self._t_s += h
            self._steered = self.docking.held_at(self._t_s, self.flight)
        else:
            self._steered = self._pushed(self._steered, h)
            self._t_s = self._steered.t_s
        if self._jump and self._jump_is_done():
            self._jump, self.rate = "", 1.0

    def _pushed(self, before: ChaserState, h: float) -> ChaserState:
        """The chaser a step later, by all that acts on it, and off the target where it touched it."""
        command = self.steering.command(before, self.flight, h)
        moved = step(before, command, h, self.flight.orbit)
        after, news = self.docking.after_step(before, moved, self.flight)
        self.steering.news += news
        if self.docking.docked:
            self.steering.let_go()
        elif after.t_s >= self._hold_points_at_s:
            self._hold_points_at_s = after.t_s + HOLD_POINTS_EVERY_S
            figures = self.docking.figures(after, self.flight)
            self.docking.hold_points.watch(figures, self.docking.corridor_deg)
        return after

    def _play(self, dt_s: float) -> None:
        """Show again what was flown; it stops at its end, where the flight goes on."""
        if not self.paused and self.look_back.play(dt_s):
            self.paused = True

    def _record(self) -> None:
        self.look_back.keep()
        if self.recorder is not None and self.recorder.wants(self._t_s):
            self.recorder.add(self.flight.state_with_chaser(self._now()))

    def _reach(self, t_s: float) -> None:
        """Make the flight long enough, and the track of its guidance where that flies."""
        guided, end_s = self._steered is None, t_s + MARGIN_S
        if end_s <= (self._guided_until_s if guided else self.flight.duration_s):
            return
        grown_s = 2 * (self._guided_until_s if guided else self.flight.duration_s)
        span_s = max(FIRST_SPAN_S, grown_s, end_s + MARGIN_S)
        self.flight = longer_flight(self.plan, self.flight, (span_s, end_s + MARGIN_S), guided=guided)
        if guided:
            self._guided_until_s = self.flight.duration_s

    # --- who flies

    @property
    def mode(self) -> Mode:
        """Who flies the chaser."""
        return "guidance" if self._steered is None else "steer"

    @property
    def tracking(self) -> bool:
        """Whether the attitude follows the target while steering."""
        return self._steered is not None and self.steering.attitude == "target"

    @property
    def guarded(self) -> bool:
        """Whether the keep-out sphere overrules the keys."""
        return self.steering.guarded

    @property
    def braking(self) -> bool:
        """Whether the stop key's brake is at work."""
        return self.steering.braking

    def take_over(self) -> None:
        """Steer from the state the chaser has; the attitude goes on following the target."""
        if self._steered is not None:
            return
        self._steered = self.flight.chaser(self._t_s)
        self._follow_target()

    def _follow_target(self) -> None:
        self.steering.attitude, self.steering.aim = "target", _target_direction(self._now())
        self._moment = None

    def toggle_steering(self) -> None:
        """Guidance to steering, or back onto the scenario's trajectory."""
        if self._steered is None:
            self.take_over()
        else:
            self._steered, self._moment = None, None
            self._reach(self._t_s)
            self.docking.docked = False
            self.steering.let_go()

    def reset_chaser(self) -> None:
        """Back onto the scenario's trajectory at this moment, still steering if that was so."""
        if self._steered is not None:
            self.toggle_steering()
            self.take_over()

    def toggle_tracking(self) -> None:
        """Keep the target where it is in the picture, or leave the attitude to the keys alone.

        While tracking, a turn key moves the place in the picture where the target is kept.
        """
        self.set_attitude("hold" if self.tracking else "target")

    def set_attitude(self, mode: AttitudeMode) -> None:
        """How the attitude is controlled: see `flyaround.simulator.piloting.chaser_control`."""
        self.take_over()
        if mode == "target":
            self._follow_target()
        self.steering.attitude = mode
        self._moment = None

    def centre(self) -> None:
        """Turn to the target and track it."""
        self.take_over()
        self.steering.attitude, self.steering.aim = "target", BORESIGHT
        self._moment = None

    def stop(self) -> None:
        """Brake to rest relative to the target's LVLH frame; a turn stops at once."""
        self.take_over()
        self.steering.brake()
        self._moment = None

    def abort(self) -> None:
        """Turn away from the target in the next step, at no more than the clock's own rate."""
        self.take_over()
        self.steering.abort()
        self._jump, self.rate, self.paused = "", min(self.rate, 1.0), False
        self._moment = None

    @property
    def chaser(self) -> ChaserState:
        """The chaser now, at less cost than the whole `moment`."""
        return self._now()

    def state_lvlh(self) -> LvlhState:
        """Position [m] and velocity [m s-1] of the chaser now, LVLH, (3,) each."""
        chaser = self._now()
        p, v = np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        return self.flight.orbit.frame(chaser.t_s).from_eci(p, v)

    # --- jumps

    @property
    def jumping(self) -> bool:
        """Whether time is hurried to a moment."""
        return bool(self._jump)

    def jump_to_event(self, event: Event) -> float:
        """Hurry to the next event of the sky; when it is [s].

        Raises
        ------
        UserError
            If there is none within two orbits.
        """
        self.look_back.fly_on()
        when = event_ahead_s(self.plan, self.flight, event, self._t_s)
        self._jump, self._jump_until_s, self.paused = "event", when, False
        return when

    def jump_to_hold_point(self) -> None:
        """Hurry until the autopilot rests at the next hold point, or has docked.

        Raises
        ------
        UserError
            If the autopilot does not fly.
        """
        if not self.steering.autopilot:
            raise UserError("nothing flies to a hold point; engage the autopilot first (docking.approach)")
        self.look_back.fly_on()
        self._jump, self._jump_until_s = "hold-point", self._t_s + LONGEST_JUMP_S
        self.paused = False

    def end_jump(self) -> None:
        """Back to 1x, at once."""
        if self._jump:
            self._jump, self.rate = "", 1.0

    def _jump_is_done(self) -> bool:
        if self._t_s >= self._jump_until_s - 1e-9:
            return True
        if self._jump != "hold-point":
            return False
        if not self.steering.autopilot or self._steered is None:
            return True
        if self.docking.hold_points.next is None:
            return False
        return not self.docking.not_ready(self._steered, self.flight)

    def _now(self) -> ChaserState:
        return self.flight.chaser(self._t_s) if self._steered is None else self._steered

    # --- what looking back asks of it

    @property
    def steered(self) -> ChaserState | None:
        """The chaser where it is steered; None while the scenario's guidance flies it."""
        return self._steered

    def controls(self) -> object:
        """What flies the chaser, but for what is held."""
        return (self.mode, self.steering.kept(), self.docking.kept())

    def bring_back(self, t_s: float, steered: ChaserState | None, controls: Any) -> None:  # noqa: ANN401 - of `controls`
        """Be at another place of what was flown."""
        self._t_s, self._steered, self._owed_s, self._moment = t_s, steered, 0.0, None
        self._jump, self._hold_points_at_s = "", t_s
        self.steering.bring_back(controls[1])
        self.docking.bring_back(controls[2])

    def future_left(self, t_s: float) -> None:
        """What was flown after a time does not belong to the flight any more."""
        self._trail.cut(t_s)
        if self.recorder is not None:
            self.recorder.leave_after(t_s)

    def future_swapped(self) -> None:
        """What was left last belongs to it again, and what came instead does not."""
        timeline = self.look_back.timeline
        times = np.linspace(0.0, timeline.end_s, SWAPPED_TRAIL_POINTS)
        flown = [(float(t), timeline.chaser_between(float(t))) for t in times]
        self._trail.replace((t, self._lvlh_position(c or self.flight.chaser(t))) for t, c in flown)
        if self.recorder is not None:
            self.recorder.swap_future()

    # --- what is seen

    @property
    def moment(self) -> Moment:
        """The world now."""
        if self._moment is None:
            chaser = self._now()
            world = self.flight.state_with_chaser(chaser)
            self._moment = Moment(
                world, chaser, self.plan.target, self.mode, self.tracking, self.braking, self.guarded
            )
        return self._moment

    def scene(self) -> SceneState:
        """The picture to draw now, as the scenario's own camera takes it.

        The frame number is the simulated time in hundredths of a second, so that a moment has one noise.
        """
        return self.plan.scene_of(self.moment.world, round(self._t_s * 100))

    @property
    def trail(self) -> list[Vec3]:
        """Where the chaser was, LVLH [m], thinned over a long flight."""
        return self._trail.points

    def planned_path_lvlh_m(self, samples: int = 200) -> list[Vec3]:
        """The scenario's own trajectory over its duration, LVLH [m]."""
        times = np.linspace(0.0, self.plan.scenario.duration_s, samples)
        return [self._lvlh_position(self.flight.chaser(float(t))) for t in times]

    def predicted_drift_lvlh_m(self) -> FloatArray:
        """Where the chaser would drift without thrust over the next minutes, LVLH (n, 3) [m]."""
        return predicted_drift_lvlh_m(self.flight.orbit, self.moment.chaser, DRIFT_S)

    def predicted_burns(
        self, plan: BurnPlan | None = None, after_s: float = DRIFT_S, samples: int = 60
    ) -> PredictedPath:
        """The path that follows from planned burns, and where each of them is.

        Parameters
        ----------
        plan : instead of what is planned. after_s : after the last of them. samples : of each leg.
        """
        burns = self.steering.burns if plan is None else plan
        return predicted_path(self.flight.orbit, self.chaser, burns, after_s, samples)

    def _lvlh_position(self, chaser: ChaserState) -> Vec3:
        p, v = np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        return vec3(self.flight.lvlh(chaser.t_s).from_eci(p, v)[0])

    def _leave_trail(self) -> None:
        if self._trail.wants(self._t_s):
            self._trail.add(self._t_s, self._lvlh_position(self.moment.chaser))


def _target_direction(chaser: ChaserState) -> Vec3:
    los = -matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ np.array(chaser.position_eci_m)
    return vec3(los / np.linalg.norm(los))
