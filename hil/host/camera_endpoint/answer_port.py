"""Port for the poses of boards that read the camera: a session of the link without images.

The GigE Vision protocol has no channel for poses, so the board connects here as it would to a host. Images sent on the
stream in the meantime count as sent to the board; each is identified by its number since the start of acquisition, and
each has exactly one outcome.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from flyaround.hil.host.link_process.board_session import BoardSession
from flyaround.hil.host.link_process.in_flight import FramesInFlight
from flyaround.hil.host.link_process.ipc import BoardDown, BoardUp, Terms
from flyaround.hil.host.link_process.pending import PendingLinks
from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.transports.url import listen

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

    from flyaround.hil.host.camera_endpoint.messages import AnswerTerms
    from flyaround.hil.host.frame_record import FrameRecord

BUSY = "another board answers for this camera: stop it first"
STOPPED = "the camera was stopped"


class AnswerPort:
    """Session with one board at a time, and the images that it may answer.

    Parameters
    ----------
    terms : AnswerTerms
        Terms for the board: address, camera and target.
    report : callable
        Receives each image's record with its outcome, under the ``frame_id`` given to `sent`.
    note : callable
        Receives sentences about boards that connect and disconnect.

    Raises
    ------
    LinkError
        If the port is in use or the URL is invalid.
    """

    def __init__(
        self, terms: AnswerTerms, report: Callable[[FrameRecord], None], note: Callable[[str], None]
    ) -> None:
        self._listener = listen(terms.link.url)
        self._report, self._note = report, note
        self._requests: dict[int, int] = {}
        self._in_flight = FramesInFlight(self._report_outcome, terms.link.timeout_s)
        self._board = BoardSession(terms.link, self._report_event, self._in_flight)
        self._board.terms = Terms(terms.ack, 0, 0)
        self._pending = PendingLinks(
            lambda reason: note(f"a connection was closed: {reason}"), BUSY, terms.link.key
        )

    @property
    def url(self) -> str:
        """URL for boards, with the actual port."""
        return self._listener.url

    @property
    def sources(self) -> list[Any]:
        """File descriptors to wait on."""
        line = [] if self._board.link is None else [self._board.link.transport]
        return [self._listener, *line, *self._pending.transports]

    @property
    def due_s(self) -> float | None:
        """Monotonic time of the next action without input; None if there is none."""
        if self._board.unread:
            return 0.0
        times = [self._in_flight.first_deadline_ns, self._pending.first_deadline_ns]
        if self._board.link is not None:
            times.append(self._board.next_sync_ns)
        return min((time_ns * 1e-9 for time_ns in times if time_ns is not None), default=None)

    def step(self, ready: Collection[Any]) -> None:
        """Process input, and expire late images."""
        self._in_flight.expire(now_ns())
        self._pending.expire(now_ns())
        self._board.sync_clock()
        if self._board.link is not None and (self._board.unread or self._board.link.transport in ready):
            self._board.listen()
        arrived = self._listener.accept(0.0) if self._listener in ready else None
        self._pending.admit(self._board, ready, arrived)

    def sent(self, record: FrameRecord, number: int) -> None:
        """Register an image that was sent on the stream.

        Parameters
        ----------
        record : FrameRecord
            Record whose ``frame_id`` its outcome is reported under.
        number : int
            Number of the image on the stream.
        """
        record = record.with_times(handed_over_ns=now_ns())
        if self._board.link is None or self._board.ack is None:
            self._report(record.with_outcome("dropped:disconnected", "no board was connected"))
            return
        self._requests[number] = record.frame_id
        flight = self._in_flight.start(replace(record, frame_id=number), now_ns())
        self._in_flight.sent(flight, now_ns())

    def restart(self) -> None:
        """Restart the numbering with acquisition; earlier images are dropped."""
        self._in_flight.lose("acquisition was restarted")

    def close(self) -> bool:
        """Say goodbye, and drop images without an answer; return True if a board was connected."""
        connected = self._board.link is not None
        self._in_flight.lose(STOPPED)
        self._pending.refuse_all(STOPPED)
        self._board.end(STOPPED, goodbye=True)
        self._listener.close()
        return connected

    def _report_outcome(self, record: FrameRecord) -> None:
        self._report(replace(record, frame_id=self._requests.pop(record.frame_id)))

    def _report_event(self, event: object) -> None:
        if isinstance(event, BoardUp):
            self._note(
                f"a board connected from {event.peer}: {event.board.name}, method {event.board.method}"
            )
        elif isinstance(event, BoardDown):
            self._note(f"the board disconnected: {event.reason}")
