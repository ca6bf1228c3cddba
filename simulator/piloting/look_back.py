"""The recorded past of a flight: seek, replay, and continuation from an earlier time.

Seeking and replay do not change the recorded flight. Steering, or any order that changes the control, continues the
flight from the time shown and discards the later part.
"""

from __future__ import annotations

import pickle
from bisect import bisect_left
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.flight_history import Timeline
from flyaround.simulator.runtime.arrays import Vec3, vec3

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.simulator.piloting.clock import FlightClock
    from flyaround.simulator.piloting.piloted_craft import PilotedCraft
    from flyaround.simulator.piloting.recorder import FlightRecorder
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.flight.world_state import WorldState
    from flyaround.simulator.world.guidance.manual_control import ChaserState

# Maximum number of points of the trail, and their interval [s]; a longer trail is thinned. More points cost the map
# drawing time, fewer make its curves angular.
MAX_TRAIL_POINTS = 4000
TRAIL_INTERVAL_S = 0.5

RESTORED_TRAIL_POINTS = 400
"""Points of the trail of a restored future."""


@dataclass(frozen=True)
class Mark:
    """A hold point that the chaser left, or a contact with the target, and its time."""

    t_s: float
    kind: Literal["hold-point", "contact"]
    text: str


class LookBack:
    """Records a flight, and shows earlier times of it.

    Parameters
    ----------
    craft : PilotedCraft
        The craft, restored to past states.
    clock : FlightClock
        The clock, reset whenever the time changes.
    recorder : FlightRecorder, optional
        Records the flight without discarded parts.

    Attributes
    ----------
    marks : list of Mark
        Hold points and contacts of the flight in order of time, also those after a time that was sought.
    """

    def __init__(self, craft: PilotedCraft, clock: FlightClock, recorder: FlightRecorder | None) -> None:
        self._craft, self._clock, self.recorder = craft, clock, recorder
        self.timeline = Timeline()
        self.trail = Trail()
        self.active = False
        """True while a time before the end of the flight is shown."""
        self.marks: list[Mark] = []
        self._left_marks: list[Mark] = []
        """Marks of the discarded future."""
        self._branch_s = -1.0
        self._restored = b""
        self._replayed_until_s = -1.0
        self.leave_trail()

    # --- recording

    def record(self) -> None:
        """Record the state before a step, if it is due."""
        self.keep()
        self.leave_trail()
        recorder = self.recorder
        if recorder is not None and recorder.is_due(self._craft.t_s):
            recorder.guard = self._craft.steering.guard
            recorder.add(self._craft.world)

    def keep(self, *, always: bool = False) -> None:
        """Add the present state to the timeline, if it is due."""
        craft = self._craft
        if not self.active and (always or self.timeline.is_due(craft.t_s)):
            self.timeline.add(craft.t_s, craft.steered, craft.controls())

    def leave_trail(self) -> None:
        """Add the present position to the trail, if it is due."""
        craft = self._craft
        if self.trail.is_due(craft.t_s):
            self.trail.add(craft.t_s, lvlh_position(craft.flight, craft.chaser))

    def path(self, world: WorldState) -> FloatArray:
        """Return the flown path (n, 3) to a state, or all of it while an earlier time is shown, LVLH [m]."""
        return np.array(
            self.trail.points if self.active else [*self.trail.until(world.t_s), world.position_lvlh_m]
        )

    # --- earlier times

    def seek(self, t_s: float) -> float:
        """Seek to the recorded state at or before a time; return its time [s].

        Raises
        ------
        UserError
            If nothing has been flown.
        """
        self.keep(always=True)
        if len(self.timeline) < 2:
            raise UserError("there is no flight to replay yet")
        return self._show_sample(self.timeline.at(t_s))

    def step(self, samples: int) -> float:
        """Move some samples forwards or back; return the time [s]."""
        self.keep(always=True)
        now = self.timeline.at(self._craft.t_s)
        return self._show_sample(min(max(now + samples, 0), len(self.timeline) - 1))

    def _show_sample(self, k: int) -> float:
        sample = self.timeline.place(k)
        self._restore(sample.t_s, sample.steered, sample.controls)
        self.active = k < len(self.timeline) - 1
        return sample.t_s

    def _restore(self, t_s: float, steered: ChaserState | None, controls: object) -> None:
        self._clock.reset()
        self._craft.restore(t_s, steered, controls)
        # computed now: a panel that shows them after a seek must not count as a change of the control
        _ = self._craft.docking.hold_points
        self._restored = self._packed_controls()

    def _packed_controls(self) -> bytes:
        return pickle.dumps(self._craft.controls(), protocol=5)

    @property
    def changed(self) -> bool:
        """True if an order has changed the control since the seek."""
        return self.active and self._packed_controls() != self._restored

    def play(self, dt_s: float) -> bool:
        """Advance the replay by ``dt_s``; return True at its end."""
        t_s = self._craft.t_s + dt_s
        if t_s >= self.timeline.end_s:
            self._show_sample(len(self.timeline) - 1)
            return True
        sample = self.timeline.place(self.timeline.at(t_s))
        self._restore(t_s, self.timeline.chaser_between(t_s), sample.controls)
        return False

    def show_recording(self) -> bool:
        """Make a replayed recording seekable as if it had been flown, from its start; return False without one."""
        flight = self._craft.flight
        if flight.recording is None or len(self.timeline):
            return False
        times_s = flight.recording.arrays["t_s"]
        self.timeline.fill(times_s[times_s <= flight.duration_s].tolist(), self._craft.controls())
        self._retrace()
        self._replayed_until_s = self.timeline.end_s
        self._show_sample(0)
        return self.active

    @property
    def replays(self) -> bool:
        """True while the flight is that of a recording, to its end."""
        return self.timeline.end_s <= self._replayed_until_s

    # --- futures

    def fly_on(self) -> None:
        """Continue the flight from the time shown."""
        if not self.active:
            return
        k = self.timeline.at(self._craft.t_s)
        if self._craft.t_s > self.timeline.time_of(k) and not self.changed:
            # restore the sample exactly, not the interpolated state
            self._show_sample(k)
        self._fly_on_from(k)

    def restart(self) -> None:
        """Restart the flight; the flown part becomes the discarded future."""
        self.keep(always=True)
        self._fly_on_from(-1)

    def _fly_on_from(self, k: int) -> None:
        self.active, self._replayed_until_s = False, -1.0
        if k + 1 < len(self.timeline) or k < 0:
            t_s = self.timeline.time_of(k) if k >= 0 else -1.0
            self.trail.cut(t_s)
            if self.recorder is not None:
                self.recorder.truncate_after(t_s)
            self.timeline.truncate_after(k)
            self._branch_s, self._left_marks = self._craft.t_s if k >= 0 else -1.0, []
            self._swap_marks()

    def _swap_marks(self) -> None:
        """Exchange the marks after the branching point with those of the discarded future."""
        shared = [m for m in self.marks if m.t_s <= self._branch_s]
        future, self._left_marks = self._left_marks, self.marks[len(shared) :]
        self.marks = shared + future

    def swap_future(self) -> float:
        """Exchange the future with the discarded one, and seek to their common end; return that time [s].

        Raises
        ------
        UserError
            If there is none.
        """
        self.keep(always=True)
        k = self.timeline.swap_future()
        self._swap_marks()
        self._retrace()
        if self.recorder is not None:
            self.recorder.swap_future()
        return self._show_sample(k)

    def _retrace(self) -> None:
        """Compute the trail of a timeline that was not just flown."""
        flight, times = self._craft.flight, np.linspace(0.0, self.timeline.end_s, RESTORED_TRAIL_POINTS)
        trail = [(float(t), self.timeline.chaser_between(float(t))) for t in times]
        self.trail.replace((t, lvlh_position(flight, c or flight.chaser(t))) for t, c in trail)


