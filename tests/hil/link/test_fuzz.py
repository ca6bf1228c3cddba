"""A live host and a live board under hostile packets: no traceback, no hang, little memory, and then a good run."""

import contextlib
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hil_loop import CAMERA, Instant
from hostile import Hostile, line

from flyaround.hil.board.agent import run_board
from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.errors import LinkClosed, LinkError, PacketError
from flyaround.hil.link.framing import cobs
from flyaround.hil.link.framing.cobs import CobsFraming
from flyaround.hil.link.framing.length_prefix import PREFIX, LengthFraming
from flyaround.hil.link.packets.images import chunks
from flyaround.hil.link.packets.messages import (
    Bye,
    Encoding,
    FrameHeader,
    Hello,
    HelloAck,
    PoseMessage,
    TimeSyncRequest,
    TruthPolicy,
    decode_message,
)
from flyaround.hil.link.packets.packet import PacketType
from flyaround.hil.link.session import Link, greet_host
from flyaround.hil.link.transports.tcp import TcpListener, connect_tcp
from flyaround.hil.link.transports.url import connect, parse_url

ROOT = Path(__file__).parents[3]
# the bound is 1 GB a process; a host with numpy and scipy takes some 150 MB, a board without OpenCV 50
MAX_BYTES = 600 << 20
PATIENCE_S = 60.0

# Frames until told to finish, then three more; few files, so that it runs out of them under many connections.
HOST = """
import resource, sys, threading
sys.path.insert(0, "tests/harness")
from hil_loop import frames
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.simulator.errors import UserError
finish = threading.Event()
threading.Thread(target=lambda: (sys.stdin.readline(), finish.set()), daemon=True).start()
def source():
    left = 3
    for frame in frames(10**6):
        if finish.is_set():
            left -= 1
        if left < 0:
            return
        yield frame
link = LinkConfig(url="tcp://127.0.0.1:0", mode="lockstep", truth="separate", timeout_s=60.0,
                  silence_s=10.0)
config = RunConfig(link=link, connect_timeout_s=120.0)
resource.setrlimit(resource.RLIMIT_NOFILE, (32, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
try:
    summary = run_host(source(), config, on_listening=lambda *urls: print(*urls, flush=True))
except UserError as error:
    print(error, flush=True)
    sys.exit(2)
print(summary.ended, summary.sent, summary.accepted, summary.link.protocol_mistakes, flush=True)
sys.exit(0 if summary.ended == "completed" else 1)
"""

# A session for each URL that it is told, one after the other.
BOARD = """
import sys
from flyaround.hil.board.agent import run_board
from flyaround.hil.link.errors import LinkError
class Oracle:
    accepted, reason, confidence, stages_ms = True, "", 0.5, {}
    q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)
    def __init__(self, camera): int(camera["width_px"])
    def estimate(self, image):
        assert image.shape == (48, 64)
        self.t_camera_from_target_m = (0.0, 0.0, float(image[0, 0]))
        return self
print("ready", flush=True)
for url in sys.stdin:
    if url.strip() == "end":
        break
    try:
        summary = run_board(url.strip(), make_estimator=Oracle, connect_timeout_s=20.0)
        print("goodbye" if summary.goodbye else "left", flush=True)
    except LinkError as error:
        print("refused", ascii(str(error)), flush=True)
"""


