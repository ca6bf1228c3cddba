"""Offset and drift between the monotonic clocks of two machines, with their uncertainty.

The exchange is NTP's: request sent (a), received (b), reply sent (b), received (a). The sample with the smallest round
trip has the smallest error, bounded by half of it (Mills 1991, Internet time synchronization, IEEE Trans.
Communications 39(10)). Drift is the slope of a robust line (Theil 1950, Sen 1968: median of the slopes of all pairs)
through the offsets of the shortest round trip of each second.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass
from typing import Deque, List, Optional

import numpy as np

from flyaround.hil.link.packets.messages import TimeSyncReply, TimeSyncRequest

# Largest drift of computer oscillators, assumed while the drift is unknown [ppm]
MAX_DRIFT_PPM = 100.0
# Minimum duration of a line fit [s], and minimum number of seconds with an exchange
MIN_LINE_S, MIN_LINE_POINTS = 5.0, 5

# Time span of which only the best clock sample is kept [ns].
BIN_NS = 1_000_000_000
# Ratio of the standard deviation to the median absolute deviation, normal distribution
MAD_TO_SIGMA = 1.4826
# Variance of least squares over that of the median of slopes, evenly spaced normal errors (Sen 1968)
SEN_EFFICIENCY = 3 / np.pi
# Least scatter of offsets, relative to the shortest round trip, whose asymmetry may change: chosen by hand
MIN_SCATTER = 1 / 8


def now_ns() -> int:
    """Return this machine's monotonic clock. The wall clock is never used for durations.

    Returns
    -------
    int
        Time since an arbitrary start [ns], which never goes back.
    """
    return time.monotonic_ns()


@dataclass(frozen=True)
class ClockSample:
    """One exchange: mid-time on this clock, the other clock minus this one, and the round trip [ns]."""

    at_ns: int
    offset_ns: int
    round_trip_ns: int


@dataclass(frozen=True)
class ClockLine:
    """Line through clock offsets: ``offset_ns`` at ``at_ns``, slope ``drift_ppm``, and its one-sigma ``sigma_ppm``."""

    at_ns: int
    offset_ns: float
    drift_ppm: float
    sigma_ppm: float


class ClockFilter:
    """Estimator of the offset and drift of the other side's clock from recent exchanges.

    Parameters
    ----------
    keep_s : float, optional
        Age at which exchanges are discarded; a smaller value follows changes of drift faster.
    """

    def __init__(self, keep_s: float = 120.0) -> None:
        self._keep_ns = int(keep_s * 1e9)
        self._samples: Deque[ClockSample] = deque()  # the shortest round trip of each second
        self._count = 0
        self._line: Optional[ClockLine] = None
        self._stale = False  # True if the line is older than the samples

    def add(self, asked_ns: int, received_ns: int, answered_ns: int, back_ns: int) -> None:
        """Add one exchange. A negative round trip indicates a broken clock and is ignored."""
        round_trip = (back_ns - asked_ns) - (answered_ns - received_ns)
        if round_trip < 0:
            return
        offset = ((received_ns - asked_ns) + (answered_ns - back_ns)) // 2
        sample = ClockSample((asked_ns + back_ns) // 2, offset, round_trip)
        self._count += 1
        if self._samples and sample.at_ns // BIN_NS == self._samples[-1].at_ns // BIN_NS:
            if round_trip >= self._samples[-1].round_trip_ns:
                return
            self._samples[-1] = sample
        else:
            self._samples.append(sample)
            while sample.at_ns - self._samples[0].at_ns > self._keep_ns:
                self._samples.popleft()
        self._stale = True

    def add_reply(self, reply: TimeSyncReply, back_ns: int) -> int:
        """Add one exchange from its reply packet.

        Returns
        -------
        int
            Round trip [ns] without the other side's time to answer; negative for a broken clock, whose exchange is
            ignored.
        """
        self.add(reply.asked_ns, reply.received_ns, reply.sent_ns, back_ns)
        return (back_ns - reply.asked_ns) - (reply.sent_ns - reply.received_ns)

    def offset_at(self, at_ns: int) -> Optional[int]:
        """Return the other clock minus this one at a time of this clock.

        Returns
        -------
        int or None
            Offset [ns]; None before the first exchange.
        """
        best = self._best(at_ns)
        if best is None:
            return None
        return best.offset_ns + round(1e-6 * self._drift_ppm * (at_ns - best.at_ns))

    def offset_bound_at(self, at_ns: int) -> Optional[int]:
        """Return the largest error of ``offset_at``.

        Returns
        -------
        int or None
            Half a round trip plus the drift since [ns]; None before the first exchange.
        """
        best = self._best(at_ns)
        return None if best is None else self._bound(best, at_ns)

    @property
    def line(self) -> Optional[ClockLine]:
        """Line through the exchanges; None while they are too few or too close together."""
        if self._stale:
            self._line, self._stale = fit_line(list(self._samples)), False
        return self._line

    @property
    def round_trip_ns(self) -> Optional[int]:
        """Shortest round trip of the stored exchanges [ns]."""
        return min((sample.round_trip_ns for sample in self._samples), default=None)

    def __len__(self) -> int:
        return self._count

    @property
    def _drift_ppm(self) -> float:
        return 0.0 if self.line is None else self.line.drift_ppm

    def _bound(self, sample: ClockSample, at_ns: int) -> int:
        # rounded up, because the offset loses half a nanosecond
        known_ppm = MAX_DRIFT_PPM if self.line is None else 3 * self.line.sigma_ppm
        return sample.round_trip_ns // 2 + 1 + round(1e-6 * known_ppm * abs(at_ns - sample.at_ns))

    def _best(self, at_ns: int) -> Optional[ClockSample]:
        return min(self._samples, key=lambda sample: self._bound(sample, at_ns), default=None)


def fit_line(samples: List[ClockSample]) -> Optional[ClockLine]:
    """Fit a robust line to offsets, with the uncertainty of its slope.

    Samples with a round trip above twice the shortest and above the median are omitted, because they were delayed in
    one direction more than in the other.
    """
    if not samples:
        return None
    trips = np.array([sample.round_trip_ns for sample in samples], float)
    is_fast = trips <= max(2 * float(trips.min()), float(np.median(trips)))
    times_ns = np.array([sample.at_ns - samples[0].at_ns for sample in samples], float)[is_fast]
    offset = np.array([sample.offset_ns - samples[0].offset_ns for sample in samples], float)[is_fast]
    if len(times_ns) < MIN_LINE_POINTS or times_ns[-1] - times_ns[0] < MIN_LINE_S * 1e9:
        return None
    first, second = np.triu_indices(len(times_ns), 1)
    slope = float(np.median((offset[second] - offset[first]) / (times_ns[second] - times_ns[first])))
    middle = float(times_ns.mean())
    residual = offset - slope * (times_ns - middle)
    centre = float(np.median(residual))
    scatter = max(
        MAD_TO_SIGMA * float(np.median(np.abs(residual - centre))), MIN_SCATTER * float(trips.min())
    )
    sigma = scatter / float(np.sqrt(SEN_EFFICIENCY * np.sum((times_ns - middle) ** 2)))
    return ClockLine(
        samples[0].at_ns + round(middle), samples[0].offset_ns + centre, 1e6 * slope, 1e6 * sigma
    )


def answer_time_sync(
    request: TimeSyncRequest, received_ns: int, newest_frame: Optional[int] = None
) -> TimeSyncReply:
    """Make the reply to a request; ``newest_frame`` is the last one received completely.

    Returns
    -------
    TimeSyncReply
        Reply, whose time of sending is now; send it at once.
    """
    return TimeSyncReply(request.asked_ns, received_ns, now_ns(), newest_frame)
