"""A board in Python without Flyaround, after docs/hil_protocol.md: numpy and the standard library only.

    python3 board_python.py 127.0.0.1 5600

It takes raw Mono8 images over TCP and answers with the direction of the bright pixels, at a range of 10 m: not an
estimator, but a host cannot tell. Replace ``look`` by your own. Exit code 0: the host said goodbye; 1: it vanished; 2:
an error, described in one sentence.
"""

from __future__ import annotations

import json
import socket
import struct
import sys
import time
import zlib
from collections.abc import Callable
from contextlib import suppress

import numpy as np

VERSION, NO_FRAME, MAX_PAYLOAD = 2, 0xFFFFFFFF, 1 << 22
HELLO, HELLO_ACK, TIME_SYNC_REQUEST, TIME_SYNC_REPLY, FRAME_HEADER, FRAME_CHUNK = 1, 2, 3, 4, 5, 6
POSE, CREDIT, BYE, ERROR = 7, 8, 10, 11
CORRUPT, INCOMPLETE, FORMAT = 2, 3, 6
RAW, MONO8 = 0, 0x01080001
HEADER = struct.Struct("<4sHBBQII")
Position = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Ended(Exception):  # noqa: N818 - how every session ends
    """The session has ended: exit code and sentence."""


class Line:
    """Packets over TCP."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.create_connection((host, port), timeout=60.0)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.buffer = bytearray()
        self.session_id = self.sequence = 0

    def say(self, kind: int, payload: bytes) -> None:
        """Send one packet."""
        packet = (
            HEADER.pack(b"FLYA", VERSION, kind, 0, self.session_id, self.sequence, len(payload)) + payload
        )
        packet += struct.pack("<I", zlib.crc32(packet))
        self.sequence = (self.sequence + 1) & 0xFFFFFFFF
        # the connection is gone; its last message may have arrived, which the next hear() returns
        with suppress(OSError):
            self.socket.sendall(struct.pack("<I", len(packet)) + packet)

    def say_error(self, code: int, frame_id: int, text: str) -> None:
        """Report an error to the host."""
        said = text.encode()
        self.say(ERROR, struct.pack("<HHI", code, len(said), frame_id) + said)

    def hear(self) -> tuple[int, int, bytes] | None:
        """Return the next packet's type, session id and payload; None for a damaged one."""
        while True:
            while len(self.buffer) >= 4 + HEADER.size:
                length = struct.unpack_from("<I", self.buffer)[0]
                magic, version, kind, _, session_id, _, n = HEADER.unpack_from(self.buffer, 4)
                if magic != b"FLYA" or n > MAX_PAYLOAD or length != HEADER.size + n + 4:
                    del self.buffer[0]  # out of step: search on
                    continue
                if len(self.buffer) < 4 + length:
                    break
                packet = bytes(self.buffer[4 : 4 + length])
                if zlib.crc32(packet[:-4]) != struct.unpack("<I", packet[-4:])[0]:
                    del self.buffer[:5]  # the damage may be in its length, so later packets may start inside
                    return None
                del self.buffer[: 4 + length]
                if version != VERSION:
                    raise Ended(2, f"the host speaks protocol {version}, this board {VERSION}")
                return kind, session_id, packet[HEADER.size : -4]
            data = self.socket.recv(1 << 20)
            if not data:
                raise Ended(1, "the host went away without a goodbye")
            self.buffer += data


def look(image: np.ndarray, camera: dict[str, float]) -> Position | None:
    """Return the middle of the bright pixels at 10 m, in the camera's axes [m]; None if nothing is bright."""
    brightest = int(image.max())
    if brightest < 16:
        return None
    rows, columns = np.nonzero(2 * image.astype(int) > brightest)
    z = 10.0
    x = (columns.mean() - camera["cx_px"]) / camera["fx_px"] * z
    y = (rows.mean() - camera["cy_px"]) / camera["fy_px"] * z
    return x, y, z


