"""Chaser control: thrust and rotation at each step, from manual demand, modes, planned burns and autopilot."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import msgspec
import numpy as np

from flyaround.simulator.piloting import control_laws as laws
from flyaround.simulator.piloting.autopilot import Autopilot
from flyaround.simulator.piloting.control_laws import NO_DEMAND, THRUST, TURN, Demand
from flyaround.simulator.piloting.guidance_modes import CONTROL_PERIOD_S
from flyaround.simulator.piloting.hold_points import not_ready
from flyaround.simulator.piloting.planned_burns import BurnPlan
from flyaround.simulator.piloting.propellant import Propellant, plume_strikes
from flyaround.simulator.piloting.readouts import mission_time, speed_text
from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.frames.lvlh import Lvlh
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.guidance.keep_out import Guard, KeepOut
from flyaround.simulator.world.guidance.manual_control import guarded_command
from flyaround.simulator.world.guidance.thruster_control import retreat_impulse

if TYPE_CHECKING:
    from flyaround.simulator.piloting.control_laws import Switch
    from flyaround.simulator.piloting.docking_watch import Docking, News
    from flyaround.simulator.piloting.guidance_modes import ActiveGuidance
    from flyaround.simulator.piloting.hold_points import HoldPoint
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.guidance.manual_control import ChaserState, SteeringCommand
    from flyaround.simulator.world.guidance.thrusters import Thrusters

Axes = Literal["camera", "lvlh"]
Thrust = Literal["continuous", "pulse"]
AttitudeMode = Literal["rate", "hold", "target", "dock"]
ATTITUDE_MODES: tuple[AttitudeMode, ...] = get_args(AttitudeMode)
GUARDS: tuple[Guard, ...] = get_args(Guard)
"""The keep-out sphere with the scenario's corridor, with one that turns with the docking port, or lifted."""

# Boresight of the camera in its own frame.
BORESIGHT: Vec3 = (0.0, 0.0, 1.0)

OFF_DEG = 0.05  # least offset of a tracked target that is named

ACTIVE_STEP_S = 0.2
"""Longest step while manual control, brake or autopilot thrust, or while contact is possible [s]."""

AUTOPILOT_PERIOD_S = 0.1
"""Period of the autopilot's decisions [s]."""

# Longest step while no thruster fires [s].
COAST_STEP_S = 20.0

ABORT_M_S2 = 0.25
"""Acceleration of an abort [m s-2]."""

MIN_HOLD_COST_M_S = 0.5
"""Delta-v of a hold below which it is no caution, however short the way was [m s-1]; chosen by eye."""

HOLD_COSTS = "has cost"  # part of the caution of a hold that costs more than the way to it
UNGUIDED = "the chaser drifts unguided"  # part of the cautions after an abort
PLUME_CAUTION = "the plume strikes the target: push sideways, or from farther away"
PLUME_CAUTION_INTERVAL_S = 300.0
"""Minimum time between two cautions about plume impingement, unless it was clear between them [s]."""
PLUME_CLEAR_S = 10.0
"""Time without plume impingement after which its caution is over [s]; longer than between two pulses of a key."""

# LVLH components (radial, along-track, cross-track) of thrust right, down, forward: up is radial, forward is
# along-track
LVLH_FROM_DEMAND = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])

UNSAVED_ATTRIBUTES = frozenset({"docking", "keep_out", "guard", "news", "_demand"})
"""Attributes that are not part of the saved state: other objects, the pilot's choice of the keep-out sphere, news, and
the manual demand."""


