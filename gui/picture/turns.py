"""Turns of several picture views at one render process: each gets its share of the time that pictures take."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

from flyaround.gui.picture.feed import PictureFailedError, last_line
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.worker import ProcessDiedError
from flyaround.simulator.runtime.worker_pool import JobsLostError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from flyaround.gui.picture.feed import FramesOnRequest
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.loop import FrameRequest

WANTS_S = 0.5
"""A view that was refused and has not asked again for so long does not want any more."""
FIRST_MS = 50.0
"""What a view's first picture is taken to cost."""


class Turns:
    """Shares a frame producer among channels by the time that their pictures took, each weighted by its share.

    Start-time fair queueing (Goyal, Vin & Cheng 1997): it is the turn of who has had the least, and who joins begins
    with what the last one served has had.

    Parameters
    ----------
    producer : draws one picture after the other. clock : seconds, monotonic.
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
        share : of the time, beside the others'.
        """
        channel = Channel(self, share)
        self._channels.append(channel)
        return channel

    def submit(self, channel: Channel, request: FrameRequest) -> bool:
        """Ask for a channel's frame; False where there is no room, or another one's turn has come."""
        now = self._clock()
        if not channel.wants(now):
            # who comes back after a pause has saved no time up
            channel.used = max(channel.used, self._served)
        channel.asked_s = now
        # nobody waits while the producer has nothing to do: who was first may want no more
        first = any(c.used < channel.used and c.wants(now) for c in self._channels if c is not channel)
        if first and self._under_way:
            return False
        try:
            taken = self._producer.submit(request)
        except JobsLostError as error:
            self._lose(error)
            return False
        if taken:
            self._under_way.append(channel)
            channel.asked_s = None
            self._served = channel.used
            channel.charge(channel.cost_ms)
        return taken

    def collect(self) -> None:
        """Give what is finished, and what has failed, to those who asked for it.

        Raises
        ------
        UserError, RuntimeError
            If what draws could not be opened, or is gone for good.
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
            # before the first picture it may be the renderer itself that could not be opened
            if not (self._drawn and self._under_way):
                raise
            self._under_way.popleft().inbox.append(PictureFailedError(last_line(error)))

    def _lose(self, error: JobsLostError) -> None:
        """Report to every view that its requests are lost."""
        self._under_way.clear()
        for channel in self._channels:
            channel.lost = error


class Channel:
    """A view's way to the producer; `flyaround.gui.picture.feed.FramesOnRequest`.

    Parameters
    ----------
    turns : that it takes part in. share : of the time.
    """

    def __init__(self, turns: Turns, share: float) -> None:
        self._turns = turns
        self._share = share
        self.used = 0.0
        """Time that its pictures took over its share [ms]."""
        self.cost_ms = FIRST_MS
        self.asked_s: float | None = None
        """When it asked last and was refused."""
        self.inbox: deque[Frame | PictureFailedError] = deque()
        self.lost: JobsLostError | None = None

    def charge(self, ms: float) -> None:
        """Note time that its pictures took."""
        self.used += ms / self._share

    def wants(self, now_s: float) -> bool:
        """Return True while it waits for its turn."""
        return self.asked_s is not None and now_s - self.asked_s < WANTS_S

    def submit(self, request: FrameRequest) -> bool:
        """Ask for a frame; False when it is not its turn, or enough are under way."""
        return self._turns.submit(self, request)

    def finished(self) -> Iterable[Frame]:
        """Return its frames finished since the last call, in the order they were asked for.

        Raises
        ------
        JobsLostError
            If those under way will not come.
        PictureFailedError
            If the oldest of them could not be made; what comes after it, the next call gives.
        """
        self._turns.collect()
        return self._take()

    def _take(self) -> Iterator[Frame]:
        while self.inbox:
            came = self.inbox.popleft()
            if isinstance(came, PictureFailedError):
                raise came
            yield came
        if self.lost is not None:
            lost, self.lost = self.lost, None
            raise lost
