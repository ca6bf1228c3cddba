"""Endpoint process: commands of one controller, frames when due, and the packet stream.

GVCP has no authentication, and addresses can be forged. Therefore the endpoint listens on one interface to listed
addresses only, sends images only to its controller's address, and bounds its memory at the start.
"""

from __future__ import annotations

import select
import signal
import socket
import struct
import time
from typing import TYPE_CHECKING, Any

from flyaround.hil.host.camera_endpoint import gvcp
from flyaround.hil.host.camera_endpoint.acquisition import Acquisition
from flyaround.hil.host.camera_endpoint.answer_port import AnswerPort
from flyaround.hil.host.camera_endpoint.gvcp import GvcpCommand, GvcpRequest, RefusedError, Status
from flyaround.hil.host.camera_endpoint.interface import open_socket
from flyaround.hil.host.camera_endpoint.messages import (
    ImageResult,
    Note,
    Opened,
    PictureOutcome,
    Stop,
)
from flyaround.hil.host.camera_endpoint.registers import (
    DO_NOT_FRAGMENT,
    EXCLUSIVE,
    FIRE_TEST_PACKET,
    Register,
    Registers,
)
from flyaround.hil.host.camera_endpoint.stream_channel import StreamChannel
from flyaround.hil.link.errors import LinkError
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from flyaround.hil.host.camera_endpoint.messages import EndpointConfig
    from flyaround.hil.host.frame_record import FrameRecord

    Peer = tuple[str, int]

MAX_COMMANDS = 64
"""Largest number of commands processed per socket before packets are sent again."""

MAX_REPORTED_ADDRESSES = 16
"""Largest number of unlisted addresses that are reported."""

REPEAT_WINDOW_S = 1.0
"""Time within which a repeated command is acknowledged again but not executed again [s]."""

# Longest wait for an event [s].
IDLE_S = 0.5

RELEASE_TIMEOUT_S = 1.5
"""Time for a board to release control after the goodbye [s]."""


def serve_endpoint(pipe: Connection, config: EndpointConfig) -> None:
    """Run the endpoint until the other end of the pipe is closed."""
    # Ctrl-C is handled by the render process, which closes the pipe
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        endpoint = CameraEndpoint(pipe, config)
    except UserError as error:
        pipe.send(UserError(str(error)))
        return
    try:
        pipe.send(Opened(endpoint.answers_url))
        while endpoint.step():
            pass
        endpoint.end()
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass  # the render process is gone


