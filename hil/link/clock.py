"""Monotonic clocks of two machines, and the offset between them.

The exchange is that of NTP: asked (a), received (b), answered (b), back (a). Reference: Mills (1991),
Internet time synchronization, IEEE Trans. Communications 39(10): the sample with the smallest round
trip has the smallest error, bounded by half of it.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Deque, Optional, Tuple

from hil.link.packets.messages import TimeSyncReply, TimeSyncRequest


def now_ns() -> int:
    """Monotonic clock of this machine [ns]; the wall clock is never used for durations."""
    return time.monotonic_ns()


class ClockFilter:
    """Offset of the other side's clock, from the best of the last exchanges.

    Parameters
    ----------
    keep : how many exchanges are remembered; fewer follow drift faster.
    """

    def __init__(self, keep: int = 16) -> None:
        self._samples: Deque[Tuple[int, int]] = deque(maxlen=keep)

    def add(self, asked_ns: int, received_ns: int, answered_ns: int, back_ns: int) -> None:
        """One exchange; a round trip that is not positive is a broken clock and is left out."""
        round_trip = (back_ns - asked_ns) - (answered_ns - received_ns)
        if round_trip >= 0:
            offset = ((received_ns - asked_ns) + (answered_ns - back_ns)) // 2
            self._samples.append((round_trip, offset))

    def add_reply(self, reply: TimeSyncReply, back_ns: int) -> None:
        """One exchange from its reply packet."""
        self.add(reply.asked_ns, reply.received_ns, reply.sent_ns, back_ns)

    @property
    def offset_ns(self) -> Optional[int]:
        """Other clock minus this one, None before the first exchange."""
        return min(self._samples)[1] if self._samples else None

    @property
    def round_trip_ns(self) -> Optional[int]:
        """Round trip of the exchange that ``offset_ns`` is from; its error is at most half of it."""
        return min(self._samples)[0] if self._samples else None

    def __len__(self) -> int:
        return len(self._samples)


def answer_time_sync(request: TimeSyncRequest, received_ns: int) -> TimeSyncReply:
    """The reply to a request, stamped now."""
    return TimeSyncReply(request.asked_ns, received_ns, now_ns())