class Board:
    """One session with a host."""

    def __init__(self, line: Line) -> None:
        self.line = line
        self.newest = NO_FRAME
        self.frame: tuple[int, int, bytearray] | None = (
            None  # id, number of chunks, and the bytes of the one that is coming in
        )

    def greet(self) -> None:
        """Exchange HELLO and the host's terms."""
        # raw, one frame at a time, Mono8, any target
        hello = struct.pack(
            "<HHHH64s32s32s64s", VERSION, 1, 1, 1, b"", b"", b"centroid", b"example board in Python"
        )
        self.line.say(HELLO, hello)
        while True:
            heard = self.line.hear()
            if heard is None:
                continue
            kind, session_id, payload = heard
            if kind == ERROR:
                raise Ended(2, f"the host refuses: {payload[8:].decode()}")
            if kind == HELLO_ACK:
                break
        self.line.session_id = session_id
        self.width, self.height, pixel_format, _, encoding, _, _, self.window = struct.unpack_from(
            "<HHIBBBBH", payload
        )
        if (pixel_format, encoding) != (MONO8, RAW):
            self.line.say_error(FORMAT, NO_FRAME, "this board takes raw Mono8 images alone")
            raise Ended(2, "the host's terms cannot be kept")
        self.camera = json.loads(payload[120:])

    def serve(self) -> None:
        """Answer messages until the host ends the session."""
        while True:
            heard = self.line.hear()
            at_ns = time.monotonic_ns()
            if heard is None:
                if self.frame is None:
                    self.line.say_error(CORRUPT, NO_FRAME, "a packet was damaged")
                self.lose()
                continue
            kind, session_id, payload = heard
            if kind == ERROR and struct.unpack_from("<H", payload)[0] != CORRUPT:
                raise Ended(1, f"the host ended the session: {payload[8:].decode()}")
            if session_id != self.line.session_id:
                continue  # from an earlier session
            if kind == BYE:
                raise Ended(0, f"the host ended the session: {payload[4:].decode()}")
            if kind == TIME_SYNC_REQUEST:
                told = struct.pack("<QQII", at_ns, time.monotonic_ns(), self.newest, 1)
                self.line.say(TIME_SYNC_REPLY, payload + told)
            elif kind == FRAME_HEADER:
                self.take_header(payload)
            elif kind == FRAME_CHUNK:
                self.take_chunk(payload, at_ns)

    def lose(self) -> None:
        """Abandon the incoming frame, which cannot be completed."""
        if self.frame is not None:
            self.line.say_error(INCOMPLETE, self.frame[0], "a packet of the frame was lost")
        self.frame = None

    def take_header(self, payload: bytes) -> None:
        """Begin a frame; ids increase, so one not above the last is a repeated packet."""
        frame_id, width, height, pixel_format, _, encoding, _, _, total, chunks = struct.unpack_from(
            "<IHHIBBBBII", payload
        )
        if (self.newest != NO_FRAME and frame_id <= self.newest) or (
            self.frame and frame_id == self.frame[0]
        ):
            return
        self.lose()
        agreed = (self.width, self.height, MONO8, RAW, self.width * self.height)
        if (width, height, pixel_format, encoding, total) != agreed:
            self.line.say_error(FORMAT, frame_id, "a frame of another size or format than agreed")
            return
        self.frame = frame_id, chunks, bytearray()

    def take_chunk(self, payload: bytes, at_ns: int) -> None:
        """Add a chunk of the frame; chunks arrive in order."""
        frame_id, index, offset, _ = struct.unpack_from("<IIII", payload)
        if self.frame is None or frame_id != self.frame[0]:
            return  # the rest of a lost frame
        _, chunks, pixels = self.frame
        if offset < len(pixels):
            return  # a repeated chunk
        if offset > len(pixels):
            self.lose()
            return
        pixels += payload[16:]
        if index + 1 < chunks:
            return
        self.frame = None
        self.newest = frame_id
        self.answer(frame_id, np.frombuffer(pixels, np.uint8).reshape(self.height, self.width), at_ns)

    def answer(self, frame_id: int, image: np.ndarray, received_ns: int) -> None:
        """Send POSE, then CREDIT."""
        start_ns = time.monotonic_ns()
        t_m = look(image, self.camera)
        pose = None if t_m is None else ((1.0, 0.0, 0.0, 0.0), t_m)
        self.say_pose(frame_id, pose, (received_ns, start_ns, time.monotonic_ns()))
        self.release(frame_id)

    def say_pose(
        self, frame_id: int, pose: tuple[Quaternion, Position] | None, times_ns: tuple[int, int, int]
    ) -> None:
        """Send POSE: a pose, or None without one, and the times of reception, start and answer."""
        seen = pose is not None
        reason = b"" if seen else b"nothing bright in the picture"
        q_wxyz, t_m = pose or ((0.0,) * 4, (0.0,) * 3)
        said = struct.pack("<IBBHd", frame_id, seen, seen, 1, 0.0)
        said += struct.pack("<4d3d", *q_wxyz, *t_m)
        said += struct.pack("<QQQHH", *times_ns, len(reason), 0)
        said += struct.pack("<24sd", b"centroid", 1e-6 * (times_ns[2] - times_ns[1])) + reason
        self.line.say(POSE, said)

    def release(self, frame_id: int) -> None:
        """Send CREDIT: room for the next frame."""
        self.line.say(CREDIT, struct.pack("<IHH", frame_id, self.window, 0))


def main() -> int:
    """Serve one session; return its exit code."""
    if len(sys.argv) != 3:
        print("usage: board_python.py HOST PORT", file=sys.stderr)
        return 2
    return run(Board, sys.argv[1], sys.argv[2])


def run(make_board: Callable[[Line], Board], host: str, port: str) -> int:
    """Run one session of a board with a host; return its exit code."""
    try:
        board = make_board(Line(host, int(port)))
    except (OSError, ValueError) as error:
        print(f"no host on {host}, port {port} ({error}): start it first", file=sys.stderr)
        return 2
    try:
        board.greet()
        board.serve()
    except Ended as end:
        code, sentence = end.args
        print(sentence, file=sys.stdout if code == 0 else sys.stderr)
        return code
    except OSError as error:
        print(f"the host went away without a goodbye ({error})", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
