"""One contract, every transport: in-process, TCP, and serial over a pair of pseudo-terminals."""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from contextlib import contextmanager

import pytest
from serial_line import null_modem

from hil.link.errors import LinkClosed, LinkError, PacketError
from hil.link.packets.messages import Bye, FrameChunk, decode_message
from hil.link.packets.packet import Packet, PacketType
from hil.link.transports.in_process import virtual_pair
from hil.link.transports.serial_port import SerialTransport
from hil.link.transports.tcp import TcpTransport
from hil.link.transports.url import connect, listen, parse_url


def packet(k: int, data: bytes = b"") -> Packet:
    message = FrameChunk(k, 0, 0, data)
    return Packet(message.TYPE, message.encode(), 3, k)


@contextmanager
def virtual():
    a, b = virtual_pair()
    yield a, b, a.inject


@contextmanager
def virtual_cobs():
    a, b = virtual_pair(cobs=True)
    yield a, b, a.inject


@contextmanager
def tcp():
    listener = listen("tcp://127.0.0.1:0")
    a = connect(listener.url, 5.0)
    b = listener.accept(5.0)
    yield a, b, a._write
    a.close()
    b.close()
    listener.close()


@contextmanager
def serial():
    with null_modem() as (left, right):
        a, b = SerialTransport(left, 921600), SerialTransport(right, 921600)
        yield a, b, a._write
        a.close()
        b.close()


LINES = {"virtual": virtual, "virtual cobs": virtual_cobs, "tcp": tcp, "serial": serial}


@pytest.fixture(params=LINES.values(), ids=LINES.keys())
def line(request):
    with request.param() as ends:
        yield ends


def test_packets_arrive_in_order_both_ways(line):
    a, b, _ = line
    for k in range(20):
        a.send_packet(packet(k, bytes([k]) * 50))
        b.send_packet(packet(100 + k))
    assert [b.recv_packet(5.0) for _ in range(20)] == [packet(k, bytes([k]) * 50) for k in range(20)]
    assert [a.recv_packet(5.0).sequence for _ in range(20)] == list(range(100, 120))


def test_a_large_packet_of_zeros_and_noise(line):
    a, b, _ = line
    data = bytes(20_000) + os.urandom(20_000)
    sender = threading.Thread(target=a.send_packet, args=(packet(1, data),))
    sender.start()
    got = b.recv_packet(10.0)
    sender.join()
    assert decode_message(got).data == data


def test_timeout_returns_none_in_time(line):
    _, b, _ = line
    start = time.monotonic()
    assert b.recv_packet(0.1) is None
    assert 0.08 < time.monotonic() - start < 2.0
    assert b.recv_packet(0.0) is None


def test_garbage_is_reported_and_survived(line):
    a, b, inject = line
    inject(b"\x11" * 100 + b"\0")
    a.send_packet(packet(1))
    a.send_packet(packet(2))
    got, damage = [], 0
    while 2 not in got:
        try:
            received = b.recv_packet(2.0)
        except PacketError:
            damage += 1
            continue
        assert received is not None
        got.append(received.sequence)
    assert damage >= 1
    assert set(got) <= {1, 2}


def test_closing_twice_and_using_afterwards(line):
    a, _, _ = line
    a.close()
    a.close()
    with pytest.raises(LinkClosed):
        a.send_packet(packet(1))
    with pytest.raises(LinkClosed):
        a.recv_packet(0.1)


@pytest.mark.parametrize("make", [virtual, tcp], ids=["virtual", "tcp"])
def test_the_other_side_leaving_is_noticed_after_its_last_words(make):
    with make() as (a, b, _):
        a.send_packet(Packet(PacketType.BYE, Bye("enough").encode()))
        a.close()
        assert decode_message(b.recv_packet(2.0)) == Bye("enough")
        with pytest.raises(LinkClosed, match="clos"):
            b.recv_packet(2.0)


def test_a_peer_that_does_not_read_is_given_up():
    server = socket.create_server(("127.0.0.1", 0))
    client = socket.create_connection(server.getsockname())
    peer, _ = server.accept()
    a = TcpTransport(client, "tcp://test", send_stall_s=0.2)

    def flood() -> None:
        for _ in range(200):
            a.send_packet(packet(1, bytes(1 << 18)))

    with pytest.raises(LinkClosed, match=r"took no byte for 0\.2 s"):
        flood()
    a.close()
    for sock in (peer, server):
        sock.close()


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("udp://127.0.0.1:5600", "unknown scheme: write tcp://HOST:PORT"),
        ("127.0.0.1:5600", "unknown scheme"),
        ("tcp://127.0.0.1", "lacks host or port"),
        ("tcp://127.0.0.1:99999", "bad number"),
        ("tcp://127.0.0.1:abc", "bad number"),
        ("serial://", "lacks a device"),
        ("serial:///dev/ttyS0?baud=fast", "bad number"),
        ("serial:///dev/ttyS0?baud=0", "lacks a device or baud rate"),
    ],
)
def test_bad_urls_are_one_sentence(url, sentence):
    with pytest.raises(LinkError, match=sentence) as caught:
        parse_url(url)
    assert "\n" not in str(caught.value)
    assert repr(url) in str(caught.value)


def test_good_urls():
    assert parse_url("tcp://localhost:5600") == ("tcp", "localhost", 5600)
    assert parse_url("tcp://[::1]:5600") == ("tcp", "::1", 5600)
    assert parse_url("serial:///dev/ttyUSB0?baud=921600") == ("serial", "/dev/ttyUSB0", 921600)


def test_port_in_use_and_nobody_there():
    listener = listen("tcp://127.0.0.1:0")
    with pytest.raises(LinkError, match="is in use by another program: stop it, or choose another port"):
        listen(listener.url)
    url = listener.url
    listener.close()
    with pytest.raises(LinkError, match=r"nobody listens on tcp://127\.0\.0\.1:\d+ .*start the other side"):
        connect(url, 0.2)


def test_no_such_serial_port():
    with pytest.raises(LinkError, match="/dev/nonesuch at 115200 baud cannot be opened"):
        connect("serial:///dev/nonesuch?baud=115200")


@pytest.mark.skipif(sys.platform == "win32", reason="needs a limit of open files")
def test_a_listener_that_cannot_be_made_leaves_no_socket() -> None:
    import resource

    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    next_one = os.dup(0)
    os.close(next_one)
    try:
        # room for the socket alone
        resource.setrlimit(resource.RLIMIT_NOFILE, (next_one + 1, limits[1]))
        with pytest.raises(LinkError, match="Too many open files"):
            listen("tcp://127.0.0.1:0")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    after = os.dup(0)
    os.close(after)
    assert after == next_one
