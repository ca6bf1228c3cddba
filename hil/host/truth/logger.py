"""Client of the truth endpoint that saves the truth as JSON lines."""

from __future__ import annotations

import json
import logging
import threading
import time
from pathlib import Path

from flyaround.hil.link.errors import LinkClosed, LinkError, PacketError
from flyaround.hil.link.packets.messages import Bye, ErrorMessage, TruthMessage, decode_message
from flyaround.hil.link.security import prove_to_host
from flyaround.hil.link.transports.base import Transport
from flyaround.hil.link.transports.tcp import connect_tcp
from flyaround.hil.link.transports.url import parse_url
from flyaround.simulator.errors import UserError

logger = logging.getLogger(__name__)

# Pause between tries to connect, and wait for a packet before the thread looks whether it is to stop [s].
RETRY_S, POLL_S = 0.05, 0.2

# Time for the thread to end after that [s]: a partly received packet is read to its end.
JOIN_S = 5.0


class TruthLogger:
    """Logger of truth packets in a thread, until the host says goodbye or ``stop`` is called.

    Each line of the file is ``{"frame_id": ..., "truth": {...}}``.

    Parameters
    ----------
    url : str
        Address of the truth endpoint, which may open after ``start``.
    path : Path
        JSON-lines file to write; an existing one is overwritten.
    key : bytes, optional
        Pre-shared key; None disables authentication.

    Raises
    ------
    UserError
        If the address is invalid.
    """

    def __init__(self, url: str, path: Path, key: bytes | None = None) -> None:
        self._key = key
        try:
            _, self._host, self._port = parse_url(url)
        except LinkError as error:
            raise UserError(str(error)) from error
        self._path = path
        self._stop = threading.Event()
        self._connected = threading.Event()
        self._thread = threading.Thread(target=self._run, name="truth logger", daemon=True)
        self._received = 0

    def start(self) -> None:
        """Start listening."""
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._path.write_text("", encoding="utf-8")
        self._thread.start()

    def wait_connected(self, timeout_s: float) -> bool:
        """Wait until the endpoint is reached, at most ``timeout_s``.

        Returns
        -------
        bool
            True if it was reached and, with a key, has proved that it has the same; False after the time-out.
        """
        return self._connected.wait(timeout_s)

    def stop(self, linger_s: float = 2.0) -> int:
        """Stop after the host's goodbye or ``linger_s``.

        Returns
        -------
        int
            Number of saved records.
        """
        if self._connected.is_set():
            self._thread.join(linger_s)
        self._stop.set()
        self._thread.join(JOIN_S)
        return self._received

    def _run(self) -> None:
        transport: Transport | None = None
        while transport is None and not self._stop.is_set():
            try:
                transport = connect_tcp(self._host, self._port, 0.0)
            except LinkError:
                time.sleep(RETRY_S)
        if transport is None:
            return
        if self._key is not None:
            try:
                transport = prove_to_host(transport, self._key)
            except LinkError as error:
                logger.warning("no truth is logged: %s", error)
                transport.close()
                return
        self._connected.set()
        try:
            with self._path.open("a", encoding="utf-8") as file:
                while not self._stop.is_set():
                    try:
                        packet = transport.recv_packet(POLL_S)
                        message = None if packet is None else decode_message(packet)
                    except PacketError:
                        continue
                    except LinkClosed:
                        return
                    if isinstance(message, Bye):
                        return
                    if isinstance(message, ErrorMessage):  # refused, for example because of too many loggers
                        logger.warning("no truth is logged: %s", message.text)
                        return
                    if isinstance(message, TruthMessage):
                        file.write(json.dumps({"frame_id": message.frame_id, "truth": message.truth}) + "\n")
                        file.flush()
                        self._received += 1
        finally:
            transport.close()
