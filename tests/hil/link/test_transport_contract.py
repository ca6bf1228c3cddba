"""One contract, every transport: in-process, TCP, and serial over a pair of pseudo-terminals; also with faults."""

import select
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from serial_line import null_modem
from virtual_line import virtual_pair

from flyaround.hil.host.faults.line_faults import FaultJournal, with_line_faults
from flyaround.hil.link.errors import LinkClosed, PacketError
from flyaround.hil.link.packets.enums import PIXEL_FORMATS
from flyaround.hil.link.packets.images import (
    FrameAssembler,
    chunk_count,
    chunks,
    encode_image,
    supported_encodings,
)
from flyaround.hil.link.packets.messages import (
    Bye,
    Encoding,
    FrameChunk,
    FrameHeader,
    HelloAck,
    decode_message,
)
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.security import HostTransport, prove_to_host
from flyaround.hil.link.transports.serial_port import SerialTransport
from flyaround.hil.link.transports.url import connect, listen
from flyaround.simulator.scenario.faults import (
    Bandwidth,
    Corrupt,
    Delay,
    Disconnect,
    Drop,
    Duplicate,
    Faults,
    Jitter,
    Reorder,
)

# quick enough that a test of a serial line is one of the protocol: 300 kB a second
BAUD = 3_000_000


def packet(k, data=b""):
    message = FrameChunk(k, 0, 0, data)
    return Packet(message.TYPE, message.encode(), 3, k)


@contextmanager
def virtual():
    yield virtual_pair()


@contextmanager
def virtual_cobs():
    yield virtual_pair(cobs=True)


@contextmanager
def tcp():
    listener = listen("tcp://127.0.0.1:0")
    a = connect(listener.url, 5.0)
    b = listener.accept(5.0)
    yield a, b
    a.close()
    b.close()
    listener.close()


@contextmanager
def serial():
    with null_modem() as (left, right):
        a, b = SerialTransport(left, BAUD), SerialTransport(right, BAUD, rtscts=True)
        yield a, b
        a.close()
        b.close()


@contextmanager
def sealed(line):
    """Another line's two ends once both have proved that they have the key."""
    with line() as (a, b):
        host = HostTransport(b, b"k" * 32)
        answering = threading.Thread(target=lambda: host.recv_packet(20.0))
        answering.start()
        board = prove_to_host(a, b"k" * 32)
        board.send_packet(packet(0))
        answering.join(20.0)
        yield board, host


LINES = {
    "virtual": virtual,
    "virtual cobs": virtual_cobs,
    "tcp": tcp,
    "serial": serial,
    "tcp sealed": lambda: sealed(tcp),
    "serial sealed": lambda: sealed(serial),
}
CONNECTED = [name for name in LINES if "serial" not in name]


@pytest.fixture(params=LINES.values(), ids=LINES.keys())
def line(request):
    with request.param() as ends:
        yield ends


def received(end, n, timeout_s=30.0):
    """The next n packets; damage on the way is passed over."""
    got = []
    while len(got) < n:
        try:
            one = end.recv_packet(timeout_s)
        except PacketError:
            continue
        assert one is not None
        got.append(one)
    return got


def on_and_on(what):
    """Do it for ten seconds."""
    until = time.monotonic() + 10.0
    while time.monotonic() < until:
        what()


def test_packets_arrive_in_order_both_ways(line):
    a, b = line
    for k in range(20):
        a.send_packet(packet(k, bytes([k]) * 50))
        b.send_packet(packet(100 + k))
    assert received(b, 20) == [packet(k, bytes([k]) * 50) for k in range(20)]
    assert [one.sequence for one in received(a, 20)] == list(range(100, 120))


@pytest.mark.parametrize("size", [1, 253, 254, 255, 1399, 1400, 4096, 65_536])
def test_every_size_of_chunk_arrives_whole(line, size):
    a, b = line
    data = np.random.default_rng(size).integers(0, 256, size, dtype=np.uint8).tobytes()
    sender = threading.Thread(target=a.send_packet, args=(packet(1, data),))
    sender.start()
    (got,) = received(b, 1)
    sender.join()
    assert decode_message(got).data == data
    assert b.recv_packet(0.0) is None


