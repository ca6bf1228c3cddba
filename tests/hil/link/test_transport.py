"""What one transport alone has: URLs, ports that are taken, a peer that does not read."""

import math
import os
import socket
import sys
import threading
import time

import pytest
from serial_line import null_modem

from flyaround.hil.link.errors import LinkClosed, LinkError
from flyaround.hil.link.packets.messages import FrameChunk
from flyaround.hil.link.packets.packet import Packet
from flyaround.hil.link.transports.serial_port import SerialTransport
from flyaround.hil.link.transports.tcp import TcpTransport
from flyaround.hil.link.transports.url import connect, listen, parse_url, url_options


def packet(k, data=b""):
    message = FrameChunk(k, 0, 0, data)
    return Packet(message.TYPE, message.encode(), 3, k)


def test_a_peer_that_does_not_read_is_given_up():
    server = socket.create_server(("127.0.0.1", 0))
    client = socket.create_connection(server.getsockname())
    peer, _ = server.accept()
    a = TcpTransport(client, "tcp://test", send_stall_s=0.2)

    def flood():
        for _ in range(200):
            a.send_packet(packet(1, bytes(1 << 18)))

    with pytest.raises(LinkClosed, match=r"accepted no byte for 0\.2 s"):
        flood()
    a.close()
    for sock in (peer, server):
        sock.close()


def test_a_slow_peer_is_waited_for_as_long_as_the_session_says():
    server = socket.create_server(("127.0.0.1", 0))
    client = socket.create_connection(server.getsockname())
    peer, _ = server.accept()
    a = TcpTransport(client, "tcp://test", send_stall_s=0.2)
    a.set_silence_limit(20.0)

    def read_late():
        time.sleep(0.6)
        while peer.recv(1 << 20):
            pass

    reader = threading.Thread(target=read_late)
    reader.start()
    for _ in range(100):  # more than both systems hold
        a.send_packet(packet(1, bytes(1 << 18)))
    a.close()
    reader.join()
    for sock in (peer, server):
        sock.close()


@pytest.mark.parametrize(
    ("url", "sentence"),
    [
        ("gige://eth0", "unknown scheme: write tcp://HOST:PORT or serial"),
        (
            "udp://10.0.0.2:5600?datagram=8900",
            "names UDP, which boards no longer use: write tcp://10.0.0.2:5600$",
        ),
        ("tcp://127.0.0.1:5600?datagram=9000", "unknown option 'datagram': tcp knows none"),
        ("serial:///dev/ttyS0?rtscts=yes", "rtscts=yes, allowed: 0 or 1"),
        ("serial:///dev/ttyS0?rtscts=7", "rtscts=7, allowed: 0 or 1"),
        ("serial:///dev/ttyS0?baud=9600&baud=115200", "'baud' 2 times"),
        ("serial://dev/ttyUSB0", "has a host, 'dev': a device has three slashes"),
        ("serial:///", "lacks a device"),
        ("tcp://[::1", "bad number or address"),
        ("tcp://h\u2100:5600", "bad number or address"),
        ("udp://[", "bad number or address"),
        ("tcp://h:5600/path", "more than host and port"),
        ("tcp://user:word@h:5600", "more than host and port"),
        ("tcp://h:5600#x", "has a fragment, #x"),
        ("127.0.0.1:5600", "unknown scheme"),
        ("tcp://127.0.0.1", "lacks host or port"),
        ("tcp://127.0.0.1:99999", "bad number"),
        ("tcp://127.0.0.1:abc", "bad number"),
        ("serial://", "lacks a device"),
        ("serial:///dev/ttyS0?baud=fast", "bad number"),
        ("serial:///dev/ttyS0?baud=0", "lacks a device or baud rate"),
        ("serial:///dev/ttyS0?baud=99999999999", "lacks a device or baud rate"),
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
    assert url_options("serial:///dev/ttyS0?baud=9600&rtscts=1") == {"baud": 9600, "rtscts": 1}
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
def test_a_listener_that_cannot_be_made_leaves_no_socket():
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


def test_a_serial_line_is_written_at_its_own_rate():
    """Bytes against the clock: never faster than 115,200 baud carry them, and at best hardly slower."""
    shares = []
    with null_modem() as (left, right):
        a, b = SerialTransport(left, 115200), SerialTransport(right, 115200)
        for k in range(4):
            message = packet(k, os.urandom(6000))
            size = len(a._framing.encode(message))
            start = time.monotonic()
            a.send_packet(message)
            assert b.recv_packet(5.0) == message
            shares.append(size * 10 / 115200 / (time.monotonic() - start))
        a.close()
        b.close()
    # the last piece of each is given to the line at once
    assert all(share < 1.1 for share in shares)
    # half a second each: a busy machine adds tens of milliseconds to it
    assert max(shares) > 0.8


@pytest.mark.parametrize("timeout_s", [math.nan, math.inf, -1.0])
def test_a_time_to_connect_that_never_ends_is_refused(timeout_s):
    with pytest.raises(LinkError, match="the time to connect is"):
        connect("tcp://127.0.0.1:9", timeout_s)