class Program:
    """A Python program that is talked to by lines; whatever it says wrong ends up in ``errors``."""

    def __init__(self, text, errors):
        self._errors = errors
        with errors.open("w") as file:
            self.process = subprocess.Popen(
                [sys.executable, "-c", text],
                cwd=ROOT,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=file,
                text=True,
            )

    def tell(self, words):
        self.process.stdin.write(words + "\n")
        self.process.stdin.flush()

    def hear(self):
        said = self.process.stdout.readline()
        assert said, f"the program ended: {self.errors()[-2000:]}"
        return said.strip()

    def errors(self):
        return self._errors.read_text()

    def peak_bytes(self):
        """Most memory that it or a process of its own ever had, so far; 0 where the system does not tell."""
        pids, most = [self.process.pid], 0
        for pid in pids:
            status = Path(f"/proc/{pid}/status")
            if not status.exists():
                continue
            pids += [int(k) for k in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
            fields = dict(row.split(":", 1) for row in status.read_text().splitlines() if ":" in row)
            most = max(most, int(fields["VmHWM"].split()[0]) << 10)
        return most


@contextlib.contextmanager
def running(text, tmp_path):
    program = Program(text, tmp_path / "errors.txt")
    try:
        yield program
    finally:
        program.process.kill()
        program.process.communicate()


def joined(url):
    """A session with the host, as soon as it has noticed that the last board left."""
    until = time.monotonic() + PATIENCE_S
    while True:
        link = Link(connect(url, 10.0))
        try:
            greet_host(link, Hello(window=2), 30.0)
        except LinkError:
            link.transport.close()
            assert time.monotonic() < until
            time.sleep(0.01)
        else:
            return link


def first_frame(link):
    """Until the host sends a frame: its id."""
    while True:
        heard = link.recv(PATIENCE_S)
        assert heard is not None
        if isinstance(heard, TimeSyncRequest):
            link.send(answer_time_sync(heard, now_ns()))
        elif isinstance(heard, FrameHeader):
            return heard.frame_id


def attack_host(url, hostile, how, n):
    """A connection with ``n`` hostile packets; how many it took before the host had enough of it."""
    hostile.session_id = hostile.frame_id = 0
    if how == "stranger":
        line_ = connect_tcp(*parse_url(url)[1:], 10.0)
    else:
        link = joined(url)
        line_, hostile.session_id = link.transport, link.session_id
        if how == "board in work":
            hostile.frame_id = first_frame(link)
    sent = 0
    with contextlib.suppress(LinkClosed):
        for _ in range(n):
            line_._write(hostile.bytes())
            sent += 1
            while line_._read(0.0):  # what it answers may not fill the line
                pass
    line_.close()
    return sent


def test_a_live_host_survives_and_ends_its_run_in_order(tmp_path):
    with running(HOST, tmp_path) as host:
        url, truth_url = host.hear().split()
        hostile, sent = Hostile(2022), 0
        # more than it takes, and more than it has files for; it turns them away for a while
        with contextlib.ExitStack() as stack:
            for port in (parse_url(url)[2], parse_url(truth_url)[2]) * 20:
                stack.enter_context(socket.create_connection(("127.0.0.1", port), 10.0))
            time.sleep(0.5)
        for k in range(60):
            how = ("stranger", "board", "board in work")[k % 3]
            sent += attack_host(url, hostile, how, 50)
            if k % 10 == 0:
                with (
                    contextlib.suppress(OSError),
                    socket.create_connection(parse_url(truth_url)[1:]) as logger,
                ):
                    logger.sendall(hostile.bytes())
        peak = host.peak_bytes()

        class FinishesAtTheThird(Instant):
            """Ends the run from its third frame on: one that was sent to an attacker is not among them."""

            frames = 0

            def estimate(self, image):
                self.frames += 1
                if self.frames == 3:
                    host.tell("finish")
                return super().estimate(image)

        for _ in range(300):  # the last attacker's leaving may be noticed a moment later
            try:
                summary = run_board(url, make_estimator=FinishesAtTheThird, silence_s=60.0)
                break
            except LinkError:
                time.sleep(0.1)
        assert summary.goodbye
        assert summary.accepted >= 3
        ended, *counts = host.hear().split()
        assert host.process.wait(PATIENCE_S) == 0, host.errors()[-2000:]
        assert ended == "completed"
        # most are heard out: only another version and a closed line end a connection early
        assert sent > 1500
        assert int(counts[2]) > 100
        assert "Traceback" not in host.errors()
        assert peak < MAX_BYTES


def fuzzing_host(listener):
    """The other side of a board that has just said HELLO."""
    transport = listener.accept(PATIENCE_S)
    assert transport is not None
    link = Link(transport, 77)
    assert isinstance(link.recv(PATIENCE_S), Hello)
    return link


def listen_in(link):
    """What the board has said by now."""
    heard = []
    while True:
        try:
            message = link.recv(0.0)
        except PacketError:
            continue
        if message is None:
            return heard
        heard.append(message)


def good_frame(frame_id):
    data = np.full((48, 64), frame_id % 256, np.uint8).tobytes()
    header = FrameHeader(
        frame_id, 64, 48, 8, Encoding.RAW, len(data), 1, 0.01, 0.0, 1, "2026-01-01T00:00:00Z"
    )
    return b"".join(line(message, 77) for message in (header, *chunks(frame_id, data, 1 << 18)))


def still_answers(link, frame_id):
    """Whether the board answers a good frame, after bytes that complete whatever was announced before."""
    link.transport._write(bytes((1 << 22) + 64))
    for k in range(frame_id, frame_id + 5):
        link.transport._write(good_frame(k))
        until = time.monotonic() + PATIENCE_S / 5
        while time.monotonic() < until:
            for message in listen_in(link):
                if isinstance(message, PoseMessage) and message.frame_id == k:
                    return message.t_camera_from_target_m[2] == k % 256
            time.sleep(0.001)
    return False


TERMS = HelloAck(CAMERA, 64, 48, encoding=Encoding.ZSTD, window=2)


def test_a_live_board_survives_and_answers_the_next_good_frame(tmp_path):
    ends = (PacketType.BYE, PacketType.ERROR)
    with running(BOARD, tmp_path) as board:
        assert board.hear() == "ready"
        listener, outcomes = TcpListener("127.0.0.1", 0), []
        for k in range(40):
            kind = ("in session", "in session", "handshake", "any end")[k % 4]
            hostile = Hostile(k, ends if kind == "in session" else ())
            hostile.session_id = 77
            board.tell(listener.url)
            link = fuzzing_host(listener)
            with contextlib.suppress(LinkClosed):
                if kind == "handshake":
                    # cameras first of all: once the terms are there nothing more of the kind is read
                    for n in range(20):
                        link.transport._write(hostile.bytes() if n % 2 else hostile.camera(k // 4 + n))
                        listen_in(link)
                else:
                    truth = (TruthPolicy.OFF, TruthPolicy.INLINE)[k % 2]
                    link.transport._write(line(HelloAck(**{**vars(TERMS), "truth": truth}), 77))
                    for n in range(80):
                        hostile.frame_id = 1000 * k + n
                        link.transport._write(hostile.bytes())
                        listen_in(link)
                    if kind == "in session":
                        assert still_answers(link, 1000 * k + 900)
                link.send(Bye("enough"))
            # a handshake may have had its end already; a board that hears nothing more leaves
            with contextlib.suppress(LinkError):
                listen_in(link)
            link.transport.close()
            outcomes.append(board.hear())
            if kind == "in session":
                assert outcomes[-1] == "goodbye"
        peak = board.peak_bytes()
        # and a session with a good host is one like any other
        board.tell(listener.url)
        link = fuzzing_host(listener)
        link.send(TERMS)
        assert still_answers(link, 5)
        link.send(Bye("enough"))
        assert board.hear() == "goodbye"
        link.transport.close()
        listener.close()
        board.tell("end")
        assert board.process.wait(PATIENCE_S) == 0
        assert "Traceback" not in board.errors()
        assert any(said.startswith("refused") for said in outcomes)
        assert peak < MAX_BYTES


@pytest.mark.parametrize("make", [LengthFraming, lambda: CobsFraming(pure=True)], ids=["length", "cobs"])
def test_nothing_but_a_packet_error_leaves_framing_and_messages(make):
    """More packets than a live line takes in the time, on each framing and with whatever cuts."""
    framing, hostile, read = make(), Hostile(7), 0
    on_serial = isinstance(framing, CobsFraming)
    for _ in range(800):
        data = hostile.bytes()
        if (
            on_serial
        ):  # the same packets without their length, stuffed; what was cut or made of garbage as it is
            data = b"\0" + cobs.encode(data[PREFIX.size :]) + b"\0"
        cut = hostile.rng.randrange(len(data) + 1)
        for part in (data[:cut], data[cut:]):
            framing.feed(part)
            while True:
                try:
                    packet = framing.next_packet()
                    if packet is None:
                        break
                    decode_message(packet)
                    read += 1
                except PacketError:
                    pass
        assert len(framing._buffer) < 6 << 20
    assert read > 30  # some mutants are as good as the original
