"""Messages to the operator: notes, cautions and warnings, and when each of them ends."""

from __future__ import annotations

import logging
import re
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from flyaround.simulator.runtime.files import probe_writing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from flyaround.simulator.piloting.session import FlightSession

log = logging.getLogger(__name__)

Level = Literal["note", "caution", "warning"]
CLOCK = "%H:%M:%S"
KEPT = 500  # number of messages that are kept
NEWEST = 9  # number of messages whose notes may still be shown, and end
UNWRITABLE = re.compile(r"cannot write (?:the film )?(.+?): |\[Errno \d+\] .+?: '(.+?)'")
"""The path that cannot be written, in the text of a message."""


@dataclass
class Message:
    """A message; cautions and warnings stay until they are acknowledged, or until their cause ends."""

    t_s: float
    """Simulated time of the flight."""
    level: Level
    text: str
    acknowledged: bool = False
    at: str = field(default_factory=partial(time.strftime, CLOCK))
    until: str = ""
    """Times of day of the message, and of its acknowledgement or of the end of its cause."""
    of: str = ""
    """Command that was refused or failed, or that gave a result. A refusal is no caution unless it concerns the flight
    or a file."""
    news: bool = False
    """True for news of the flight, which an answer to the operator outlasts for a while."""
    said_ms: int = 0
    """Real time of the message since the first picture."""
    blocked: Path | None = None
    """File or folder that cannot be written."""
    over: Callable[[], bool] | None = None
    """Function that returns True once the cause of a caution has ended, or a note is no longer true."""


class Messages(list[Message]):
    """The messages of a sitting, the newest last.

    Attributes
    ----------
    said : int
        Number of messages so far, with immediate repetitions.
    """

    said = 0

    @property
    def waiting(self) -> list[Message]:
        """Unacknowledged cautions and warnings, the newest last."""
        return [m for m in self if m.level != "note" and not m.acknowledged]

    def add(self, message: Message) -> None:
        """Show a message; an immediate repetition, and an empty text, are dropped."""
        level, text = message.level, message.text
        self.said += bool(text)
        if not text or any(m.text == text and not m.acknowledged for m in self[-1:]):
            return
        if level == "caution" and (found := UNWRITABLE.search(text)):
            path = Path(found[1] or found[2])
            message.blocked = path if probe_writing(path) else None
        self.append(message)
        del self[:-KEPT]
        log.log(logging.INFO if level == "note" else logging.WARNING, "%s", text)

    def acknowledge(self, messages: Iterable[Message] | None = None) -> None:
        """Acknowledge cautions and warnings whose cause has ended, or by default all of them and results of jobs."""
        results = [m for m in self if m.of and not m.acknowledged]
        for message in [*self.waiting, *results] if messages is None else messages:
            message.acknowledged, message.until = True, time.strftime(CLOCK)

    def end(self, session: FlightSession, *, probes: bool) -> None:
        """Acknowledge messages whose cause has ended in the flight; with ``probes`` also those of writable files."""
        notes = [m for m in self[-NEWEST:] if m.level == "note" and not m.acknowledged]
        over = [m for m in self.waiting + notes if (m.over or partial(session.is_over, m.text))()]
        if probes:
            over += [m for m in self.waiting if m.blocked and not probe_writing(m.blocked)]
        self.acknowledge(over)
