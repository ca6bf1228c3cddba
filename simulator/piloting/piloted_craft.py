"""The chaser next to its target at one time, under guidance or manual control."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from flyaround.simulator.piloting.chaser_control import Steering
from flyaround.simulator.piloting.docking_port import target_from_lvlh
from flyaround.simulator.piloting.docking_watch import Docking
from flyaround.simulator.piloting.hold_points import DISTANCES_M
from flyaround.simulator.piloting.open_end import longer_flight
from flyaround.simulator.piloting.planned_burns import BurnPlan, predicted_path
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.guidance.manual_control import predicted_drift_lvlh_m, step

if TYPE_CHECKING:
    from flyaround.simulator.piloting.chaser_control import AttitudeMode, Axes, Thrust
    from flyaround.simulator.piloting.docking_figures import DockingLimits
    from flyaround.simulator.piloting.docking_port import DockingPort
    from flyaround.simulator.piloting.guidance_modes import LvlhState
    from flyaround.simulator.piloting.planned_burns import PredictedPath
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.flight.world_state import WorldState
    from flyaround.simulator.world.guidance.keep_out import Guard, KeepOut
    from flyaround.simulator.world.guidance.manual_control import ChaserState

Mode = Literal["guidance", "steer"]

HOLD_POINTS_EVERY_S = 0.5
"""Period of the check for passed hold points."""

# Shortest span of the propagated orbit [s].
FIRST_SPAN_S = 1800.0

MARGIN_S = 60.0
"""Smallest span for which the flight is propagated ahead [s]."""

PREDICTION_S = 600.0
"""Span of the prediction after the last burn."""

PASSED, DRIFT_SAMPLES = 1.5, 25
"""Ratio of the predicted time to that of a straight way to the target; and points of a drift over `PREDICTION_S`."""

PATH_STEPS, LEG_STEPS = 200, 5
"""Numbers of points of a path, and of each of its legs, that are compared with the keep-out sphere."""

INTO_TARGET = "leads into the target"


@dataclass(frozen=True)
class PilotChoices:
    """Choices of the pilot that fly nothing by themselves.

    Parameters
    ----------
    guard : str
        Corridor of the keep-out sphere, or none.
    axes : str
        Axes of thrust.
    thrust : str
        Continuous thrust, or pulses.
    limits : DockingLimits
        Limits of a docking.
    port : DockingPort or None
        Docking axis that replaces the target's own.
    burns : BurnPlan
        Planned burns.
    """

    guard: Guard
    axes: Axes
    thrust: Thrust
    limits: DockingLimits
    port: DockingPort | None
    burns: BurnPlan


class PilotedCraft:
    """The chaser, its controls, and the flight of its target, which is propagated on demand.

    Parameters
    ----------
    plan : Plan
        Plan of the scenario; its guidance flies until `take_over`.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.flight: Flight = plan.flight
        self._guided_until_s = plan.flight.duration_s
        self._guided: tuple[Flight, ChaserState] | None = None
        self._world: tuple[Flight, ChaserState, WorldState] | None = None
        self.restart()

    def restart(self) -> None:
        """Return to the flight's start, under guidance."""
        self.t_s = 0.0
        self.steered: ChaserState | None = None
        """The manually controlled chaser; None under guidance."""
        self._hold_points_at_s = 0.0
        self._forecast: tuple[tuple[BurnPlan, Guard, int], tuple[float, str]] | None = None
        self._drift: tuple[tuple[Guard, int, int], str] | None = None
        scenario = self.plan.scenario
        self.docking = Docking(self.plan.target, self.plan.flight, scenario.chaser.keep_out)
        self.steering = Steering(self.docking, scenario.chaser_thrusters, scenario.chaser.keep_out)

    # --- state

    @property
    def mode(self) -> Mode:
        """Controller of the chaser: guidance or manual."""
        return "guidance" if self.steered is None else "steer"

    @property
    def tracking(self) -> bool:
        """True while the chaser under manual control tracks the target."""
        return self.steered is not None and self.steering.attitude == "target"

    @property
    def drifts(self) -> bool:
        """True while neither guidance nor pilot flies the chaser."""
        steering = self.steering
        return self.steered is not None and not (steering.doing or steering.takes_over or steering.braking)

    @property
    def chaser(self) -> ChaserState:
        """Present state of the chaser."""
        if self.steered is not None:
            return self.steered
        if self._guided is None or self._guided[0] is not self.flight or self._guided[1].t_s != self.t_s:
            self._guided = self.flight, self.flight.chaser(self.t_s)
        return self._guided[1]

    @property
    def world(self) -> WorldState:
        """Present state of the world, with the chaser."""
        chaser = self.chaser
        if self._world is None or self._world[0] is not self.flight or self._world[1] is not chaser:
            self._world = self.flight, chaser, self.flight.state_with_chaser(chaser)
        return self._world[2]

    def state_lvlh(self) -> LvlhState:
        """Return the present state of the chaser in the target's rotating LVLH frame.

        Returns
        -------
        tuple of array
            Position (3,) [m] and velocity (3,) [m s-1].
        """
        chaser = self.chaser
        p, v = np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        return self.flight.orbit.frame(chaser.t_s).from_eci(p, v)

    @property
    def sphere(self) -> KeepOut | None:
        """The keep-out sphere now, with its corridor along LVLH axes; None if there is none, or it is lifted."""
        sphere = self.steering.sphere
        if sphere is None or sphere.corridor_axis_lvlh is None or self.steering.guard == "scenario":
            return sphere
        R_target_from_lvlh = target_from_lvlh(self.flight, self.t_s)
        axis = vec3(R_target_from_lvlh.T @ np.array(sphere.corridor_axis_lvlh))
        return msgspec.structs.replace(sphere, corridor_axis_lvlh=axis)

    def predicted_burns(
        self, plan: BurnPlan | None = None, after_s: float = PREDICTION_S, samples: int = 60
    ) -> PredictedPath:
        """Predict the path through planned burns.

        Parameters
        ----------
        plan : BurnPlan, optional
            Replaces the planned burns.
        after_s : float
            Span after the last burn [s].
        samples : int
            Points per leg between burns.

        Returns
        -------
        PredictedPath
            Positions in LVLH [m] over time [s].
        """
        burns = self.steering.burns if plan is None else plan
        return predicted_path(self.flight.orbit, self.chaser, burns, after_s, samples)

    def risk_of(self, points_lvlh_m: FloatArray) -> str:
        """Return what makes a path dangerous, as a predicate; the corridor of the keep-out sphere is that of now.

        Parameters
        ----------
        points_lvlh_m : (n, 3) array
            Positions along the path, joined by straight lines.

        Returns
        -------
        str
            That it leads into the target's bounding sphere, or through the keep-out sphere; empty otherwise.
        """
        p, sphere = points_lvlh_m, self.sphere
        steps = np.linspace(0.0, 1.0, max(PATH_STEPS // max(len(p), 1), LEG_STEPS))[:, None]
        path = np.concatenate([p[:0], *(a + steps * (b - a) for a, b in pairwise(p))])
        ranges_m = np.linalg.norm(path, axis=1)
        if ranges_m.min(initial=np.inf) <= self.docking.radius_m:
            return INTO_TARGET
        inside = path[ranges_m < (0.0 if sphere is None else sphere.radius_m)]
        if sphere is not None and any(sphere.violated(point) for point in inside):
            return f"leads through the keep-out sphere of {sphere.radius_m:g} m"
        return ""

    def burns_forecast(self) -> tuple[float, str]:
        """Return closest approach and risk of the path with the planned burns that have not started.

        Returns
        -------
        tuple
            Least distance to the target's centre of mass [m], infinite without a burn, and `risk_of` the path.
        """
        steering = self.steering
        key = steering.burns, steering.guard, int(self.t_s)
        if self._forecast is None or self._forecast[0] != key:
            ahead = BurnPlan(tuple(b for b in steering.burns.burns if b.start_s >= self.t_s))
            path = self.predicted_burns(ahead).points_lvlh_m if ahead.burns else np.zeros((0, 3))
            nearest_m = float(np.linalg.norm(path, axis=1).min(initial=np.inf))
            self._forecast = key, (nearest_m, self.risk_of(path))
        return self._forecast[1]

    def drift_risk(self) -> str:
        """Return the risk of the free drift under manual control; empty if guidance or burns will change it.

        Returns
        -------
        str
            `risk_of` the drift over `PREDICTION_S`, of a closing chaser until it has passed the target, at most over
            an orbit; without a contact at the end of the approach corridor.
        """
        steering = self.steering
        if self.steered is None or steering.doing or steering.braking or steering.burns.burns:
            return ""
        p, v = self.state_lvlh()
        passes_s = PASSED * float(p @ p) / -float(p @ v) if p @ v < 0 else 0.0
        span_s = max(min(passes_s, 2 * np.pi / self.flight.n_rad_s), PREDICTION_S)
        spans = round(span_s / PREDICTION_S)
        # a long prediction costs more, and changes less
        key = steering.guard, spans, int(self.t_s / spans)
        if self._drift is None or self._drift[0] != key:
            path = predicted_drift_lvlh_m(
                self.flight.orbit, self.steered, span_s, DRIFT_SAMPLES * min(spans, 3)
            )
            risk = self.risk_of(path)
            figures = self.docking.figures(self.steered, self.flight)
            docks = figures.off_axis_deg <= self.docking.corridor_deg and figures.range_m <= DISTANCES_M[0]
            if risk == INTO_TARGET and docks:
                risk = ""
            self._drift = key, risk
        return self._drift[1]

    # --- control

    @property
    def choices(self) -> PilotChoices:
        """The pilot's present choices; setting them computes the hold points of another docking axis again."""
        steering, docking = self.steering, self.docking
        return PilotChoices(
            steering.guard,
            steering.axes,
            steering.thrust,
            docking.limits,
            docking.chosen_port,
            steering.burns,
        )

    @choices.setter
    def choices(self, choices: PilotChoices) -> None:
        steering, docking = self.steering, self.docking
        steering.guard, steering.axes, steering.thrust = choices.guard, choices.axes, choices.thrust
        docking.limits, steering.burns = choices.limits, choices.burns
        if choices.port != docking.chosen_port:
            docking.choose_port(choices.port, self.chaser, self.flight)

    def take_over(self) -> None:
        """Take over manual control from the chaser's state; the attitude continues to track the target."""
        if self.steered is None:
            self.steered = self.flight.chaser(self.t_s)
            self.steering.taken_over_lvlh_m = vec3(self.state_lvlh()[0])
            self.set_attitude("target")

    def follow_guidance(self) -> None:
        """Return the chaser to the scenario's trajectory."""
        self.steered = None
        self.reach(self.t_s)
        self.docking.docked = False
        self.steering.release_controls()

    def set_attitude(self, mode: AttitudeMode) -> None:
        """Take over and select an attitude mode; ``target`` keeps the target at its position in the image."""
        self.take_over()
        if mode == "target":
            chaser = self.chaser
            los = -matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ np.array(chaser.position_eci_m)
            self.steering.aim = vec3(los / np.linalg.norm(los))
        self.steering.attitude = mode

    # --- a step

    def step_s(self, wanted_s: float) -> float:
        """Compute the length of the next step.

        Returns
        -------
        float
            Length [s], at most ``wanted_s``: less if a burn starts or ends, or a controller needs shorter steps.
        """
        if self.steered is None or self.docking.docked:
            return wanted_s
        return self.steering.step_s(self.steered, wanted_s)

    def reach(self, t_s: float) -> None:
        """Propagate the flight beyond ``t_s``, with the guidance's track if it flies.

        Raises
        ------
        UserError
            If the flight cannot be propagated so long.
        """
        guided, end_s = self.steered is None, t_s + MARGIN_S
        reached_s = self._guided_until_s if guided else self.flight.duration_s
        if end_s <= reached_s:
            return
        span_s = max(FIRST_SPAN_S, 2 * reached_s, end_s + MARGIN_S)
        self.flight = longer_flight(self.plan, self.flight, (span_s, end_s + MARGIN_S), guided=guided)
        if guided:
            self._guided_until_s = self.flight.duration_s

    def step(self, h: float) -> None:
        """Fly one step of length ``h`` [s]; the flight must `reach` its end."""
        if self.steered is None:
            self.t_s += h
        elif self.docking.docked:
            self.t_s += h
            self.steered = self.docking.held_at(self.t_s, self.flight)
        else:
            self.steered = self._pushed(self.steered, h)
            self.t_s = self.steered.t_s

    def _pushed(self, before: ChaserState, h: float) -> ChaserState:
        """Return the chaser a step later, after a rebound if it touched the target."""
        command = self.steering.command(before, self.flight, h)
        moved = step(before, command, h, self.flight.orbit)
        after, news = self.docking.after_step(before, moved, self.flight)
        self.steering.news += news
        if self.docking.docked:
            self.steering.release_controls()
        elif after.t_s >= self._hold_points_at_s:
            self._hold_points_at_s = after.t_s + HOLD_POINTS_EVERY_S
            figures = self.docking.figures(after, self.flight)
            self.docking.hold_points.watch(figures, self.docking.corridor_deg)
        return after

    # --- seeking

    def controls(self) -> tuple[Mode, dict[str, Any], dict[str, Any]]:
        """Return the guidance state that a seek must restore, without pressed keys.

        Returns
        -------
        mode : str
            ``guidance`` or ``steer``.
        steering : dict
            State of the controls, see `Steering.saved_state`.
        docking : dict
            State of the docking monitor, see `Docking.saved_state`.
        """
        return self.mode, self.steering.saved_state(), self.docking.saved_state()

    def restore(self, t_s: float, steered: ChaserState | None, controls: Any) -> None:  # noqa: ANN401 - of `controls`
        """Restore an earlier state."""
        self.t_s, self.steered, self._hold_points_at_s = t_s, steered, t_s
        self._forecast = self._drift = None
        self.steering.restore_state(controls[1])
        self.docking.restore_state(controls[2])
