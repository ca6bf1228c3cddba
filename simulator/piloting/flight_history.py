"""Compact history of a flight, which can be resumed from any recorded time.

A sample stores the time, the 13 numbers of the manually controlled chaser's state, and the state of its controls, which
is compressed and shared by equal successive samples. An hour at 0.1 s takes a few megabytes.
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
    from collections.abc import Iterator, Sequence

SAMPLE_INTERVAL_S = 0.1
"""Simulated time between samples [s]; at higher rates each step is a sample."""

VALUES_PER_SAMPLE = 15
"""Values of a sample: time, the chaser's 13 (NaN while guided), index of the controls."""

MAX_SAMPLES = 400_000
"""Largest number of samples, eleven hours at 0.1 s; beyond it every second sample is dropped."""

# Maximum size of the recorded controls [bytes].
MAX_CONTROLS_BYTES = 40_000_000

# Maximum length of a bookmark's note, and maximum number of bookmarks: bounds on what a file may contain, more than an
# operator sets by hand.
MAX_NOTE_LENGTH = 200
MAX_BOOKMARKS = 500

ROUNDING_S = 5e-4
"""Tolerance for sums of steps [s]."""


@dataclass(frozen=True)
class HistorySample:
    """One sample, unpacked.

    Parameters
    ----------
    t_s : float
        Time since the scenario's start.
    steered : ChaserState or None
        The chaser under manual control, None under guidance.
    controls : object
        State of the controls, as passed to `Timeline.add`.
    """

    t_s: float
    steered: ChaserState | None
    controls: Any


@dataclass(frozen=True)
class Bookmark:
    """A time with a note."""

    t_s: float
    note: str


class RowHistory:
    """Rows of numbers, sorted by their first number, the time; and the rows that were discarded last.

    Parameters
    ----------
    width : int
        Numbers per row.

    Attributes
    ----------
    numbers : array
        Values, row after row.
    left : tuple or None
        Number of rows before the discarded ones, and the discarded rows.
    """

    def __init__(self, width: int) -> None:
        self._width = width
        self.numbers = array("d")
        self.left: tuple[int, array[float]] | None = None

    def __len__(self) -> int:
        return len(self.numbers) // self._width

    @property
    def end_s(self) -> float:
        """Time of the last row [s]; 0 if there is none."""
        return self.numbers[-self._width] if self.numbers else 0.0

    def is_due(self, t_s: float, every_s: float) -> bool:
        """Return True if a row is due at a time."""
        return not self.numbers or t_s >= self.end_s + every_s - ROUNDING_S

    def time_of(self, k: int) -> float:
        """Return the time of a row [s]."""
        return self.numbers[self._width * k]

    def at(self, t_s: float) -> int:
        """Return the number of the row at or before a time, or -1."""
        return bisect_right(range(len(self)), t_s, key=self.time_of) - 1

    def rows(self, k: int, count: int = 1) -> array[float]:
        """Return some rows, as many as there are."""
        return self.numbers[self._width * k : self._width * (k + count)]

    def truncate_after(self, k: int) -> None:
        """Move all rows after row k, or all rows for -1, to the discarded future."""
        self.left = k + 1, self._cut(k + 1)

    def swap_future(self) -> int:
        """Exchange the rows after the branching point with the discarded rows; return the number of rows before it."""
        if self.left is None:
            return len(self)
        shared, future = self.left
        self.left = shared, self._cut(shared)
        self.numbers.extend(future)
        return shared

    def _cut(self, k: int) -> array[float]:
        removed = self.numbers[self._width * k :]
        del self.numbers[self._width * k :]
        return removed


