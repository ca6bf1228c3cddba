"""Deliberate faults of the line: packets are delayed, lost, duplicated, swapped and damaged.

Two threads, one for each direction, pass packets between the link and the real line.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.link.clock import now_ns
from flyaround.hil.link.errors import LinkClosed, PacketError
from flyaround.hil.link.packets.frame_messages import FrameHeader, PoseMessage
from flyaround.hil.link.packets.messages import ABOUT_A_FRAME, TimeSyncReply, decode_message, frame_id_of
from flyaround.hil.link.packets.packet import HEADER, Packet, PacketType
from flyaround.hil.link.transports.tcp import SocketTransport
from flyaround.simulator.scenario.faults import (
    Bandwidth,
    ClockDrift,
    Corrupt,
    Delay,
    Disconnect,
    Drop,
    Duplicate,
    Jitter,
    Reorder,
)

if TYPE_CHECKING:
    from flyaround.hil.link.transports.base import Transport
    from flyaround.simulator.scenario.faults import Direction, Faults, LineFault

# First byte of a packet that may be damaged: after framing and header, so that its length stays valid.
DAMAGE_AT = 4 + HEADER.size

# Longest time that a packet to be swapped waits for the next one [s].
HOLD_S = 0.05

# Longest wait for a packet before due packets are sent [s].
IDLE_S = 0.05

# Longest wait of a closing link for its last packets, such as the goodbye, to reach the real line [s].
LAST_PACKETS_S = 0.5

_FRAME_ID = struct.Struct("<I")


class FaultJournal:
    """Faults that affected each frame, over all sessions of a run; written by the pumps, read by the ledger."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._by_frame: dict[int, list[str]] = {}
        self.t_s = 0.0
        """Flight time of the newest frame on the line [s]."""
        self.cut: set[int] = set()
        """Indices of past disconnections."""
        self.added: list[LineFault] = []
        """Faults added during the run."""

    def note(self, frame_id: int | None, name: str) -> None:
        """Record a fault on a packet of a frame."""
        if frame_id is None:
            return
        with self._lock:
            names = self._by_frame.setdefault(frame_id, [])
            if name not in names:
                names.append(name)

    def take(self, frame_id: int) -> tuple[str, ...]:
        """Return the faults of a frame, and remove them."""
        with self._lock:
            return tuple(self._by_frame.pop(frame_id, ()))


class NearEnd(SocketTransport):
    """The link's end of a line with faults; closing it passes on what was sent before."""

    to_board: threading.Thread

    def close(self) -> None:
        """Close the socket, and wait for its last packets to be passed on. Closing twice is allowed."""
        super().close()
        self.to_board.join(LAST_PACKETS_S)


def with_line_faults(line: Transport, faults: Faults, journal: FaultJournal) -> Transport:
    """Return the near end of a line with these faults; closing either end closes both."""
    near_socket, far_socket = socket.socketpair()
    near, far = NearEnd(near_socket, line.name), SocketTransport(far_socket, line.name)
    near.chunk_bytes = line.chunk_bytes
    for fault in faults.line:
        if isinstance(fault, Bandwidth):  # a slow line sends smaller pieces, like a serial one
            near.chunk_bytes = max(64, min(near.chunk_bytes, int(0.25 * fault.bytes_per_s)))
    session_over = threading.Event()
    to_board, to_host = (
        threading.Thread(target=pump.run, name="faults", daemon=True)
        for pump in (
            _Pump("to_board", far, line, faults, journal, session_over),
            _Pump("to_host", line, far, faults, journal, session_over),
        )
    )
    near.to_board = to_board
    to_board.start()
    to_host.start()
    return near