class Trail:
    """Positions of the chaser by time, LVLH [m], thinned to cover the whole flight."""

    def __init__(self) -> None:
        self.points: list[Vec3] = []
        self._times_s: list[float] = []
        self._every_s = TRAIL_INTERVAL_S

    def is_due(self, t_s: float) -> bool:
        """Return True if a position is due."""
        return not self._times_s or t_s - self._times_s[-1] >= self._every_s

    def add(self, t_s: float, sample: Vec3) -> None:
        """Add a position, later than the last."""
        self.points.append(sample)
        self._times_s.append(t_s)
        if len(self.points) > MAX_TRAIL_POINTS:
            self.points, self._times_s = self.points[::2], self._times_s[::2]
            self._every_s *= 2

    def until(self, t_s: float) -> list[Vec3]:
        """Return the positions before a time."""
        return self.points[: bisect_left(self._times_s, t_s)]

    def cut(self, t_s: float) -> None:
        """Remove all later positions; an empty trail starts at full density."""
        n_kept = sum(t <= t_s for t in self._times_s)
        del self.points[n_kept:], self._times_s[n_kept:]
        if not n_kept:
            self._every_s = TRAIL_INTERVAL_S

    def replace(self, places: Iterable[tuple[float, Vec3]]) -> None:
        """Replace all positions, in order of time."""
        points = list(places)
        self._times_s, self.points = [t for t, _ in points], [p for _, p in points]


def lvlh_position(flight: Flight, chaser: ChaserState) -> Vec3:
    """Return the chaser's position along LVLH axes [m].

    Returns
    -------
    tuple of float
        Radial, along-track and cross-track component [m].
    """
    p, v = np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
    return vec3(flight.lvlh(chaser.t_s).from_eci(p, v)[0])