class Steering:
    """Thrust and rotation of a chaser that is not under the scenario's guidance.

    Parameters
    ----------
    docking : Docking
        Source of the docking figures.
    thrusters : Thrusters
        Thrusters, for the propellant used.
    keep_out : KeepOut or None
        Sphere that manual control must not enter.
    """

    def __init__(self, docking: Docking, thrusters: Thrusters, keep_out: KeepOut | None) -> None:
        self.docking = docking
        self.keep_out = keep_out
        self.axes: Axes = "camera"
        self.thrust: Thrust = "continuous"
        self.guard: Guard = "scenario" if keep_out is None else keep_out.pilot_choice
        self.burns = BurnPlan()
        self.propellant = Propellant(thrusters)
        self.news: list[News] = []
        self.taken_over_lvlh_m: Vec3 = (0.0, 0.0, 0.0)
        """Position of the chaser when it was taken over from the scenario's guidance."""
        self._demand = Demand()
        self.release_controls()

    def release_controls(self) -> None:
        """Stop thrust and rotation; planned burns and the propellant count are not changed."""
        self.attitude: AttitudeMode = "hold"
        self.aim: Vec3 = BORESIGHT
        self.braking = False
        self.guarded = False
        self.plume = False
        self._plume_told_s = self._plume_s = -np.inf
        self.guided: ActiveGuidance | None = None
        self.aborting = False
        self.autopilot = False
        self.waits_at = ""
        """Hold point at which the autopilot has arrived; empty on the way."""
        self._leg_from_m_s = self._hold_from_m_s = 0.0
        self._hold_reported = False
        self._demand = replace(self._demand, thrust=NO_DEMAND, turn=NO_DEMAND)
        self._pulse_m_s = np.zeros(3)
        self._pulse_rad = np.zeros(3)
        self._guided_m_s2 = np.zeros(3)
        self._guided_until_s = -np.inf
        self._pilot_demand = Demand()
        self._pilot_until_s = -np.inf

    def saved_state(self) -> dict[str, Any]:
        """Return the state that a seek must restore, without the manual demand."""
        return {name: value for name, value in vars(self).items() if name not in UNSAVED_ATTRIBUTES}

    def restore_state(self, state: dict[str, Any]) -> None:
        """Restore a state that `saved_state` returned."""
        vars(self).update(state)

    @property
    def _abort_sphere(self) -> KeepOut:
        """The scenario's sphere, also if it is lifted, or one about the target."""
        return self.keep_out or KeepOut(radius_m=2 * self.docking.radius_m + 5.0)

    @property
    def retreat_to_m(self) -> float:
        """Range at which an abort ends [m]."""
        return 2 * self._abort_sphere.radius_m

    @property
    def sphere(self) -> KeepOut | None:
        """The keep-out sphere; its corridor's axis is in target axes if it turns with the port. None if lifted."""
        if self.keep_out is None or self.guard == "lifted":
            return None
        if self.guard == "scenario":
            return self.keep_out
        return msgspec.structs.replace(self.keep_out, corridor_axis_lvlh=vec3(self.docking.port.axis_target))

    # --- the pilot's demand

    def hold(self, demand: Demand) -> None:
        """Hold a demand from now on; in pulse mode each switch that is newly closed gives one pulse."""
        if self.thrust == "pulse":
            closed = demand.switches - self._demand.switches
            self._add_pulse(closed, demand.gain)
        self._demand = demand
        if demand.pushes:
            self._end_automatic_modes()

    def _add_pulse(self, switches: frozenset[Switch], gain: float) -> None:
        self._pulse_m_s = self._pulse_m_s + laws.PULSE_M_S * gain * laws.direction(THRUST, switches)
        self._pulse_rad = self._pulse_rad + laws.PULSE_RAD * gain * laws.direction(TURN, switches)

    def _clear_demand(self) -> None:
        """Discard the demand, until the next `hold`."""
        self._demand = Demand()
        self._pulse_m_s = np.zeros(3)

    def _end_automatic_modes(self) -> None:
        if self.doing and not self.docking.docked:
            self.news.append(("note", f"{self.doing} has ended: you push"))
        self.braking = False
        self._end_modes()

    def pulse(self, switch: Switch) -> None:
        """Give one pulse in a switch's direction, in any thrust mode."""
        self._add_pulse(frozenset({switch}), 1.0)
        if switch in THRUST:
            self._end_automatic_modes()

    @property
    def takes_over(self) -> bool:
        """True if the demand requires taking over from the scenario's guidance."""
        return not self._demand.idle

    def brake(self) -> None:
        """Brake to rest next to the target."""
        self._end_modes()
        self._clear_demand()
        self.braking = True

    def guide(self, guided: ActiveGuidance | None) -> None:
        """Start a guidance mode, or end it."""
        self._end_modes()
        self.braking = False
        self.guided = guided

    def engage_autopilot(self) -> None:
        """Fly to the next hold point and, after the last, into the port, with the docking attitude."""
        self._end_modes()
        self.braking = False
        self._leg_from_m_s = self.propellant.delta_v_m_s
        self.autopilot = True
        self.attitude = "dock"

    def abort(self) -> None:
        """Retreat from the target in the next step, and point the boresight at it.

        The retreat is radially outward, which stays inside an approach corridor.
        """
        self._end_modes()
        self.braking = False
        self.burns = BurnPlan()
        self._clear_demand()
        self.docking.docked = False
        self.aborting = True
        self.attitude, self.aim = "target", BORESIGHT

    def _end_modes(self) -> None:
        self.guided, self.autopilot, self.aborting = None, False, False
        self.waits_at = ""
        self._guided_until_s = self._pilot_until_s = -np.inf
        self._pilot_demand = Demand()

    @property
    def doing(self) -> str:
        """The controller that flies the chaser, for display; empty if it coasts under manual control."""
        if self.docking.docked:
            return "docked"
        if self.aborting:
            return "abort"
        if self.autopilot:
            return "autopilot"
        return "" if self.guided is None else self.guided.title

    @property
    def attitude_text(self) -> str:
        """The attitude mode in words, with the angle by which turn keys put a tracked target off the boresight."""
        if self.attitude != "target":
            return self.attitude
        off_deg = float(np.degrees(np.arccos(np.clip(np.dot(self.aim, BORESIGHT), -1.0, 1.0))))
        return f"track, {off_deg:.1f}° off" if off_deg >= OFF_DEG else "track target"

    def pop_news(self) -> list[News]:
        """Return the news since the last call."""
        news, self.news = self.news, []
        return news

    # --- a step

    def step_s(self, chaser: ChaserState, wanted_s: float) -> float:
        """Return the length of the next step [s].

        Parameters
        ----------
        chaser : ChaserState
            Present state.
        wanted_s : float
            Step given by the clock's rate.
        """
        longest = min(wanted_s, self._max_step_s(chaser))
        edge = self.burns.next_edge_s(chaser.t_s) - chaser.t_s
        return min(longest, edge) if edge > 1e-9 else longest

    def _max_step_s(self, chaser: ChaserState) -> float:
        t_s = chaser.t_s
        if self.guided is not None:
            if t_s >= self.guided.coasts_from_s:
                return COAST_STEP_S
            remaining_s = self._guided_until_s - t_s
            return remaining_s if remaining_s > 1e-9 else CONTROL_PERIOD_S
        if self.autopilot:
            remaining_s = self._pilot_until_s - t_s
            return remaining_s if remaining_s > 1e-9 else AUTOPILOT_PERIOD_S
        is_active = self.takes_over or self.braking or self.aborting
        if is_active or self._pulse_m_s.any() or self._pulse_rad.any():
            return ACTIVE_STEP_S
        # half of the straight-line time to the target
        speed = max(float(np.linalg.norm(chaser.velocity_eci_m_s)), 1e-3)
        arrives = 0.5 * max(self.docking.gap_m(chaser), 0.0) / speed
        return max(ACTIVE_STEP_S, min(COAST_STEP_S, arrives))

    def command(self, chaser: ChaserState, flight: Flight, h: float) -> SteeringCommand:
        """Return the command over a step of length ``h``, and add its propellant to the total."""
        frame = flight.orbit.frame(chaser.t_s)
        R_camera_from_lvlh = matrix_from_quat(chaser.q_camera_from_eci_wxyz) @ frame.R_eci_from_lvlh
        thrust_camera, thrust_lvlh = self._thrust(chaser, flight, frame, h)
        rate = laws.slewed_command(thrust_camera, self._turn(chaser, flight, frame, h), chaser, h)
        command = replace(rate, acceleration_lvlh_m_s2=vec3(thrust_lvlh))
        self.guarded = False
        if (sphere := self.sphere) is not None:
            turning = target_frame(flight, chaser.t_s) if self.guard == "port" else None
            command, self.guarded = guarded_command(
                chaser, command, h, frame, sphere, laws.BRAKE_M_S2, turning
            )
        thrust = np.array(command.acceleration_camera_m_s2) + R_camera_from_lvlh @ np.array(
            command.acceleration_lvlh_m_s2
        )
        self.propellant = self.propellant.after(thrust, h)
        self._watch_plume(chaser.t_s, plume_strikes(chaser, thrust, self.docking.radius_m))
        left = self.burns.after(chaser.t_s + h)
        for burn in self.burns.burns[: len(self.burns.burns) - len(left.burns)]:
            self.news.append(
                ("note", f"the burn of {speed_text(burn.size_m_s)} at {mission_time(burn.t_s)} is flown")
            )
        self.burns = left
        return command

    def _watch_plume(self, t_s: float, strikes: bool) -> None:  # noqa: FBT001 - result of a check
        again = t_s >= self._plume_told_s + PLUME_CAUTION_INTERVAL_S or self.plume_clear(t_s)
        self.plume = strikes
        # the advice is for a pilot, not for a controller
        strikes = strikes and not (self.doing or self.braking)
        if strikes and again:
            self._plume_told_s = t_s
            self.news.append(("caution", PLUME_CAUTION))
        self._plume_s = t_s if strikes else self._plume_s

    def plume_clear(self, t_s: float) -> bool:
        """Return True if a pilot's plume has been clear of the target for `PLUME_CLEAR_S`, or if time was set back."""
        return not 0.0 <= t_s - self._plume_s < PLUME_CLEAR_S

    # --- pushes

    def _thrust(
        self, chaser: ChaserState, flight: Flight, frame: Lvlh, h: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return (3,) thrust per mass along camera axes, and (3,) along LVLH axes [m s-2]."""
        thrust_lvlh = self.burns.acceleration_lvlh_m_s2(chaser.t_s, chaser.t_s + h)
        manual = self._manual_thrust(h)
        if self.axes == "lvlh":
            thrust_camera, thrust_lvlh = np.zeros(3), thrust_lvlh + LVLH_FROM_DEMAND @ manual
        else:
            thrust_camera = manual
        if self.braking:
            brake, speed = laws.brake_camera_m_s2(chaser, frame, h)
            thrust_camera = thrust_camera + brake
            self.braking = speed >= laws.BRAKE_RELEASE_M_S
            if not self.braking:
                self.news.append(("note", "at rest; it drifts from here: Station keeping holds"))
        if self.aborting:
            thrust_lvlh = thrust_lvlh + self._retreat(chaser, frame, h)
        elif self.guided is not None:
            thrust_lvlh = thrust_lvlh + self._guidance(self.guided, chaser, frame)
        elif self.autopilot:
            thrust_camera = thrust_camera + self._pilot(chaser, flight)
        return thrust_camera, thrust_lvlh

    def _manual_thrust(self, h: float) -> FloatArray:
        """Return the (3,) demanded thrust with pulses: right, down, forward [m s-2]."""
        demand = self._demand
        push = laws.ACCELERATION_M_S2 * demand.gain * np.array(demand.thrust)
        if self.thrust == "continuous":
            push = push + demand.switched_thrust_m_s2()
        if self._pulse_m_s.any():
            max_change = laws.ACCELERATION_M_S2 * h
            pulse = np.clip(self._pulse_m_s, -max_change, max_change)
            self._pulse_m_s = self._pulse_m_s - pulse
            self._pulse_m_s[np.abs(self._pulse_m_s) < 1e-12] = 0.0
            push = push + pulse / h
        return push

    def _retreat(self, chaser: ChaserState, frame: Lvlh, h: float) -> FloatArray:
        p, v = frame.from_eci(np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s))
        impulse = retreat_impulse(p, v, self._abort_sphere)
        size = float(np.linalg.norm(impulse))
        if float(np.linalg.norm(p)) > self.retreat_to_m:
            self.aborting = False
            self.news.append(("caution", f"the abort is done: {UNGUIDED}"))
        return impulse / max(size, 1e-12) * min(ABORT_M_S2, size / h)

    def _guidance(self, guided: ActiveGuidance, chaser: ChaserState, frame: Lvlh) -> FloatArray:
        if chaser.t_s >= self._guided_until_s - 1e-9:
            state = frame.from_eci(np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s))
            self._guided_m_s2 = guided.acceleration_lvlh(chaser.t_s, state)
            self._guided_until_s = chaser.t_s + CONTROL_PERIOD_S
        return self._guided_m_s2

    def _pilot(self, chaser: ChaserState, flight: Flight) -> FloatArray:
        if chaser.t_s >= self._pilot_until_s - 1e-9:
            docking = self.docking
            pilot = Autopilot(docking.port, docking.radius_m, docking.limits)
            point = docking.hold_points.next
            figures = docking.figures(chaser, flight)
            goal = None if point is None else point.axial_m
            reasons = not_ready(point, figures, docking.limits, docking.corridor_deg) if point else ()
            self._watch_hold(point, is_ready=not reasons)
            self._pilot_demand = pilot.demand(figures, goal, AUTOPILOT_PERIOD_S)
            self._pilot_until_s = chaser.t_s + AUTOPILOT_PERIOD_S
        return self._pilot_demand.switched_thrust_m_s2()

    def _watch_hold(self, point: HoldPoint | None, *, is_ready: bool) -> None:
        """Note the arrival at the next hold point, and report once that holding there costs more than the way to it."""
        spent_m_s = self.propellant.delta_v_m_s
        if point is None or point.name != self.waits_at:
            if self.waits_at:
                self._leg_from_m_s = spent_m_s
            self.waits_at = point.name if point and is_ready else ""
            self._hold_from_m_s, self._hold_reported = spent_m_s, False
            return
        held_m_s, way_m_s = spent_m_s - self._hold_from_m_s, self._hold_from_m_s - self._leg_from_m_s
        if held_m_s > max(way_m_s, MIN_HOLD_COST_M_S) and not self._hold_reported:
            self._hold_reported = True
            costs = f"{speed_text(held_m_s)}, the way there {speed_text(way_m_s)}"
            self.news.append(
                ("caution", f"holding at {point.name} {HOLD_COSTS} {costs}: Go or Free drift ends it")
            )

    # --- turns

    def _turn(self, chaser: ChaserState, flight: Flight, frame: Lvlh, h: float) -> FloatArray:
        """Return the commanded rate (3,) relative to ECI, camera axes [rad s-1]."""
        demand = self._demand
        demanded_rate = laws.RATE_RAD_S * demand.gain * np.array(demand.turn)
        if self.thrust == "continuous":
            demanded_rate = demanded_rate + demand.switched_turn_rad_s()
        if self._pulse_rad.any():
            most = laws.PULSE_RAD_S * h
            pulse = np.clip(self._pulse_rad, -most, most)
            self._pulse_rad = self._pulse_rad - pulse
            self._pulse_rad[np.abs(self._pulse_rad) < 1e-12] = 0.0
            demanded_rate = demanded_rate + pulse / h
        match self.attitude:
            case "rate":
                # integrate, so that a released key leaves the rate
                return np.array(chaser.omega_camera_rad_s) + demanded_rate * (h / laws.RATE_TIME_S)
            case "target":
                self.aim = laws.rotated_aim(self.aim, demanded_rate, h)
                return demanded_rate + laws.tracking_rate_rad_s(chaser, self.aim, h)
            case "dock":
                return demanded_rate + laws.docked_rate_rad_s(
                    chaser, flight.attitude(chaser.t_s), self.docking.port, h
                )
            case "hold":
                if self.axes == "lvlh":
                    R_camera_from_eci = matrix_from_quat(chaser.q_camera_from_eci_wxyz)
                    demanded_rate = demanded_rate + R_camera_from_eci @ frame.omega_eci_rad_s
                return demanded_rate


def target_frame(flight: Flight, t_s: float) -> Lvlh:
    """Return the target's body axes as a rotating frame, of the form of LVLH."""
    q, omega_target_rad_s = flight.attitude(t_s)
    R_eci_from_target = matrix_from_quat(q)
    return Lvlh(R_eci_from_target, R_eci_from_target @ omega_target_rad_s)
