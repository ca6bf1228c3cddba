"""Scheduling of several views on one render process: each gets its share of the drawing time."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

from flyaround.gui.picture.feed import PictureFailedError, last_line
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.worker import ProcessDiedError
from flyaround.simulator.runtime.worker_pool import JobsLostError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from flyaround.gui.picture.feed import FramesOnRequest
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.loop import FrameRequest

WANTS_S = 0.5
"""Time after a refused request without another one, after which a view counts as idle."""
FIRST_MS = 50.0
"""Assumed cost of a view's first picture."""


class Turns:
    """Shares a frame producer among channels by drawing time, weighted by their shares.

    Start-time fair queueing (Goyal, Vin & Cheng 1997): the channel with the least time is next, and a new one starts
    with the time of the one served last.

    Parameters
    ----------
    producer : FramesOnRequest
        Draws one picture after the other.
    clock : callable, optional
        Monotonic time [s].
    """

    def __init__(self, producer: FramesOnRequest, clock: Callable[[], float] = time.perf_counter) -> None:
        self._producer = producer
        self._clock = clock
        self._channels: list[Channel] = []
        self._under_way: deque[Channel] = deque()
        self._served = 0.0
        self._drawn = False

    def channel(self, share: float = 1.0) -> Channel:
        """Return a channel for one more view.

        Parameters
        ----------
        share : float, optional
            Weight relative to other channels.
        """
        channel = Channel(self, share)
        self._channels.append(channel)
        return channel

    def submit(self, channel: Channel, request: FrameRequest) -> bool:
        """Submit a channel's request; return False without room, or if another channel is next."""
        now = self._clock()
        if not channel.wants(now):
            # a channel that returns after a pause has saved up no time
            channel.used = max(channel.used, self._served)
        channel.asked_s = now
        # if the producer is idle, nobody waits: the channel that is next may have no request
        first = any(c.used < channel.used and c.wants(now) for c in self._channels if c is not channel)
        if first and self._under_way:
            return False
        try:
            is_accepted = self._producer.submit(request)
        except JobsLostError as error:
            self._lose(error)
            return False
        if is_accepted:
            self._under_way.append(channel)
            channel.asked_s = None
            self._served = channel.used
            channel.charge(channel.cost_ms)
        return is_accepted

    def collect(self) -> None:
        """Pass finished and failed pictures to the channels that requested them.

        Raises
        ------
        UserError, RuntimeError
            If the renderer could not be opened, or is permanently lost.
        """
        try:
            for frame in self._producer.finished():
                channel = self._under_way.popleft()
                ms = sum(v for k, v in frame.stage_ms.items() if "." not in k)
                channel.charge(ms - channel.cost_ms)
                channel.cost_ms = ms
                channel.inbox.append(frame)
                self._drawn = True
        except JobsLostError as error:
            self._lose(error)
        except ProcessDiedError:
            raise
        except (UserError, RuntimeError) as error:
            # before the first picture, the failure may be that of opening the renderer
            if not (self._drawn and self._under_way):
                raise
            self._under_way.popleft().inbox.append(PictureFailedError(last_line(error)))

    def _lose(self, error: JobsLostError) -> None:
        """Report to every view that its requests are lost."""
        self._under_way.clear()
        for channel in self._channels:
            channel.lost = error


class Channel:
    """A view's access to the producer; implements `flyaround.gui.picture.feed.FramesOnRequest`.

    Parameters
    ----------
    turns : Turns
        Scheduler.
    share : float
        Weight of its time.
    """

    def __init__(self, turns: Turns, share: float) -> None:
        self._turns = turns
        self._share = share
        self.used = 0.0
        """Time of its pictures over its share [ms]."""
        self.cost_ms = FIRST_MS
        self.asked_s: float | None = None
        """Time of its last refused request."""
        self.inbox: deque[Frame | PictureFailedError] = deque()
        self.lost: JobsLostError | None = None

    def charge(self, ms: float) -> None:
        """Add the time of a picture."""
        self.used += ms / self._share

    def wants(self, now_s: float) -> bool:
        """Return True while it waits for its turn."""
        return self.asked_s is not None and now_s - self.asked_s < WANTS_S

    def submit(self, request: FrameRequest) -> bool:
        """Submit a request; return False if it is not its turn, or enough are in flight."""
        return self._turns.submit(self, request)

    def finished(self) -> Iterator[Frame]:
        """Yield its frames finished since the last call, in order of request.

        Raises
        ------
        JobsLostError
            If its pictures in flight are lost.
        PictureFailedError
            If the oldest of them could not be made; later ones are returned by the next call.
        """
        self._turns.collect()
        while self.inbox:
            came = self.inbox.popleft()
            if isinstance(came, PictureFailedError):
                raise came
            yield came
        if self.lost is not None:
            error, self.lost = self.lost, None
            raise error