class _Pump:
    """One direction of the line; packets are passed on when due."""

    def __init__(
        self,
        direction: Direction,
        source: Transport,
        sink: Transport,
        faults: Faults,
        journal: FaultJournal,
        session_over: threading.Event,
    ) -> None:
        self._direction, self._source, self._sink = direction, source, sink
        self._faults, self._journal = faults, journal
        # a serial port outlives its session: later packets belong to the next session's pump
        self._session_over = session_over
        self._due: list[tuple[int, Packet, bool]] = []  # sorted by time, because packets do not overtake here
        self._last_due_ns = 0
        self._line_free_ns = 0
        self._jitter_ns = 0
        self._held_packet: tuple[int, Packet] | None = None
        self._first_board_ns: int | None = None

    def run(self) -> None:
        try:
            while not self._session_over.is_set():
                wait_s = IDLE_S
                if self._due:
                    wait_s = min(IDLE_S, max(0.0, (self._due[0][0] - now_ns()) * 1e-9))
                try:
                    packet = self._source.recv_packet(wait_s)
                except LinkClosed:
                    self._send_due(all_of_them=True)
                    break
                except PacketError:
                    continue  # damaged before it arrived: the receiver loses it as on the real line
                if packet is not None:
                    self._take(packet, now_ns())
                self._send_due()
        except LinkClosed:
            if self._direction == "to_host":
                return  # the link has closed its end; the other pump passes on its last packets, and closes the line
        self._session_over.set()
        self._source.close()
        self._sink.close()

    def _take(self, packet: Packet, at_ns: int) -> None:
        if packet.type is PacketType.FRAME_HEADER:
            with contextlib.suppress(PacketError):
                self._journal.t_s = FrameHeader.decode(packet.payload[: FrameHeader.LAYOUT.size]).t_s
        all_faults = (*self._faults.line, *self._journal.added)
        active_faults = [(k, f) for k, f in enumerate(all_faults) if self._is_active(f)]
        frame_id = frame_id_of(packet)
        copies, damaged, swapped = 1, False, False
        due_ns = at_ns
        for k, fault in active_faults:
            rng = self._rng(k, packet)
            if isinstance(fault, Disconnect):
                if k not in self._journal.cut and packet.type is PacketType.FRAME_HEADER:
                    self._journal.cut.add(k)
                    self._journal.note(frame_id, fault.name)
                    raise LinkClosed("the line was cut by a fault")
            elif isinstance(fault, Delay):
                due_ns += round(1e6 * fault.delay_ms)
                self._journal.note(frame_id, fault.name)
            elif isinstance(fault, Jitter):
                if packet.type in (PacketType.FRAME_HEADER, PacketType.POSE):
                    self._jitter_ns = round(1e6 * fault.most_ms * rng.random())
                    self._journal.note(frame_id, fault.name)
                due_ns += self._jitter_ns
            elif isinstance(fault, Bandwidth):
                due_ns = max(due_ns, self._line_free_ns)
                self._line_free_ns = due_ns + round(1e9 * len(packet.payload) / fault.bytes_per_s)
                due_ns = self._line_free_ns
                self._journal.note(frame_id, fault.name)
            elif isinstance(fault, ClockDrift):
                packet = self._with_drift(packet, fault.ppm)
            elif packet.type in ABOUT_A_FRAME and rng.random() < fault.chance:
                self._journal.note(frame_id, fault.name)
                if isinstance(fault, Drop):
                    return
                copies += isinstance(fault, Duplicate)
                damaged = damaged or isinstance(fault, Corrupt)
                swapped = swapped or isinstance(fault, Reorder)
        due_ns = max(due_ns, self._last_due_ns)
        self._last_due_ns = due_ns
        if swapped and self._held_packet is None:
            self._held_packet = (at_ns, packet)
            return
        for _ in range(copies):
            self._due.append((due_ns, packet, damaged))
        if self._held_packet is not None:
            self._due.append((due_ns, self._held_packet[1], False))
            self._held_packet = None

    def _is_active(self, fault: LineFault) -> bool:
        direction = getattr(fault, "direction", None)
        if isinstance(fault, ClockDrift):
            direction = "to_host"
        if isinstance(fault, Disconnect):
            direction = "to_board"
        return direction in ("both", self._direction) and fault.acts(self._journal.t_s)

    def _rng(self, k: int, packet: Packet) -> np.random.Generator:
        index = 0
        if packet.type is PacketType.FRAME_CHUNK:
            index = 1 + int(_FRAME_ID.unpack_from(packet.payload, 4)[0])
        frame_id = frame_id_of(packet)
        key = (
            self._faults.seed,
            k,
            self._direction == "to_host",
            packet.type,
            0 if frame_id is None else frame_id,
        )
        return np.random.default_rng((*key, index))

    def _with_drift(self, packet: Packet, ppm: float) -> Packet:
        """Return the packet with the board's clock running fast since its first packet."""
        if packet.type not in (PacketType.POSE, PacketType.TIME_SYNC_REPLY):
            return packet
        message = decode_message(packet)
        if isinstance(message, TimeSyncReply):
            names: tuple[str, ...] = ("received_ns", "sent_ns")
        elif isinstance(message, PoseMessage):
            names = ("receive_ns", "start_ns", "end_ns")
        else:
            return packet
        if self._first_board_ns is None:
            self._first_board_ns = getattr(message, names[0])
        first = self._first_board_ns
        times = {n: first + round((getattr(message, n) - first) * (1 + 1e-6 * ppm)) for n in names}
        return replace(packet, payload=replace(message, **times).encode())

    def _send_due(self, *, all_of_them: bool = False) -> None:
        at_ns = now_ns()
        if self._held_packet is not None and at_ns - self._held_packet[0] > HOLD_S * 1e9:
            self._due.append((at_ns, self._held_packet[1], False))
            self._held_packet = None
        while self._due and (all_of_them or self._due[0][0] <= at_ns):
            _, packet, damaged = self._due.pop(0)
            if damaged:
                self._sink.send_damaged(packet, DAMAGE_AT + len(packet.payload) // 2, 0x10)
            else:
                self._sink.send_packet(packet)
