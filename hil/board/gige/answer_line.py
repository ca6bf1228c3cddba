"""Connection on which a board that reads a GigE Vision camera returns its poses to the host."""

from __future__ import annotations

import logging
import threading
from typing import Any, Dict, Optional

from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.errors import LinkClosed, LinkError, PacketError
from flyaround.hil.link.packets.messages import (
    Bye,
    Credit,
    ErrorCode,
    ErrorMessage,
    Hello,
    PoseMessage,
    TimeSyncRequest,
)
from flyaround.hil.link.packets.packet import PacketType
from flyaround.hil.link.security import prove_to_host
from flyaround.hil.link.session import Link, greet_host
from flyaround.hil.link.transports.url import connect

logger = logging.getLogger(__name__)

# Interval at which the receiving thread checks whether it must stop [s].
CHECK_INTERVAL_S = 0.5


class AnswerLine:
    """Session with a host that carries poses only; the images come from the camera.

    Parameters
    ----------
    url : str
        URL at which the host accepts poses.
    hello : Hello
        HELLO message of this board.
    key : bytes or None
        Pre-shared key for mutual authentication; None disables authentication.
    timeout_s : float
        Time-out of the connection, and of the host's first message.
    silence_s : float
        Time without messages after which the host is considered lost.

    Raises
    ------
    LinkError
        If the host cannot be reached or refuses the session.
    """

    def __init__(
        self, url: str, hello: Hello, key: Optional[bytes], timeout_s: float, silence_s: float
    ) -> None:
        self._silence_ns = silence_s * 1e9
        self.ended = ""
        """Reason why the session ended, one sentence; empty while it runs."""
        self.goodbye = False
        line = connect(url, timeout_s)
        try:
            self._link = Link(line if key is None else prove_to_host(line, key))
            self._terms = greet_host(self._link, hello, timeout_s)
        except LinkError:
            line.close()
            raise
        self._link.accepts = self._link.accepts - {PacketType.TRUTH}
        self._stop = threading.Event()
        self._listener = threading.Thread(target=self._listen, name="answer line", daemon=True)
        self._listener.start()

    @property
    def camera(self) -> Dict[str, Any]:
        """Camera JSON object that the host sends."""
        return self._terms.camera

    @property
    def takes_fields(self) -> bool:
        """True if the host accepts optional fields."""
        return self._terms.takes_fields

    def send(self, pose: PoseMessage) -> None:
        """Send the pose of one image. The host then considers earlier images without an answer as unanswered."""
        try:
            self._link.send(pose)
            self._link.send(Credit(pose.frame_id, self._terms.window))
        except LinkClosed as error:
            self.ended = self.ended or f"the host went away without a goodbye ({error})"

    def close(self, reason: str) -> None:
        """End the session with a goodbye that states the reason, and wait for the listener thread."""
        self._stop.set()
        self._link.close(reason)
        self._listener.join(2.0)

    def _listen(self) -> None:
        last_received_ns = now_ns()
        while not self._stop.is_set() and not self.ended:
            try:
                message = self._link.recv(CHECK_INTERVAL_S)
            except PacketError as error:
                logger.warning("%s", error)
                continue
            except LinkClosed as error:
                self.ended = self.ended or f"the host went away without a goodbye ({error})"
                return
            if message is not None:
                last_received_ns = now_ns()
            elif now_ns() - last_received_ns > self._silence_ns:
                self.ended = f"the host said nothing for {self._silence_ns * 1e-9:g} s"
            if isinstance(message, TimeSyncRequest):
                try:
                    # the reply must not list received images: the host would count those still being processed as lost
                    self._link.send(answer_time_sync(message, last_received_ns))
                except LinkClosed:
                    continue  # the next recv reports the reason
            elif isinstance(message, Bye):
                self.goodbye, self.ended = True, f"the host ended the session ({message.reason})"
            elif isinstance(message, ErrorMessage) and message.code != ErrorCode.CORRUPT:
                self.ended = f"the host ended the session: {message.text}"