class Timeline:
    """Samples of a flight in order of time, its bookmarks, and the samples that were discarded last.

    Continuing the flight from an earlier time discards the later samples, its future. The last discarded future is
    kept, and `swap_future` restores it.
    """

    def __init__(self) -> None:
        self._rows = RowHistory(VALUES_PER_SAMPLE)
        self._packed: list[bytes] = []
        self._packed_bytes = 0
        self._first = b""
        self._every_s = SAMPLE_INTERVAL_S
        self.bookmarks: tuple[Bookmark, ...] = ()

    # --- while it is flown

    def is_due(self, t_s: float) -> bool:
        """Return True if the state at a time is due.

        Returns
        -------
        bool
            True for the first sample, and from `SAMPLE_INTERVAL_S` after the last one on; every thinning doubles
            the interval.
        """
        return self._rows.is_due(t_s, self._every_s)

    def add(self, t_s: float, steered: ChaserState | None, controls: object) -> None:
        """Add a state, unless it is not later than the last."""
        if len(self) and t_s <= self.end_s:
            return
        self._rows.numbers.extend((t_s, *_numbers(steered), self._pack(controls)))
        if len(self) > MAX_SAMPLES or self._packed_bytes > MAX_CONTROLS_BYTES:
            self._thin()

    def fill(self, times_s: Sequence[float], controls: object) -> None:
        """Add times, all later than the last sample, at which the guidance flies under the same controls."""
        packed = self._pack(controls)
        for t_s in times_s[:: len(times_s) // MAX_SAMPLES + 1]:
            self._rows.numbers.extend((t_s, *_numbers(None), packed))

    def chasers(self) -> Iterator[tuple[float, ChaserState | None]]:
        """Iterate over the present samples, whatever is flown meanwhile.

        Returns
        -------
        iterator of tuple
            Time [s] and the manually controlled chaser of each sample, in order of time; None instead of a chaser
            under guidance.
        """
        rows, last = self._rows.rows(0, len(self)), VALUES_PER_SAMPLE - 1
        starts = range(0, len(rows), VALUES_PER_SAMPLE)
        return ((rows[k], _chaser(rows[k], rows[k + 1 : k + last])) for k in starts)

    def _pack(self, controls: object) -> int:
        data = pickle.dumps(controls, protocol=5)
        # controls are similar: compress relative to the first
        self._first = self._first or data
        packer = zlib.compressobj(1, zdict=self._first)
        compressed = packer.compress(data) + packer.flush()
        if not self._packed or self._packed[-1] != compressed:
            self._packed.append(compressed)
            self._packed_bytes += len(compressed)
        return len(self._packed) - 1

    def _thin(self) -> None:
        """Drop every second sample of the whole flight, and the discarded future."""
        table = np.array(self._rows.numbers).reshape(-1, VALUES_PER_SAMPLE)[::2]
        unique_controls, table[:, -1] = np.unique(table[:, -1], return_inverse=True)
        self._packed = [self._packed[int(k)] for k in unique_controls]
        self._packed_bytes = sum(map(len, self._packed))
        self._rows.numbers, self._rows.left = array("d", table.tobytes()), None
        self._every_s *= 2

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def end_s(self) -> float:
        """Time of the last sample [s]; 0 if there is none."""
        return self._rows.end_s

    @property
    def memory_bytes(self) -> int:
        """Approximate memory use [bytes]."""
        return len(self) * 8 * VALUES_PER_SAMPLE + self._packed_bytes + 40 * len(self._packed)

    # --- to look back

    def at(self, t_s: float) -> int:
        """Find the sample at or before a time, within `ROUNDING_S`.

        Returns
        -------
        int
            Number of the sample, from 0; 0 also before the first one.
        """
        return max(self._rows.at(t_s + ROUNDING_S), 0)

    def time_of(self, k: int) -> float:
        """Return the time of a sample.

        Returns
        -------
        float
            Time since the scenario's start [s].
        """
        return self._rows.time_of(k)

    def place(self, k: int) -> HistorySample:
        """Unpack a sample.

        Returns
        -------
        HistorySample
            The sample with its own copy of the controls.
        """
        t_s, *numbers, packed = self._rows.rows(k)
        data = zlib.decompressobj(zdict=self._first).decompress(self._packed[int(packed)])
        # only data that this class packed
        controls = pickle.loads(data)  # noqa: S301
        return HistorySample(t_s, _chaser(t_s, numbers), controls)

    def chaser_between(self, t_s: float) -> ChaserState | None:
        """Interpolate the manually controlled chaser between samples by a cubic.

        Returns
        -------
        ChaserState or None
            State at ``t_s``; if manual control ends before the next sample, or there is none, the state of the
            sample at or before ``t_s``. None if guidance flies the chaser at that sample.
        """
        table = np.array(self._rows.rows(self.at(t_s), 2)).reshape(-1, VALUES_PER_SAMPLE)
        chaser = _chaser(float(table[0, 0]), table[0, 1:-1].tolist())
        if chaser is None or len(table) < 2 or np.isnan(table[1, 1]):
            return chaser
        pair = {
            "t_s": table[:, 0],
            "relative_eci_m": table[:, 1:4],
            "relative_eci_m_s": table[:, 4:7],
            "q_camera_from_eci_wxyz": table[:, 7:11],
            "omega_camera_rad_s": table[:, 11:14],
        }
        return Recording(pair).chaser(t_s)

    def truncate_after(self, k: int) -> None:
        """Move all samples after sample k, or all for -1, to the discarded future; see `swap_future`."""
        if k + 1 < len(self):
            self._rows.truncate_after(k)

    @property
    def left_s(self) -> tuple[float, float] | None:
        """Start and end of the future discarded last [s]."""
        if self._rows.left is None:
            return None
        shared, future = self._rows.left
        return self.time_of(shared - 1) if shared else 0.0, future[-VALUES_PER_SAMPLE]

    def swap_future(self) -> int:
        """Restore the discarded future in exchange for the present one.

        Returns
        -------
        int
            Number of the last common sample; 0 if they have none in common.

        Raises
        ------
        UserError
            If there is none.
        """
        if self._rows.left is None:
            raise UserError("no future was left: go back in time and fly on from there first")
        shared = self._rows.swap_future()
        if not self._rows.left[1]:
            self._rows.left = None
        return max(shared - 1, 0)

    # --- bookmarks

    def bookmark(self, t_s: float, note: str) -> Bookmark:
        """Add a bookmark, in order of time; it replaces one at the same time.

        Returns
        -------
        Bookmark
            The added bookmark. Its note has single spaces and at most `MAX_NOTE_LENGTH` characters.

        Raises
        ------
        UserError
            If there are too many.
        """
        if len(self.bookmarks) >= MAX_BOOKMARKS:
            raise UserError(f"there are {MAX_BOOKMARKS} bookmarks; remove one first")
        mark = Bookmark(t_s, " ".join(note.split())[:MAX_NOTE_LENGTH])
        other_bookmarks = (b for b in self.bookmarks if abs(b.t_s - t_s) > ROUNDING_S)
        self.bookmarks = tuple(sorted((*other_bookmarks, mark), key=lambda b: b.t_s))
        return mark

    def unbookmark(self, t_s: float) -> None:
        """Remove the bookmark nearest to a time."""
        nearest = min(self.bookmarks, key=lambda b: abs(b.t_s - t_s), default=None)
        self.bookmarks = tuple(b for b in self.bookmarks if b is not nearest)


def _numbers(steered: ChaserState | None) -> Sequence[float]:
    if steered is None:
        return (np.nan,) * (VALUES_PER_SAMPLE - 2)
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