def test_timeout_returns_none_in_time(line):
    _, b = line
    start = time.monotonic()
    assert b.recv_packet(0.1) is None
    assert 0.08 < time.monotonic() - start < 8.0
    assert b.recv_packet(0.0) is None


def test_one_thread_sends_while_another_receives(line):
    a, b = line
    n, failed = 40, []

    def send(end, first):
        try:
            for k in range(n):
                end.send_packet(packet(first + k, bytes(1000)))
        except LinkClosed as error:
            failed.append(error)

    got = {}
    threads = [threading.Thread(target=send, args=(a, 0)), threading.Thread(target=send, args=(b, 1000))]
    threads.append(threading.Thread(target=lambda: got.update(a=received(a, n))))
    for thread in threads:
        thread.start()
    got["b"] = received(b, n)
    for thread in threads:
        thread.join(60.0)
    assert not failed
    assert [one.sequence for one in got["b"]] == list(range(n))
    assert [one.sequence for one in got["a"]] == list(range(1000, 1000 + n))


def test_damage_is_reported_and_costs_one_packet(line):
    a, b = line
    a.send_packet(packet(1, b"x" * 100))
    a.send_damaged(packet(2, b"x" * 100), 80, 0x10)
    a.send_packet(packet(3, b"x" * 100))
    got, damage = [], 0
    while 3 not in got:
        try:
            one = b.recv_packet(5.0)
        except PacketError:
            damage += 1
            continue
        assert one is not None
        got.append(one.sequence)
    assert (got, damage) == ([1, 3], 1)


@pytest.mark.parametrize(
    "make", [v for k, v in LINES.items() if "virtual" not in k], ids=[k for k in LINES if "virtual" not in k]
)
def test_what_to_wait_on_is_readable_when_a_packet_is_there(make):
    with make() as (a, b):
        assert not select.select([b], [], [], 0.02)[0]
        a.send_packet(packet(1))
        assert select.select([b], [], [], 5.0)[0]
        assert received(b, 1)[0].sequence == 1
        assert not select.select([b], [], [], 0.02)[0]


def test_closing_twice_and_using_afterwards(line):
    a, _ = line
    a.close()
    a.close()
    with pytest.raises(LinkClosed):
        a.send_packet(packet(1))
    with pytest.raises(LinkClosed):
        a.recv_packet(0.1)


@pytest.mark.parametrize("name", CONNECTED)
def test_the_other_side_leaving_is_noticed_after_its_last_words(name):
    with LINES[name]() as (a, b):
        for k in range(30):
            a.send_packet(packet(k, bytes(3000)))
        a.send_packet(Packet(PacketType.BYE, Bye("enough").encode()))
        a.close()
        assert len(received(b, 30)) == 30
        assert decode_message(b.recv_packet(20.0)) == Bye("enough")
        with pytest.raises(LinkClosed, match="clos"):
            b.recv_packet(5.0)
        with pytest.raises(LinkClosed):
            on_and_on(lambda: b.send_packet(packet(1, bytes(1000))))


# --- faults on purpose --------------------------------------------------------------------------

FAULTS = {
    "delay": Delay(delay_ms=20.0),
    "jitter": Jitter(most_ms=10.0),
    "bandwidth": Bandwidth(bytes_per_s=400_000.0),
    "drop": Drop(chance=0.2),
    "duplicate": Duplicate(chance=0.2),
    "reorder": Reorder(chance=0.2),
    "corrupt": Corrupt(chance=0.2),
}


