"""Flight log: phases, thrust, propellant, and events such as an abort."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.guidance.command_script import ScriptedTrack
    from flyaround.simulator.world.guidance.thruster_control import ControlledTrack
    from flyaround.simulator.world.orbit.burns import Burn

EventKind = Literal["abort", "retreated", "guarded", "burn", "burn_end", "shadow", "sunlight"]


@dataclass(frozen=True, kw_only=True)
class Event:
    """An event of a flight.

    Parameters
    ----------
    t_s : float
        Time since the flight's start [s].
    kind : EventKind
        Kind, one word.
    what : str
        Description, part of a sentence.
    """

    t_s: float
    kind: EventKind
    what: str


@dataclass(frozen=True, kw_only=True)
class ThrustState:
    """Thrust of the chaser at one time; None if unknown.

    Parameters
    ----------
    phase : str
        Phase of the chaser, one or two words.
    acceleration_lvlh_m_s2 : array, optional
        Acceleration by thrusters alone, along the target's LVLH axes.
    mass_kg : float, optional
        Mass of the chaser.
    delta_v_m_s : float, optional
        Total since the start.
    """

    phase: str
    acceleration_lvlh_m_s2: Vec3 | None = None
    mass_kg: float | None = None
    delta_v_m_s: float | None = None


@dataclass(frozen=True, eq=False)
class FlightLog:
    """The log of one flight.

    Parameters
    ----------
    flight : Flight
        The propagated flight.
    """

    flight: Flight
    _totals_m_s: list[float] = field(init=False)

    def __post_init__(self) -> None:
        """Sum the delta-v of the steps."""
        f = self.flight
        delta_v_m_s: list[float] = []
        if f.controlled is not None:
            delta_v_m_s = [
                float(np.linalg.norm(a)) * f.controlled.period_s for a in f.controlled.thrust_eci_m_s2
            ]
        elif f.scripted is not None and f.recording is None:
            spans = pairwise([*f.scripted.times_s, f.duration_s])
            delta_v_m_s = [
                float(np.linalg.norm(_commanded_acceleration(f.scripted, k))) * (end - start)
                for k, (start, end) in enumerate(spans)
            ]
        object.__setattr__(self, "_totals_m_s", [0.0, *accumulate(delta_v_m_s)])

    def thrust_state(self, t_s: float) -> ThrustState:
        """Return the chaser's thrust and phase at ``t_s``."""
        f = self.flight
        if f.recording is not None:
            return ThrustState(phase="replay")
        if f.controlled is not None:
            return self._controlled(f.controlled, t_s)
        if f.scripted is not None:
            return self._scripted(f.scripted, t_s)
        if f.guidance.ballistic:
            return _ballistic(f.guidance.phase(t_s), f.burns, t_s)
        # the chaser follows its path exactly, by forces that are not modelled
        return ThrustState(phase=f.guidance.phase(t_s))

    def _controlled(self, track: ControlledTrack, t_s: float) -> ThrustState:
        k = min(max(int(t_s // track.period_s), 0), len(track.mass_kg) - 1)
        start = k * track.period_s
        a = track.thrust_eci_m_s2[k]
        phase = self.flight.guidance.phase(t_s)
        if track.abort_s is not None and start >= track.abort_s:
            phase = "retreat" if _still_retreating(track, k) else "drift"
        is_over = t_s >= start + track.period_s
        return ThrustState(
            phase=phase,
            acceleration_lvlh_m_s2=vec3(track.orbit.frame(start).R_eci_from_lvlh.T @ a),
            mass_kg=track.end_mass_kg if is_over else float(track.mass_kg[k]),
            delta_v_m_s=self._totals_m_s[k] + float(np.linalg.norm(a)) * min(t_s - start, track.period_s),
        )

    def _scripted(self, track: ScriptedTrack, t_s: float) -> ThrustState:
        k = max(bisect_right(track.times_s, t_s) - 1, 0)
        start = track.times_s[k]
        a = _commanded_acceleration(track, k)
        frame = track.orbit.frame(start)
        lvlh = frame.R_eci_from_lvlh.T @ a
        phase = "guarded" if track.overruled[k] else "commanded" if a.any() else "coast"
        return ThrustState(
            phase=phase,
            acceleration_lvlh_m_s2=vec3(lvlh),
            delta_v_m_s=self._totals_m_s[k] + float(np.linalg.norm(a)) * (t_s - start),
        )

    def events(self, times_s: Sequence[float] = (), sun_fractions: Sequence[float] = ()) -> list[Event]:
        """Return the events in order of time.

        Parameters
        ----------
        times_s : sequence of float, optional
            Times of samples of the Sun's visibility.
        sun_fractions : sequence of float, optional
            Visible fraction of the Sun at the target at these times; without them eclipses are omitted.
        """
        f = self.flight
        events = _shadow_events(times_s, sun_fractions)
        for burn in f.burns if f.recording is None else ():
            speed = float(np.linalg.norm(burn.delta_v_lvlh_m_s))
            events.append(
                Event(t_s=burn.start_s, kind="burn", what=f"burn of the {burn.craft}, {speed:.4g} m/s")
            )
            if burn.duration_s > 0:
                events.append(Event(t_s=burn.end_s, kind="burn_end", what=f"end of the {burn.craft}'s burn"))
        if f.controlled is not None and f.controlled.abort_s is not None:
            events += _abort_events(f.controlled, f.controlled.abort_s)
        if f.scripted is not None and f.recording is None:
            starts = (
                t
                for t, was_overruled, is_overruled in zip(
                    f.scripted.times_s, [False, *f.scripted.overruled], f.scripted.overruled, strict=False
                )
                if is_overruled and not was_overruled
            )
            events += [
                Event(t_s=t, kind="guarded", what="the keep-out sphere's guard overrules the commands")
                for t in starts
            ]
        return sorted((e for e in events if e.t_s <= f.duration_s), key=lambda e: e.t_s)

    @property
    def delta_v_m_s(self) -> float | None:
        """Delta-v of the whole flight [m s-1]; None if unknown."""
        return self.thrust_state(self.flight.duration_s).delta_v_m_s

    @property
    def propellant_kg(self) -> float | None:
        """Propellant of the whole flight [kg]; None if unknown."""
        track = self.flight.controlled
        return None if track is None else float(track.mass_kg[0]) - track.end_mass_kg


def _commanded_acceleration(track: ScriptedTrack, k: int) -> FloatArray:
    """Return the acceleration of a step, along GCRS axes."""
    command = track.commands[k]
    camera = matrix_from_quat(track.states[k].q_camera_from_eci_wxyz).T @ np.array(
        command.acceleration_camera_m_s2, float
    )
    if not any(command.acceleration_lvlh_m_s2):
        return np.asarray(camera)
    frame = track.orbit.frame(track.times_s[k])
    return np.asarray(camera + frame.R_eci_from_lvlh @ np.array(command.acceleration_lvlh_m_s2, float))


def _still_retreating(track: ControlledTrack, k: int) -> bool:
    """Return True if the retreat after an abort continues."""
    reach = 0.0 if track.keep_out is None else 2 * track.keep_out.radius_m
    return float(np.linalg.norm(track.position_eci_m[k])) <= reach


def _ballistic(phase: str, burns: tuple[Burn, ...], t_s: float) -> ThrustState:
    """Return the thrust state of free flight with burns."""
    total, thrust = 0.0, np.zeros(3)
    for burn in burns:
        if burn.craft != "chaser" or burn.start_s > t_s:
            continue
        fraction = 1.0 if burn.duration_s == 0 else min((t_s - burn.start_s) / burn.duration_s, 1.0)
        total += fraction * float(np.linalg.norm(burn.delta_v_lvlh_m_s))
        if burn.duration_s > 0 and t_s < burn.end_s:
            thrust = thrust + np.array(burn.acceleration_lvlh_m_s2)
    return ThrustState(
        phase="burn" if thrust.any() else phase, acceleration_lvlh_m_s2=vec3(thrust), delta_v_m_s=total
    )


def _abort_events(track: ControlledTrack, abort_s: float) -> list[Event]:
    k = round(abort_s / track.period_s)
    distance = float(np.linalg.norm(track.position_eci_m[k]))
    events = [
        Event(
            t_s=abort_s,
            kind="abort",
            what=f"abort {distance:.2f} m from the target, inside the keep-out sphere and outside its corridor: "
            "straight outward",
        )
    ]
    end_period = next((j for j in range(k, len(track.mass_kg)) if not _still_retreating(track, j)), None)
    if end_period is not None:
        t_s = end_period * track.period_s
        events.append(Event(t_s=t_s, kind="retreated", what="twice the sphere's radius away: free drift"))
    return events


def _shadow_events(times_s: Sequence[float], sun_fractions: Sequence[float]) -> list[Event]:
    events = []
    for t, (previous, current) in zip(times_s[1:], pairwise(sun_fractions), strict=True):
        if previous > 0 >= current:
            events.append(Event(t_s=float(t), kind="shadow", what="the target is in full shadow"))
        elif previous <= 0 < current:
            events.append(Event(t_s=float(t), kind="sunlight", what="the target leaves full shadow"))
    return events
