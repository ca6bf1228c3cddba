"""A chaser flown by a command script, in LVLH or camera axes, guarded by its keep-out sphere."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.runtime.sections import MetresXyz, Rate, Seconds, Section, SpeedXyz
from flyaround.simulator.world.guidance.chaser import Chaser
from flyaround.simulator.world.guidance.manual_control import (
    ChaserState,
    SteeringCommand,
    guarded_command,
    step,
)
from flyaround.simulator.world.time.steps import step_count

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.attitude.pointing import Pointing
    from flyaround.simulator.world.orbit.propagation import OrbitTrack


class ScriptedCommand(Section, frozen=True, kw_only=True):
    """A thrust, or a rotation of the camera, for a time; overlapping commands add up."""

    start_s: Annotated[float, Meta(ge=0, le=1e6)]
    duration_s: Seconds
    acceleration_m_s2: SpeedXyz = (0.0, 0.0, 0.0)
    # lvlh: radial, along-track, cross-track; camera: right, down, forward
    axes: Literal["lvlh", "camera"] = "lvlh"
    # angular velocity of the camera relative to the stars, unless with_tracking_camera keeps it on the target
    rate_camera_deg_s: tuple[Rate, Rate, Rate] = (0.0, 0.0, 0.0)


class CommandScript(Chaser, tag_field="mode", tag="steered", frozen=True, kw_only=True):
    """Free flight with an operator's recorded commands; ``tracking`` keeps the camera on the target."""

    position_lvlh_m: MetresXyz
    velocity_lvlh_m_s: SpeedXyz = (0.0, 0.0, 0.0)
    commands: Annotated[list[ScriptedCommand], Meta(max_length=10_000)] = msgspec.field(default_factory=list)
    tracking: bool = True
    # braking acceleration and period of the keep-out guard
    brake_m_s2: Annotated[float, Meta(gt=0, le=100)] = 0.05
    period_s: Annotated[float, Meta(ge=0.05, le=60)] = 0.5

    def state_lvlh(self, t_s: float, n_rad_s: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        """Return the initial state.

        Returns
        -------
        position_lvlh_m : (3,) array
            Position at t = 0, LVLH [m], at any ``t_s``.
        velocity_lvlh_m_s : (3,) array
            Velocity at t = 0 in the rotating frame [m s-1].
        """
        return np.array(self.position_lvlh_m, float), np.array(self.velocity_lvlh_m_s, float)

    def command(self, t_s: float) -> SteeringCommand:
        """Return the command at a time.

        Returns
        -------
        SteeringCommand
            Sum of the commands that have started by ``t_s`` and not ended, zero if there are none. The attitude
            rate is that of the script, also if the camera tracks the target.
        """
        sums = {"lvlh": np.zeros(3), "camera": np.zeros(3)}
        rate = np.zeros(3)
        for scripted in self.commands:
            if scripted.start_s <= t_s < scripted.start_s + scripted.duration_s:
                sums[scripted.axes] = sums[scripted.axes] + np.array(scripted.acceleration_m_s2)
                rate = rate + np.radians(scripted.rate_camera_deg_s)
        return SteeringCommand(
            acceleration_camera_m_s2=vec3(sums["camera"]),
            acceleration_lvlh_m_s2=vec3(sums["lvlh"]),
            rate_camera_rad_s=vec3(rate),
        )

    def times_s(self, duration_s: float) -> list[float]:
        """Return the start of each step: every period, and whenever a command starts or ends.

        Returns
        -------
        list of float
            Increasing times since the start [s], the first 0 and all below ``duration_s``.
        """
        edges = {
            t
            for scripted in self.commands
            for t in (scripted.start_s, scripted.start_s + scripted.duration_s)
        }
        grid = set((np.arange(step_count(duration_s, self.period_s)) * self.period_s).tolist())
        return sorted(grid | {t for t in edges if 0 < t < duration_s})


@dataclass(frozen=True, eq=False, kw_only=True)
class ScriptedTrack:
    """A flight under scripted manual control: state at the start of each step, and command during it.

    Parameters
    ----------
    orbit : OrbitTrack
        Orbit of the target.
    pointing : Pointing
        Pointing of the camera while it tracks.
    script : CommandScript
        The script.
    times_s : list of float
        Start of each step [s].
    states : list of ChaserState
        State at the start of each step.
    commands : list of SteeringCommand
        Command of each step.
    guarded_s : float or None
        Time of the keep-out guard's first intervention, or None.
    overruled : list of bool
        For each step, True if the guard changed the command.
    """

    orbit: OrbitTrack
    pointing: Pointing
    script: CommandScript
    times_s: list[float]
    states: list[ChaserState]
    commands: list[SteeringCommand]
    guarded_s: float | None
    overruled: list[bool]

    def __call__(self, t_s: float) -> ChaserState:
        """Return the state of the chaser."""
        k = max(bisect_right(self.times_s, t_s) - 1, 0)
        since_step = t_s - self.times_s[k]
        state = (
            self.states[k]
            if since_step == 0
            else step(self.states[k], self.commands[k], since_step, self.orbit)
        )
        return with_tracking_camera(state, self.orbit, self.pointing) if self.script.tracking else state


def fly_script(orbit: OrbitTrack, script: CommandScript, n_rad_s: float) -> ScriptedTrack:
    """Fly a script to the end of the target's track, with the keep-out guard.

    Parameters
    ----------
    orbit : OrbitTrack
        Orbit of the target.
    script : CommandScript
        Start and commands.
    n_rad_s : float
        Mean motion.

    Returns
    -------
    ScriptedTrack
        States and commands of the steps of `CommandScript.times_s`. The commands are those that the guard allowed;
        without a ``keep_out`` none is changed.
    """
    pointing, keep_out = script.pointing, script.keep_out
    p, v = orbit.frame(0.0).to_eci(*script.state_lvlh(0.0, n_rad_s))
    initial = ChaserState(
        t_s=0.0,
        position_eci_m=vec3(p),
        velocity_eci_m_s=vec3(v),
        q_camera_from_eci_wxyz=(1.0, 0.0, 0.0, 0.0),
    )
    state = with_tracking_camera(initial, orbit, pointing)
    times = script.times_s(orbit.duration_s)
    states, commands, guarded_s = [], [], None
    overrulings = []
    for t, end in zip(times, [*times[1:], orbit.duration_s], strict=True):
        if script.tracking:
            state = with_tracking_camera(state, orbit, pointing)
        command = script.command(t)
        if script.tracking:
            command = replace(command, rate_camera_rad_s=state.omega_camera_rad_s)
        overruled = False
        if keep_out is not None:
            command, overruled = guarded_command(
                state, command, end - t, orbit.frame(t), keep_out, script.brake_m_s2
            )
            guarded_s = t if overruled and guarded_s is None else guarded_s
        states.append(state)
        commands.append(command)
        overrulings.append(overruled)
        state = replace(step(state, command, end - t, orbit), t_s=end)
    return ScriptedTrack(
        orbit=orbit,
        pointing=pointing,
        script=script,
        times_s=times,
        states=states,
        commands=commands,
        guarded_s=guarded_s,
        overruled=overrulings,
    )


def with_tracking_camera(state: ChaserState, orbit: OrbitTrack, pointing: Pointing) -> ChaserState:
    """Return the state with the camera's attitude and rate set by the pointing."""
    p, v = np.array(state.position_eci_m), np.array(state.velocity_eci_m_s)
    q, omega = pointing.attitude(-p, -v, orbit.frame(state.t_s))
    return replace(state, q_camera_from_eci_wxyz=quat(q), omega_camera_rad_s=vec3(omega))
