"""The states of a flight, kept compactly while it is flown: any place of it can be gone back to and flown on from.

A sample is the clock, the steered chaser's 13 numbers and what steered it (one packed text, shared by neighbours that
are alike): an hour in tenths of a second takes a few megabytes.
"""

from __future__ import annotations

import pickle
import zlib
from array import array
from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.world.flight.recording import Recording
from flyaround.simulator.world.guidance.manual_control import ChaserState

if TYPE_CHECKING:
    from collections.abc import Sequence

EVERY_S = 0.1
"""Simulated time between samples; at higher rates each step of the session is one."""
WIDTH = 13
MOST_SAMPLES = 400_000
"""Eleven hours in tenths of a second; beyond it every second sample is dropped."""
MOST_CONTROLS_BYTES = 40_000_000
LONGEST_NOTE = 200
MOST_BOOKMARKS = 500
_ROUNDING_S = 5e-4
"""Of sums of steps."""


@dataclass(frozen=True)
class FlownPlace:
    """One sample, unpacked.

    Parameters
    ----------
    steered : the chaser where it is steered, None while the scenario's guidance flies it.
    controls : what steered it, as it was given to `Timeline.add`.
    """

    t_s: float
    steered: ChaserState | None
    controls: Any


@dataclass(frozen=True)
class Bookmark:
    """A place with a note."""

    t_s: float
    note: str


@dataclass
class _StateSamples:
    """Parallel columns: times, numbers of the chaser (NaN while guided), which controls."""

    times_s: array[float]
    numbers: array[float]
    controls: array[int]

    @staticmethod
    def none() -> _StateSamples:
        return _StateSamples(array("d"), array("d"), array("l"))

    def cut(self, k: int) -> _StateSamples:
        """Take away sample k and all later ones, and return them."""
        gone = _StateSamples(self.times_s[k:], self.numbers[WIDTH * k :], self.controls[k:])
        del self.times_s[k:], self.numbers[WIDTH * k :], self.controls[k:]
        return gone

    def extend(self, later: _StateSamples) -> None:
        self.times_s.extend(later.times_s)
        self.numbers.extend(later.numbers)
        self.controls.extend(later.controls)