class CameraEndpoint:
    """Simulated camera on one network interface.

    Raises
    ------
    UserError
        If a port is in use.
    """

    def __init__(self, pipe: Connection, config: EndpointConfig) -> None:
        self._pipe, self._config = pipe, config
        interface = config.interface
        self._control = open_socket(interface, interface.address, gvcp.PORT)
        self._sockets = [self._control]
        self._answers: AnswerPort | None = None
        try:
            for address in dict.fromkeys(("255.255.255.255", interface.broadcast)):
                if address != "0.0.0.0":  # noqa: S104 - compared, not listened on: lo has no broadcast address
                    self._sockets.append(open_socket(interface, address, gvcp.PORT))
            stream = open_socket(interface, interface.address, 0)
            if config.answers is not None:
                self._answers = AnswerPort(config.answers, self._report_outcome, self._note)
        except LinkError as error:
            self.close()
            raise UserError(str(error)) from error
        except UserError:
            self.close()
            raise
        for sock in self._sockets:
            sock.setblocking(False)
        self._stream = StreamChannel(stream, config.loss_share, config.loss_seed)
        self._registers = Registers(
            config.terms, interface, self._stream.source_port, config.xml, config.xml_name
        )
        self._acquisition = Acquisition(self._registers, self._stream, pipe.send)
        self._acquisition.answers = self._answers
        self._controller: Peer | None = None
        self._last_command_s = 0.0
        self._last: tuple[float, Peer, bytes, bytes] | None = None
        self._foreign_addresses: set[str] = set()
        self._after = {
            Register.STREAM_PACKET_BYTES: self._packet_size_written,
            Register.TIMESTAMP_CONTROL: self._acquisition.control_timestamp,
            Register.ACQUISITION_START: self._acquisition.start,
            Register.ACQUISITION_STOP: self._acquisition_stop_written,
            Register.TRIGGER_SOFTWARE: self._acquisition.trigger,
        }

    @property
    def answers_url(self) -> str | None:
        """URL at which boards send their poses."""
        return None if self._answers is None else self._answers.url

    def end(self) -> None:
        """Say goodbye to the board, wait until it releases control, and close."""
        self._acquisition.stop()
        answers, self._answers = self._answers, None
        if answers is not None and answers.close():
            until_s = time.monotonic() + RELEASE_TIMEOUT_S
            while self._controller is not None and time.monotonic() < until_s:
                self.step()
        self.close()

    def close(self) -> None:
        """Close the sockets."""
        if self._answers is not None:
            self._answers.close()
        for sock in self._sockets:
            sock.close()
        if hasattr(self, "_stream"):
            self._stream.close()

    def step(self) -> bool:
        """Wait for the next event and handle it; return False at the end."""
        sources: list[Any] = [*self._sockets, self._pipe]
        if self._answers is not None:
            sources += self._answers.sources
        ready = select.select(sources, [], [], self._sleep_s())[0]
        for sock in self._sockets:
            if sock in ready:
                self._receive_commands(sock)
        if self._pipe in ready:
            message = self._pipe.recv()
            if isinstance(message, Stop):
                return False
            if isinstance(message, ImageResult):
                self._acquisition.take(message)
        if self._answers is not None:
            self._answers.step(ready)
        now = time.monotonic()
        if (
            self._controller is not None
            and now > self._last_command_s + self._registers[Register.HEARTBEAT_MS] * 1e-3
        ):
            self._release(f"controller {self._controller[0]} sent no heartbeat: control was released")
        self._acquisition.send_exposed(now, self._receiver)
        self._acquisition.request_frame(now)
        self._stream.step(now)
        return True

    def _sleep_s(self) -> float:
        times = [time.monotonic() + IDLE_S]
        if self._stream.due_s is not None:
            times.append(self._stream.due_s)
        if self._controller is not None:
            times.append(self._last_command_s + self._registers[Register.HEARTBEAT_MS] * 1e-3)
        if self._acquisition.wants_frame:
            times.append(self._acquisition.next_s)
        if self._acquisition.read_out_s is not None:
            times.append(self._acquisition.read_out_s)
        if self._answers is not None and self._answers.due_s is not None:
            times.append(self._answers.due_s)
        return max(0.0, min(times) - time.monotonic())

    # --- commands ---------------------------------------------------------------------------

    def _receive_commands(self, sock: socket.socket) -> None:
        for _ in range(MAX_COMMANDS):
            try:
                datagram, peer = sock.recvfrom(gvcp.MAX_BYTES + 1)
            except (BlockingIOError, ConnectionRefusedError):
                return
            answer = self.answer(datagram, peer)
            if answer is not None:
                try:
                    self._control.sendto(answer, peer)
                except OSError:
                    return  # the receiver is gone

    def answer(self, datagram: bytes, peer: Peer) -> bytes | None:
        """Return the acknowledgement of a datagram, or None if it must not be answered."""
        if peer[0] not in self._config.allowed:
            self._report_foreign_address(peer[0])
            return None
        request = gvcp.parse_request(datagram)
        if request is None:
            return None
        if request.command == GvcpCommand.DISCOVERY:
            return gvcp.acknowledge(request, self._registers.discovery)
        now = time.monotonic()
        if peer == self._controller:
            self._last_command_s = now
        if (
            self._last is not None
            and self._last[1:3] == (peer, datagram)
            and now - self._last[0] < REPEAT_WINDOW_S
        ):
            return self._last[3] or None
        try:
            answer = gvcp.acknowledge(request, self._carry_out(request, peer))
        except RefusedError as refused:
            payload = struct.pack(">HH", 0, refused.index) if request.command in _WRITES else b""
            answer = gvcp.acknowledge(request, payload, refused.status)
        if not request.wants_answer or request.command == GvcpCommand.PACKET_RESEND:
            answer = b""
        self._last = (now, peer, datagram, answer)
        return answer or None

    def _carry_out(self, request: GvcpRequest, peer: Peer) -> bytes:
        """Execute a command, and return the payload of its acknowledgement.

        Raises
        ------
        RefusedError
            If the command is refused.
        """
        registers, payload = self._registers, request.payload
        if request.command == GvcpCommand.PACKET_RESEND:
            # a receiver sends requests from its stream socket, so only the address can be compared
            if self._controller is not None and peer[0] == self._controller[0]:
                self._stream.resend(gvcp.parse_resend(payload))
            return b""
        if request.command == GvcpCommand.READ_REGISTER:
            self._check_may_read(peer)
            return b"".join(registers.read(address, 4) for address in gvcp.read_addresses(payload))
        if request.command == GvcpCommand.READ_MEMORY:
            self._check_may_read(peer)
            address, count = gvcp.read_span(payload)
            return struct.pack(">I", address) + registers.read(address, count)
        if request.command == GvcpCommand.WRITE_REGISTER:
            pairs = gvcp.write_pairs(payload)
            for index, (address, value) in enumerate(pairs):
                try:
                    self._write(address, value, peer)
                except RefusedError as refused:
                    raise RefusedError(refused.status, index) from refused
            return struct.pack(">HH", 0, len(pairs))
        if request.command == GvcpCommand.WRITE_MEMORY:
            address, data = gvcp.write_span(payload)
            if len(data) == 4:
                self._write(address, int.from_bytes(data, "big"), peer)
            else:
                self._check_controls(peer)
                if address <= Register.CONTROL_PRIVILEGE < address + len(
                    data
                ) or address <= Register.STREAM_ADDRESS < (address + len(data)):
                    raise RefusedError(Status.ACCESS_DENIED)  # these must be written one by one
                for register in registers.write(address, data):
                    self._written(register)
            return struct.pack(">HH", 0, len(data))
        raise RefusedError(Status.NOT_IMPLEMENTED)

    def _check_may_read(self, peer: Peer) -> None:
        exclusive = self._registers[Register.CONTROL_PRIVILEGE] & EXCLUSIVE
        if self._controller not in {None, peer} and exclusive:
            raise RefusedError(Status.ACCESS_DENIED)

    def _check_controls(self, peer: Peer) -> None:
        if peer != self._controller:
            raise RefusedError(Status.ACCESS_DENIED)

    def _write(self, address: int, value: int, peer: Peer) -> None:
        if address == Register.CONTROL_PRIVILEGE:
            if self._controller not in {None, peer}:
                self._note(f"{peer[0]} was refused control, which {self._controller_name} has")
                raise RefusedError(Status.ACCESS_DENIED)
            self._registers.write_register(address, value)
            if value:
                self._claim(peer)
            elif self._controller is not None:
                self._release(f"controller {peer[0]} released control")
            return
        self._check_controls(peer)
        if address == Register.STREAM_ADDRESS and value not in {
            0,
            int.from_bytes(socket.inet_aton(peer[0]), "big"),
        }:
            raise RefusedError(Status.INVALID_PARAMETER)  # images are sent only to the controller
        self._written(self._registers.write_register(address, value))

    def _written(self, register: Register) -> None:
        action = self._after.get(register)
        if action is not None:
            action()

    # --- control ----------------------------------------------------------------------------

    @property
    def _controller_name(self) -> str:
        return "nobody" if self._controller is None else self._controller[0]

    def _claim(self, peer: Peer) -> None:
        if self._controller is None:
            self._note(f"{peer[0]} controls the camera")
        self._controller, self._last_command_s = peer, time.monotonic()
        self._registers[Register.CONTROLLER_PORT] = peer[1]
        self._registers[Register.CONTROLLER_ADDRESS] = int.from_bytes(socket.inet_aton(peer[0]), "big")

    def _release(self, sentence: str) -> None:
        self._acquisition.stop()
        self._controller = None
        for register in (
            Register.CONTROL_PRIVILEGE,
            Register.CONTROLLER_PORT,
            Register.CONTROLLER_ADDRESS,
            Register.STREAM_PORT,
            Register.STREAM_ADDRESS,
            Register.TRANSPORT_LOCKED,
        ):
            self._registers[register] = 0
        self._note(sentence)

    def _report_foreign_address(self, address: str) -> None:
        if address not in self._foreign_addresses and len(self._foreign_addresses) < MAX_REPORTED_ADDRESSES:
            self._foreign_addresses.add(address)
            self._note(f"{address} is not an allowed controller: ignored")

    def _note(self, sentence: str) -> None:
        self._pipe.send(Note(sentence))

    # --- what follows a written register ----------------------------------------------------

    def _packet_size_written(self) -> None:
        value = self._registers[Register.STREAM_PACKET_BYTES]
        receiver = self._receiver
        if value & FIRE_TEST_PACKET:
            self._registers[Register.STREAM_PACKET_BYTES] = value & ~FIRE_TEST_PACKET
            if receiver is not None:
                self._stream.send_test_packet(receiver, value & 0xFFFF)
        self._stream.set_fragments(allowed=not value & DO_NOT_FRAGMENT)

    @property
    def _receiver(self) -> Peer | None:
        """Destination of images: the controller, once it has set a port."""
        port = self._registers[Register.STREAM_PORT]
        if self._controller is None or not port or not self._registers[Register.STREAM_ADDRESS]:
            return None
        return self._controller[0], port

    def _acquisition_stop_written(self) -> None:
        self._registers[Register.ACQUISITION_STOP] = 0
        self._acquisition.stop()

    def _report_outcome(self, record: FrameRecord) -> None:
        self._pipe.send(PictureOutcome(record.frame_id, record))


_WRITES = (GvcpCommand.WRITE_REGISTER, GvcpCommand.WRITE_MEMORY)
