"""An operator's session: clock, guidance or manual control, and the scene to be drawn. No window, no GL."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from gui.flight import manual_control
from gui.flight.manual_control import STEERING, THRUST
from gui.flight.recorder import FlightRecorder
from simulator.runtime.arrays import Vec3, vec3
from simulator.scenario.flight import fly
from simulator.scenario.plan import plan_flight
from simulator.world.frames.rotation import matrix_from_quat
from simulator.world.guidance.manual_control import (
    ChaserState,
    Command,
    guarded_command,
    predicted_drift_lvlh_m,
    step,
)

if TYPE_CHECKING:
    from collections.abc import Set as AbstractSet

    from simulator.runtime.arrays import FloatArray
    from simulator.scenario.plan import Plan
    from simulator.scenario.scenario import Scenario
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target
    from simulator.world.flight.flight import Flight
    from simulator.world.flight.world_state import WorldState

Mode = Literal["guidance", "steer"]

RATES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
STEP_S = 0.02
"""Integration step at 1x; it grows with the rate, so that the cost per second of wall time stays the same."""
FRAME_STEP_S = 0.1
"""What one press of the single-frame key advances at 1x."""
LONGEST_TICK_S = 0.25
"""Wall time beyond this (a stalled window) is not made up for."""
FIRST_SPAN_S = 1800.0
MARGIN_S = 60.0
TRAIL_POINTS = 4000
DRIFT_S = 600.0
"""How far ahead free drift is foretold."""
BORESIGHT: Vec3 = (0.0, 0.0, 1.0)


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
    plan : of the scenario, from `simulator.scenario.plan.plan_flight`; its camera, sensor and seed are used.
    recorder : keeps the states for a replay, if given.
    """

    def __init__(self, plan: Plan, recorder: FlightRecorder | None = None) -> None:
        self.plan = plan
        self.recorder = recorder
        self._keep_out = plan.scenario.chaser.keep_out
        self.flight: Flight = plan.flight
        self.paused = False
        self.rate = 1.0
        self._reset_state()

    @staticmethod
    def of(scenario: Scenario, *, seed: int | None = None, recorder: FlightRecorder | None = None) -> Session:
        """A session on a scenario."""
        return Session(plan_flight(scenario, n=1, seed=seed), recorder)

    def _reset_state(self) -> None:
        self._t_s = 0.0
        self._owed_s = 0.0
        self._held: frozenset[str] = frozenset()
        self._steered: ChaserState | None = None
        self._aim: Vec3 | None = None
        self._braking = False
        self._guarded = False
        if self.recorder is not None:
            self.recorder.clear()
        self.trail: list[Vec3] = []
        self._trail_every_s = 0.5
        self._trail_t_s = -np.inf
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
        self.rate = rate

    def faster(self) -> None:
        """The next rate up."""
        self.rate = RATES[min(RATES.index(self.rate) + 1, len(RATES) - 1)]

    def slower(self) -> None:
        """The next rate down."""
        self.rate = RATES[max(RATES.index(self.rate) - 1, 0)]

    def restart(self) -> None:
        """Back to the beginning, with the guidance; pause and rate stay."""
        self._reset_state()

    def advance(self, wall_s: float, held: AbstractSet[str] = frozenset()) -> None:
        """Let ``wall_s`` of the operator's time pass with these commands held (`manual_control.HELD`)."""
        self._held = frozenset(held)
        if self._held & STEERING:
            self.take_over()
            self._braking = self._braking and not self._held & frozenset(THRUST)
        if self.paused:
            return
        self._owed_s += min(wall_s, LONGEST_TICK_S) * self.rate
        h = STEP_S * self.rate
        # the small term: sums of equal parts count as the whole
        steps = int(self._owed_s / h + 1e-9)
        self._owed_s = max(self._owed_s - steps * h, 0.0)
        self._run(steps, h)

    def step_once(self) -> None:
        """One frame further, paused from then on."""
        self.paused = True
        h = STEP_S * self.rate
        self._run(round(FRAME_STEP_S / STEP_S), h)

    def _run(self, steps: int, h: float) -> None:
        if steps == 0:
            return
        self._reach(self._t_s + steps * h + h)
        for _ in range(steps):
            self._record()
            if self._steered is None:
                self._t_s += h
            else:
                self._steered = step(self._steered, self._command(self._steered, h), h, self.flight.orbit)
                self._t_s = self._steered.t_s
        self._moment = None
        self._leave_trail()

    def _record(self) -> None:
        if self.recorder is not None and self.recorder.wants(self._t_s):
            self.recorder.add(self.flight.state_with_chaser(self._now()))

    def _reach(self, t_s: float) -> None:
        """Make the flight long enough; its camera keeps the reference it was planned with."""
        if t_s + MARGIN_S <= self.flight.duration_s:
            return
        span = max(FIRST_SPAN_S, 2 * self.flight.duration_s, t_s + 2 * MARGIN_S)
        longer = fly(self.plan.scenario, self.plan.target, span)
        self.flight = replace(longer, pointing=self.flight.pointing)

    # --- who flies

    @property
    def mode(self) -> Mode:
        """Who flies the chaser."""
        return "guidance" if self._steered is None else "steer"

    @property
    def tracking(self) -> bool:
        """Whether the attitude follows the target while steering."""
        return self._aim is not None

    @property
    def guarded(self) -> bool:
        """Whether the keep-out sphere overrules the keys."""
        return self._guarded

    @property
    def braking(self) -> bool:
        """Whether the stop key's brake is at work."""
        return self._braking

    def take_over(self) -> None:
        """Steer from the state the chaser has; the attitude goes on following the target."""
        if self._steered is not None:
            return
        self._steered = self.flight.chaser(self._t_s)
        self._aim = _target_direction(self._steered)
        self._moment = None

    def toggle_steering(self) -> None:
        """Guidance to steering, or back onto the scenario's trajectory."""
        if self._steered is None:
            self.take_over()
        else:
            self._steered, self._aim, self._moment = None, None, None
            self._braking = self._guarded = False

    def reset_chaser(self) -> None:
        """Back onto the scenario's trajectory at this moment, still steering if that was so."""
        if self._steered is not None:
            self._steered = None
            self._braking = False
            self.take_over()

    def toggle_tracking(self) -> None:
        """Keep the target where it is in the picture, or leave the attitude to the keys alone.

        While tracking, a turn key moves the place in the picture where the target is kept.
        """
        if self._steered is None:
            self.take_over()
        self._aim = _target_direction(self._now()) if self._aim is None else None
        self._moment = None

    def centre(self) -> None:
        """Turn to the target and track it."""
        self.take_over()
        self._aim = BORESIGHT
        self._moment = None

    def stop(self) -> None:
        """Brake to rest relative to the target's LVLH frame; a turn stops at once."""
        self.take_over()
        self._braking = True
        self._moment = None

    def _now(self) -> ChaserState:
        return self.flight.chaser(self._t_s) if self._steered is None else self._steered

    def _command(self, chaser: ChaserState, h: float) -> Command:
        acceleration = manual_control.thrust_camera_m_s2(self._held)
        if self._braking:
            brake, speed = manual_control.brake_camera_m_s2(chaser, self.flight.lvlh(chaser.t_s), h)
            acceleration = acceleration + brake
            self._braking = speed >= manual_control.BRAKED_M_S
        wanted = manual_control.turn_camera_rad_s(self._held)
        if self._aim is not None:
            self._aim = manual_control.turned_aim(self._aim, wanted, h)
            wanted = wanted + manual_control.tracking_rate_rad_s(chaser, self._aim)
        command = manual_control.command(acceleration, wanted, chaser, h)
        if self._keep_out is None:
            return command
        frame = self.flight.orbit.frame(chaser.t_s)
        command, self._guarded = guarded_command(
            chaser, command, h, frame, self._keep_out, manual_control.BRAKE_M_S2
        )
        return command

    # --- what is seen

    @property
    def moment(self) -> Moment:
        """The world now."""
        if self._moment is None:
            chaser = self._now()
            world = self.flight.state_with_chaser(chaser)
            self._moment = Moment(
                world, chaser, self.plan.target, self.mode, self.tracking, self._braking, self._guarded
            )
        return self._moment

    def scene(self) -> SceneState:
        """The picture to draw now, as the scenario's own camera takes it.

        The frame number is the simulated time in hundredths of a second, so that a moment has one noise.
        """
        return self.plan.scene_of(self.moment.world, round(self._t_s * 100))

    def planned_path_lvlh_m(self, samples: int = 200) -> list[Vec3]:
        """The scenario's own trajectory over its duration, LVLH [m]."""
        times = np.linspace(0.0, self.plan.scenario.duration_s, samples)
        return [self._lvlh_position(self.flight.chaser(float(t))) for t in times]

    def predicted_drift_lvlh_m(self) -> FloatArray:
        """Where the chaser would drift without thrust over the next minutes, LVLH (n, 3) [m]."""
        return predicted_drift_lvlh_m(self.flight.orbit, self.moment.chaser, DRIFT_S)

    def _lvlh_position(self, chaser: ChaserState) -> Vec3:
        p, v = np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        return vec3(self.flight.lvlh(chaser.t_s).from_eci(p, v)[0])

    def _leave_trail(self) -> None:
        if self._t_s - self._trail_t_s < self._trail_every_s:
            return
        self._trail_t_s = self._t_s
        self.trail.append(self._lvlh_position(self.moment.chaser))
        if len(self.trail) > TRAIL_POINTS:
            # the whole flight stays in view, at half the density
            self.trail = self.trail[::2]
            self._trail_every_s *= 2


def _target_direction(chaser: ChaserState) -> Vec3:
    los = -matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ np.array(chaser.position_eci_m)
    return vec3(los / np.linalg.norm(los))