@pytest.mark.parametrize("kind", FAULTS)
@pytest.mark.parametrize("name", LINES)
def test_under_faults_every_packet_is_whole_counted_and_of_those_sent(name, kind):
    fault, n = FAULTS[kind], 60
    with LINES[name]() as (a, b):
        journal = FaultJournal()
        near = with_line_faults(a, Faults(seed=1, line=(fault,)), journal)
        sent = [packet(k, bytes([k]) * 500) for k in range(n)]
        for one in sent:
            near.send_packet(one)
        near.send_packet(Packet(PacketType.BYE, Bye("end").encode(), 3, n))
        got, damage = [], 0
        while True:
            try:
                one = b.recv_packet(10.0)
            except PacketError:
                damage += 1
                continue
            assert one is not None
            if one.type is PacketType.BYE:
                break
            got.append(one)
        near.close()
        struck = sum(fault.name in journal.take(k) for k in range(n))
        numbers = [one.sequence for one in got]
        assert all(one == sent[one.sequence] for one in got)
        if kind in ("delay", "jitter", "bandwidth"):
            assert numbers == list(range(n))
        elif kind == "drop":
            assert numbers == sorted(set(numbers))
            assert len(got) + struck == n
        elif kind == "duplicate":
            assert len(got) == n + struck
            assert sorted(set(numbers)) == list(range(n))
        elif kind == "reorder":
            # the last one that is held may come after the goodbye
            assert set(range(n)) - set(numbers) <= {n - 1}
            assert numbers != sorted(numbers)
        else:
            assert len(got) == n - struck
            assert damage >= struck
        assert kind in ("delay", "jitter", "bandwidth") or struck > 0


@pytest.mark.parametrize("name", LINES)
def test_a_goodbye_reaches_the_board_before_its_line_is_closed(name):
    bye = Packet(PacketType.BYE, Bye("end").encode(), 3, 0)
    with LINES[name]() as (a, b):
        near = with_line_faults(a, Faults(line=(Delay(delay_ms=3000.0),)), FaultJournal())
        b.send_packet(packet(0))  # unread by the host when it leaves
        start_s = time.monotonic()
        near.send_packet(bye)
        near.close()
        assert b.recv_packet(5.0) == bye
        assert time.monotonic() - start_s < 2.0


@pytest.mark.parametrize("name", LINES)
def test_a_cut_line_ends_both_sides(name):
    header = FrameHeader(1, 8, 8, 8, Encoding.RAW, 64, 1, 0.01, 0.0, 1, "2026-01-01T00:00:00Z")
    with LINES[name]() as (a, b):
        near = with_line_faults(a, Faults(line=(Disconnect(),)), FaultJournal())
        near.send_packet(Packet(header.TYPE, header.encode(), 3, 0))
        with pytest.raises(LinkClosed):
            on_and_on(lambda: near.recv_packet(0.1))
        near.close()
        if "serial" not in name:  # a serial line has no connection to lose
            with pytest.raises(LinkClosed):
                on_and_on(lambda: b.recv_packet(0.1))


# --- pictures -----------------------------------------------------------------------------------


def picture(pixel_format, height=37, width=51):
    """An odd number of pixels, noise over a step, all numbers that the format holds."""
    top = 1 << pixel_format.depth_bits
    shape = (height, width) if pixel_format.channels == 1 else (height, width, 3)
    image = np.random.default_rng(5).integers(0, top, shape)
    image[: height // 2] = image[: height // 2] // 16 + np.arange(width).reshape(
        (-1, 1) if len(shape) == 3 else -1
    )
    image = np.clip(image, 0, top - 1)
    image[0, :2] = np.array([0, top - 1]).reshape((2, 1) if len(shape) == 3 else 2)
    return image.astype(np.uint16 if pixel_format.in_words else np.uint8)


@pytest.mark.parametrize("encoding", list(Encoding))
@pytest.mark.parametrize("pixel_format", PIXEL_FORMATS)
def test_each_format_arrives_byte_for_byte(line, pixel_format, encoding):
    assert supported_encodings() >> encoding & 1
    a, b = line
    image = picture(pixel_format)
    data = encode_image(image, encoding, pixel_format)
    count = chunk_count(len(data), 1000)
    height, width = image.shape[:2]
    bits = pixel_format.depth_bits
    terms = HelloAck({}, width, height, bits, encoding, pixel_format=pixel_format)
    header = FrameHeader(
        7, width, height, bits, encoding, len(data), count, 0.01, 0.0, 1, "2026", pixel_format
    )
    messages = [header, *chunks(7, data, 1000)]
    for k, message in enumerate(messages):
        a.send_packet(Packet(message.TYPE, message.encode(), 3, k))
    assembler, done = FrameAssembler(terms), None
    for one in received(b, len(messages)):
        message = decode_message(one)
        done = assembler.header(message) if isinstance(message, FrameHeader) else assembler.chunk(message)
    assert done is not None
    assert done[0] == header
    assert done[1].dtype == image.dtype
    assert done[1].tobytes() == image.tobytes()