class Timeline:
    """Samples of one flight in the order of time, its bookmarks, and the future that was left last.

    To fly on from an earlier place leaves what came after it. That is kept until another future is left, and
    `swap_future` brings it back.
    """

    def __init__(self) -> None:
        self._samples = _StateSamples.none()
        self._packed: list[bytes] = []
        self._packed_bytes = 0
        self._first = b""
        self._every_s = EVERY_S
        # how many samples it shares with the flight that is kept, and the rest of it
        self._left: tuple[int, _StateSamples] | None = None
        self.bookmarks: tuple[Bookmark, ...] = ()

    # --- while it is flown

    def wants(self, t_s: float) -> bool:
        """Whether the state at a time is due."""
        times = self._samples.times_s
        return not times or t_s >= times[-1] + self._every_s - _ROUNDING_S

    def add(self, t_s: float, steered: ChaserState | None, controls: object) -> None:
        """Keep a state; one that is not later than the last is kept already."""
        samples = self._samples
        if samples.times_s and t_s <= samples.times_s[-1]:
            return
        samples.times_s.append(t_s)
        samples.numbers.extend(_numbers(steered))
        samples.controls.append(self._pack(controls))
        if len(samples.times_s) > MOST_SAMPLES or self._packed_bytes > MOST_CONTROLS_BYTES:
            self._thin()

    def _pack(self, controls: object) -> int:
        plain = pickle.dumps(controls, protocol=5)
        # all are much alike: what is told of each is how it differs from the first
        self._first = self._first or plain
        packer = zlib.compressobj(1, zdict=self._first)
        packed = packer.compress(plain) + packer.flush()
        if not self._packed or self._packed[-1] != packed:
            self._packed.append(packed)
            self._packed_bytes += len(packed)
        return len(self._packed) - 1

    def _thin(self) -> None:
        """The whole flight stays, at half the density; a future that was left is forgotten."""
        s, self._left = self._samples, None
        table = np.frombuffer(s.numbers).reshape(-1, WIDTH)[::2]
        used = s.controls[::2]
        kept = sorted(set(used))
        new = {old: k for k, old in enumerate(kept)}
        self._packed = [self._packed[k] for k in kept]
        self._packed_bytes = sum(map(len, self._packed))
        self._samples = _StateSamples(
            s.times_s[::2], array("d", table.tobytes()), array("l", [new[k] for k in used])
        )
        self._every_s *= 2

    def __len__(self) -> int:
        return len(self._samples.times_s)

    @property
    def end_s(self) -> float:
        """Time of the last sample [s]; 0 where there is none."""
        return self._samples.times_s[-1] if self._samples.times_s else 0.0

    @property
    def bytes_kept(self) -> int:
        """Of memory, about."""
        return len(self) * 8 * (WIDTH + 2) + self._packed_bytes + 40 * len(self._packed)

    # --- to look back

    def at(self, t_s: float) -> int:
        """Number of the sample at or before a time."""
        return max(bisect_right(self._samples.times_s, t_s + _ROUNDING_S) - 1, 0)

    def time_of(self, k: int) -> float:
        """Of a sample [s]."""
        return self._samples.times_s[k]

    def place(self, k: int) -> FlownPlace:
        """A sample."""
        samples = self._samples
        t_s = samples.times_s[k]
        numbers = samples.numbers[WIDTH * k : WIDTH * (k + 1)]
        plain = zlib.decompressobj(zdict=self._first).decompress(self._packed[samples.controls[k]])
        # what was packed here, not what came from outside
        controls = pickle.loads(plain)  # noqa: S301
        return FlownPlace(t_s, _chaser(t_s, numbers), controls)

    def chaser_between(self, t_s: float) -> ChaserState | None:
        """The steered chaser at any time, by a cubic between two samples; None where guidance flies it."""
        k = self.at(t_s)
        row = self._samples.numbers[WIDTH * k : WIDTH * (k + 2)]
        here = _chaser(self._samples.times_s[k], row[:WIDTH])
        if here is None or len(row) < 2 * WIDTH or np.isnan(row[WIDTH]):
            return here
        table = np.array(row).reshape(2, WIDTH)
        pair = {
            "t_s": np.array(self._samples.times_s[k : k + 2]),
            "relative_eci_m": table[:, :3],
            "relative_eci_m_s": table[:, 3:6],
            "q_camera_from_eci_wxyz": table[:, 6:10],
            "omega_camera_rad_s": table[:, 10:],
        }
        return Recording(pair).chaser(t_s)

    def leave_after(self, k: int) -> None:
        """Leave all that comes after sample k, or everything for -1; see `swap_future`."""
        if k + 1 < len(self):
            self._left = k + 1, self._samples.cut(k + 1)

    @property
    def left_s(self) -> tuple[float, float] | None:
        """From when to when the future goes that was left last [s]."""
        if self._left is None:
            return None
        shared, future = self._left
        return self._samples.times_s[shared - 1] if shared else 0.0, future.times_s[-1]

    def swap_future(self) -> int:
        """The future that was left comes back, and the one flown since is left for it; the last sample of both.

        Raises
        ------
        UserError
            If none was left.
        """
        if self._left is None:
            raise UserError("no future was left: go back with timeline.seek and fly on from there first")
        shared, future = self._left
        since = self._samples.cut(shared)
        self._samples.extend(future)
        self._left = (shared, since) if since.times_s else None
        return max(shared - 1, 0)

    # --- bookmarks

    def bookmark(self, t_s: float, note: str) -> Bookmark:
        """Keep a place by a note, in the order of time.

        Raises
        ------
        UserError
            If there are too many.
        """
        if len(self.bookmarks) >= MOST_BOOKMARKS:
            raise UserError(
                f"there are {MOST_BOOKMARKS} bookmarks; take one away first (timeline.unbookmark)"
            )
        mark = Bookmark(t_s, " ".join(note.split())[:LONGEST_NOTE])
        others = (b for b in self.bookmarks if abs(b.t_s - t_s) > _ROUNDING_S)
        self.bookmarks = tuple(sorted((*others, mark), key=lambda b: b.t_s))
        return mark

    def unbookmark(self, t_s: float) -> None:
        """Take away the bookmark nearest to a time."""
        gone = min(self.bookmarks, key=lambda b: abs(b.t_s - t_s), default=None)
        self.bookmarks = tuple(b for b in self.bookmarks if b is not gone)


def _numbers(steered: ChaserState | None) -> Sequence[float]:
    if steered is None:
        return (np.nan,) * WIDTH
    return (
        *steered.position_eci_m,
        *steered.velocity_eci_m_s,
        *steered.q_camera_from_eci_wxyz,
        *steered.omega_camera_rad_s,
    )


def _chaser(t_s: float, numbers: Sequence[float]) -> ChaserState | None:
    row = np.array(numbers)
    if np.isnan(row[0]):
        return None
    return ChaserState(
        t_s=t_s,
        position_eci_m=vec3(row[:3]),
        velocity_eci_m_s=vec3(row[3:6]),
        q_camera_from_eci_wxyz=quat(row[6:10]),
        omega_camera_rad_s=vec3(row[10:]),
    )
