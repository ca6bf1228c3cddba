"""Attacks on a host with a key: strangers keep no board and no logger out, and nothing counts twice."""

import contextlib
import socket
import struct
import threading
import time

import pytest
from hil_loop import Instant, Loop, adds_up, board, frames

from flyaround.hil.host.truth.logger import TruthLogger
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.framing.length_prefix import LengthFraming
from flyaround.hil.link.packets.messages import Hello
from flyaround.hil.link.packets.packet import HEADER, MAGIC, PROTOCOL_VERSION, Packet, PacketType
from flyaround.hil.link.transports.url import parse_url

KEY = b"k" * 32
MANY = 300
slow = pytest.mark.slow
ASK = LengthFraming().encode(Packet(PacketType.AUTH_REQUEST, bytes(32)))


def address(url):
    return parse_url(url)[1:]


@contextlib.contextmanager
def strangers(url, count):
    """So many connections."""
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(socket.create_connection(address(url), 10.0)) for _ in range(count)]


def run_beside(attack, n=4, **options):
    """A run whose board comes while ``attack(url, truth url)`` goes on; how long the board took."""
    took = []

    def start(url):
        with contextlib.ExitStack() as stack:
            stack.enter_context(attack(url, loop.truth_url))
            begun = time.monotonic()
            board(Instant, key=KEY, connect_timeout_s=30.0)(url)
            took.append(time.monotonic() - begun)

    loop = Loop(start)
    summary = loop.run(frames(n), key=KEY, **options)
    assert (summary.accepted, summary.sent, summary.ended) == (n, n, "completed")
    return took[0]


@contextlib.contextmanager
def beside(work):
    """Do something again and again meanwhile."""
    over = threading.Event()

    def go_on():
        with contextlib.suppress(OSError):
            while not over.is_set():
                work()

    threads = [threading.Thread(target=go_on, daemon=True) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        over.set()
        for thread in threads:
            thread.join(5.0)


@contextlib.contextmanager
def half_open(url, _truth_url):
    """Hundreds that say nothing, and more of them all the time."""
    held = []

    def hold():
        held.append(socket.create_connection(address(url), 10.0))
        if len(held) > MANY:
            held.pop(0).close()

    try:
        with beside(hold):
            time.sleep(0.3)
            yield
    finally:
        for one in held:
            one.close()


@contextlib.contextmanager
def slow_loris(url, _truth_url):
    """A byte of a HELLO now and then, on more lines than the host keeps."""
    hello = LengthFraming().encode(Packet(PacketType.HELLO, Hello().encode()))
    with strangers(url, 20) as lines, beside(lambda: time.sleep(0.02)):
        for line in lines:
            with contextlib.suppress(OSError):
                line.sendall(hello[:30])
        yield


@contextlib.contextmanager
def asks_and_does_not_listen(url, _truth_url):
    """Requests of the handshake without end, whose answers nobody takes."""
    with strangers(url, 4) as lines:

        def ask():
            for line in lines:
                line.setblocking(False)
                with contextlib.suppress(BlockingIOError, ConnectionError):
                    line.send(ASK * 1000)
            time.sleep(0.001)

        with beside(ask):
            time.sleep(0.5)
            yield


@contextlib.contextmanager
def oversize(url, truth_url):
    """Lengths of gigabytes, and packets as long as the protocol allows that never end."""
    huge = struct.pack("<I", 0xFFFFFFF0) + HEADER.pack(MAGIC, PROTOCOL_VERSION, 1, 0, 0, 0, 0xFFFFFFD4)
    longest = struct.pack("<I", (1 << 22) + 28) + HEADER.pack(MAGIC, PROTOCOL_VERSION, 12, 0, 0, 0, 1 << 22)
    with strangers(url, 6) as lines, strangers(truth_url, 6) as loggers:
        for line in (*lines, *loggers):
            with contextlib.suppress(OSError):
                line.sendall(huge * 100 + longest + bytes(100_000))
        yield


@pytest.mark.parametrize(
    "attack",
    [asks_and_does_not_listen, *(pytest.param(a, marks=slow) for a in (half_open, slow_loris, oversize))],
)
def test_strangers_keep_no_board_out(attack):
    took = run_beside(attack, truth="separate")
    # a second or less where nothing else runs
    assert took < 20.0


def test_strangers_keep_no_logger_out(tmp_path):
    """Silent ones, as many as there are places, and others that ask without end."""

    def start(url):
        with strangers(loop.truth_url, 40) as lines:
            for line in lines[::2]:
                with contextlib.suppress(OSError):
                    line.sendall(ASK)
            time.sleep(0.1)
            logger = TruthLogger(loop.truth_url, tmp_path / "truth.jsonl", KEY)
            logger.start()
            loggers.append(logger)
            assert logger.wait_connected(30.0)
            time.sleep(0.3)
            board(Instant, key=KEY)(url)

    loggers = []
    loop = Loop(start)
    assert loop.run(frames(5), key=KEY, truth="separate").accepted == 5
    assert loggers[0].stop(60.0) == 5


def test_a_second_controller_is_refused_key_or_not_and_the_first_goes_on():
    said = []

    def second(url):
        time.sleep(0.3)
        for key in (KEY, None):
            with pytest.raises(LinkError) as caught:
                board(Instant, key=key, connect_timeout_s=10.0)(url)
            said.append(str(caught.value))

    summary = Loop(board(Instant, key=KEY), second).run(frames(30, every_s=0.05), key=KEY, mode="realtime")
    assert adds_up(summary)
    assert summary.link.sessions == 1
    # a newer frame takes the place of one that a busy machine holds up
    assert summary.dropped.keys() <= {"superseded"}
    assert summary.accepted >= 1
    assert len(said) == 2
    assert all("another board is connected" in sentence for sentence in said)
