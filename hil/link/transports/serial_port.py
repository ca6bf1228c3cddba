"""Serial line: COBS frames in small chunks; needs pyserial."""

from __future__ import annotations

import select
import time
from typing import Optional

from flyaround.hil.link.errors import LinkClosed, LinkError
from flyaround.hil.link.framing.cobs import CobsFraming
from flyaround.hil.link.transports.base import StreamTransport, WrappedTransport

try:
    import serial
except ImportError:
    serial = None  # type: ignore[assignment]


BITS_PER_BYTE = 10
"""A start bit, eight data bits and a stop bit."""

# Duration of one write to the port [s].
PIECE_S = 0.01

# Longest duration of a chunk [s], because only complete packets show the other side that this one is alive; and minimum
# size of a chunk.
CHUNK_S, MIN_CHUNK_BYTES = 0.25, 64

# Longest delay that the pacing catches up with [s].
MAX_CATCH_UP_S = 0.1


class SerialTransport(StreamTransport):
    """Serial port at one baud rate, 8N1, with RTS/CTS on request.

    Bytes are written no faster than the line transmits them, because drivers and adapters would buffer them, and a
    pseudo-terminal accepts any amount at once.

    Packets may be lost or damaged, but not reordered. A serial line has no connection, so a lost peer shows only as
    silence or BYE. Without RTS/CTS there is no flow control: a receiver that does not read loses bytes.

    Raises
    ------
    LinkError
        If pyserial is missing, or the port cannot be opened at this rate.
    """

    # a damaged byte costs one chunk; the overhead is 20 bytes in 2048; slower lines use smaller chunks
    chunk_bytes = 2048

    def __init__(self, device: str, baud: int, *, rtscts: bool = False) -> None:
        super().__init__(f"serial://{device}?baud={baud}" + ("&rtscts=1" if rtscts else ""), CobsFraming())
        self._bytes_per_s = baud / BITS_PER_BYTE
        self.chunk_bytes = max(MIN_CHUNK_BYTES, min(self.chunk_bytes, int(CHUNK_S * self._bytes_per_s)))
        self._free_s = 0.0  # time at which the line has transmitted everything written
        if serial is None:
            raise LinkError("a serial link needs pyserial, which is not installed: pip install pyserial")
        try:
            self._port = serial.Serial(
                device, baud, timeout=0.0, write_timeout=10.0, exclusive=True, rtscts=rtscts
            )
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise LinkError(
                f"serial port {device} at {baud} baud cannot be opened ({error}):"
                " check the name, the permissions (group dialout) and the rates of the adapter"
            ) from error

    def fileno(self) -> int:
        """Return the file descriptor of the port.

        Returns
        -------
        int
            Descriptor that becomes readable when bytes arrive.
        """
        return int(self._port.fileno())

    def close(self) -> None:
        """Release the port."""
        if not self._closed:
            self._closed = True
            self._port.close()

    def _write(self, data: bytes) -> None:
        view = memoryview(data)
        piece = max(1, int(self._bytes_per_s * PIECE_S))
        # a pause is not caught up with, but a late wake-up is, below
        self._free_s = max(self._free_s, time.monotonic())
        try:
            for offset in range(0, len(view), piece):
                part = view[offset : offset + piece]
                wait_s = self._free_s - time.monotonic()
                if wait_s > 0:
                    time.sleep(wait_s)
                self._port.write(part)
                self._free_s = (
                    max(self._free_s, time.monotonic() - MAX_CATCH_UP_S) + len(part) / self._bytes_per_s
                )
        except (OSError, TypeError) as error:  # pyserial raises TypeError when closed by another thread
            raise LinkClosed(f"{self.name} cannot be written ({error}): is it still plugged in?") from error

    def _read(self, timeout_s: float) -> bytes:
        try:
            waiting = self._port.in_waiting
            if waiting:
                return bytes(self._port.read(waiting))
            if timeout_s <= 0:
                return b""
            self._port.timeout = timeout_s
            return bytes(self._port.read(1))
        except (OSError, TypeError) as error:
            raise LinkClosed(f"{self.name} cannot be read ({error}): is it still plugged in?") from error


class _SharedPort(WrappedTransport):
    """Listener's port as used by one session; closing the session keeps the port open."""

    def close(self) -> None:
        """Leave the port open for the next session."""


class SerialListener:
    """Listener for the first byte on a serial port."""

    def __init__(self, device: str, baud: int, *, rtscts: bool = False) -> None:
        self._port = SerialTransport(device, baud, rtscts=rtscts)
        self.url = self._port.name

    def accept(self, timeout_s: float) -> Optional[_SharedPort]:
        """Return the line once a byte has arrived; None after ``timeout_s``."""
        poller = select.poll()
        poller.register(self._port.fileno(), select.POLLIN)
        return _SharedPort(self._port) if poller.poll(timeout_s * 1e3) else None

    def fileno(self) -> int:
        """Return the file descriptor of the port."""
        return self._port.fileno()

    def close(self) -> None:
        """Release the port."""
        self._port.close()
