"""What UDP alone has: loss, who is let in, what is allocated for whom, silence, and a host that was started again."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
import tracemalloc

import numpy as np
import pytest
from lossy_udp import lossy_network

from flyaround.hil.link.errors import LinkClosed, LinkError, PacketError
from flyaround.hil.link.framing.datagrams import (
    ACK,
    DATA,
    GIVE_UP_NS,
    OPEN,
    RANGE,
    SPAN,
    Incoming,
    Kind,
    Outgoing,
    datagram,
    split_datagram,
)
from flyaround.hil.link.packets.messages import FrameChunk
from flyaround.hil.link.packets.packet import Packet
from flyaround.hil.link.transports import udp_peer
from flyaround.hil.link.transports.udp import MOST_PEERS, UdpListener, connect_udp
from flyaround.hil.link.transports.url import connect, listen, parse_url


def packet(k: int, data: bytes) -> Packet:
    return Packet(FrameChunk.TYPE, FrameChunk(k, 0, 0, data).encode(), 3, k)


@pytest.mark.parametrize(("loss", "swap"), [(0.01, 0.0), (0.05, 0.1)])
def test_with_loss_and_reordering_every_frame_comes_once_in_order(loss, swap):
    listener = listen("udp://127.0.0.1:0")
    data = np.random.default_rng(3).integers(0, 256, 60_000, dtype=np.uint8).tobytes()
    n = 60
    with lossy_network(parse_url(listener.url)[2], loss=loss, swap=swap, double=0.02) as (url, counts):
        board = connect(url, 5.0)
        host = listener.accept(20.0)
        sender = threading.Thread(target=lambda: [host.send_packet(packet(k, data)) for k in range(n)])
        sender.start()
        got, lost = [], 0
        while len(got) + lost < n:
            try:
                one = board.recv_packet(10.0)
            except PacketError:
                lost += 1
                continue
            assert one is not None
            got.append(one)
        sender.join()
        assert [one.sequence for one in got] == sorted(one.sequence for one in got)
        assert all(one == packet(one.sequence, data) for one in got)
        assert (lost, len(got)) == (0, n)
        assert counts["lost"] > 10
        assert host.outgoing.resent >= counts["lost"] // 4
        board.close()
        host.close()
        listener.close()


def test_what_is_lost_for_good_is_told_and_the_next_packet_comes():
    out, into = Outgoing(1, 576), Incoming()
    for k in range(3):
        out.push(bytes([k]) * 2000)
    sent = []
    while (data := out.next_to_send()) is not None:
        out.has_sent(0)
        sent.append(split_datagram(data)[2])
    per_packet = len(sent) // 3
    for k, body in enumerate(sent):
        if k != per_packet + 1:
            number, index, count = DATA.unpack_from(body)
            into.add(number, index, count, bytes(body[DATA.size :]), 0)
    assert into.pop() == bytes(2000)
    assert into.pop() is None
    assert into.missing() == [(per_packet + 1, per_packet + 1)]
    assert not into.give_up(GIVE_UP_NS - 1)
    assert into.give_up(GIVE_UP_NS)
    assert isinstance(into.pop(), PacketError)
    assert into.pop() == b"\2" * 2000
    assert (into.held, into.has_gap) == (0, False)


def test_only_what_is_missing_and_not_on_its_way_is_sent_again():
    out = Outgoing(1, 576)
    out.push(bytes(3000))
    times = iter(range(100))
    while out.next_to_send() is not None:
        out.has_sent(next(times))
    progress, again = out.acknowledged(1, 2, [(1, 2), (5, 5)], 10, 6)
    assert progress
    assert [DATA.unpack_from(split_datagram(d)[2])[0] for d in again] == [1, 2]
    assert out.acknowledged(1, 2, [(1, 2)], 11, 6) == (False, [])
    # an answer that claims what was never sent is no answer
    assert out.acknowledged(99, 0, [], 12, 6) == (False, [])


def test_a_receiver_keeps_a_bounded_part_of_what_comes_before_its_turn():
    into = Incoming()
    tracemalloc.start()
    for number in range(1, 200_000):
        into.add(number, 0, 2, bytes(500), 0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert into.held == SPAN - 1
    assert peak < 8 << 20
    # and of packets that nobody takes
    into = Incoming()
    for number in range(300_000):
        into.add(number, 0, 1, b"x", 0)
    assert len(into.ready) < 100_000


def test_nothing_is_kept_for_an_address_that_does_not_answer():
    listener = listen("udp://127.0.0.1:0")
    port = parse_url(listener.url)[2]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.settimeout(20.0)
        for nonce in range(1, 200):
            opening = datagram(Kind.OPEN, 0, OPEN.pack(nonce, 0))
            stranger.sendto(opening, ("127.0.0.1", port))
            answer = stranger.recv(2000)
            assert split_datagram(answer)[0] is Kind.COOKIE
            assert len(answer) <= len(opening)
        # a cookie of another nonce, or of another address, opens nothing
        cookie = OPEN.unpack(split_datagram(answer)[2])[1]
        stranger.sendto(datagram(Kind.OPEN, 0, OPEN.pack(5, cookie)), ("127.0.0.1", port))
        assert split_datagram(stranger.recv(2000))[0] is Kind.COOKIE
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.settimeout(20.0)
            other.sendto(datagram(Kind.OPEN, 0, OPEN.pack(199, cookie)), ("127.0.0.1", port))
            assert split_datagram(other.recv(2000))[0] is Kind.COOKIE
        assert listener.accept(0.05) is None
        assert listener._endpoint._peers == {}
    listener.close()


def test_peers_are_bounded_and_garbage_changes_nothing():
    listener = listen("udp://127.0.0.1:0")
    port = parse_url(listener.url)[2]
    boards = [connect_udp("127.0.0.1", port, 20.0) for _ in range(MOST_PEERS)]
    with pytest.raises(LinkError, match="nobody listens"):
        connect_udp("127.0.0.1", port, 0.3)
    hosts = [listener.accept(20.0) for _ in range(MOST_PEERS)]
    rng = np.random.default_rng(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        for size in range(200):
            stranger.sendto(rng.bytes(size), ("127.0.0.1", port))
            body = rng.bytes(size)
            stranger.sendto(datagram(Kind(1 + size % 7), hosts[0].token, body), ("127.0.0.1", port))
    for board, host in zip(boards, hosts, strict=True):
        board.send_packet(packet(1, b"still here"))
        assert host.recv_packet(20.0) == packet(1, b"still here")
        board.close()
        host.close()
    listener.close()


def test_a_peer_that_says_nothing_more_is_given_up(monkeypatch):
    monkeypatch.setattr(udp_peer, "SILENCE_S", 0.4)
    listener = listen("udp://127.0.0.1:0")
    with lossy_network(parse_url(listener.url)[2]) as (url, _):
        board = connect(url, 5.0)
        host = listener.accept(20.0)
        board.send_packet(packet(1, b"x"))
        assert host.recv_packet(20.0) is not None
    # the network is gone
    for end in (host, board):
        with pytest.raises(LinkClosed, match=r"said nothing for|went away|closed"):
            end.recv_packet(10.0)
        end.close()
    listener.close()


def test_a_host_that_was_started_again_ends_the_old_session_at_once():
    listener = listen("udp://127.0.0.1:0")
    port = parse_url(listener.url)[2]
    board = connect(listener.url, 5.0)
    host = listener.accept(20.0)
    # killed: nothing is said any more
    endpoint = listener._endpoint
    with endpoint.changed:
        endpoint._peers.clear()
    start = time.monotonic()
    with pytest.raises(LinkClosed, match="closed the connection"):
        board.recv_packet(40.0)
    assert (
        time.monotonic() - start < 20.0
    )  # a ping each quarter of a second, before the silence of a minute counts
    board.close()
    host.closed_by_us = True
    host._bell.close()
    listener.close()
    assert port


def test_nobody_there_and_bad_sizes_are_one_sentence():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        with pytest.raises(LinkError, match=r"cannot listen on udp://127\.0\.0\.1"):
            UdpListener("127.0.0.1", port)
    with pytest.raises(LinkError, match=rf"nobody listens on udp://127.0.0.1:{port} .*start the other side"):
        connect(f"udp://127.0.0.1:{port}", 0.2)
    with pytest.raises(LinkError, match="datagrams of 100 bytes cannot be sent: choose 576"):
        connect(f"udp://127.0.0.1:{port}?datagram=100", 0.2)
    with pytest.raises(LinkError, match="unknown option 'jumbo': udp knows datagram"):
        parse_url("udp://127.0.0.1:5600?jumbo=1")
    with contextlib.suppress(struct.error):
        assert split_datagram(b"") is None


class Quiet:
    """An endpoint whose datagrams go nowhere."""

    window_bytes = 1 << 16

    def __init__(self):
        self.changed = threading.Condition()

    def send(self, _data, _peer):
        return True

    def wake(self):
        pass

    has_left = wake


def test_round_trips_are_smoothed_by_eighths():
    """RFC 6298's average: a stray long trip counts little, a lasting one counts; an answer has four trips of time."""
    endpoint = Quiet()
    peer = udp_peer.UdpTransport(endpoint, "a test", ("127.0.0.1", 9), 1, 1400)
    smoothed, now = 3e6, time.monotonic_ns()
    peer.outgoing.push(b"first")
    for k, trip_ms in enumerate((80, 1, 1, 1, *[55] * 30, 1500, *[20] * 30)):
        now += 10_000_000_000  # each on its own
        peer.outgoing.push(b"next")
        # one more came, the newest did not
        told = ACK.pack(k + 1, 0, 1 << 16, now - trip_ms * 10**6, 0)
        with endpoint.changed:
            peer.flush(now)
            peer.take(Kind.ACK, memoryview(told), now)
            again_ns = peer.tick(now) - now
        # a trip of seconds is that of a machine that stood still: it counts as one
        smoothed += (min(trip_ms, 1000) * 1e6 - smoothed) / 8
        # nanoseconds are whole
        assert again_ns == pytest.approx(min(max(20e6, 4 * smoothed), 250e6), abs=100)
    # the long one has gone again: (7/8)^30 is a fiftieth
    assert smoothed == pytest.approx(20e6, rel=0.2)
    peer.close()


def test_nothing_is_sent_again_before_two_round_trips():
    """What is younger may still be on its way; of a line that is not known yet, the time of a reordering."""
    endpoint = Quiet()
    peer = udp_peer.UdpTransport(endpoint, "a test", ("127.0.0.1", 9), 1, 1400)
    now, trip_ns = time.monotonic_ns(), 50_000_000
    with endpoint.changed:
        for part in (b"lost", b"held"):
            peer.outgoing.push(part)
        peer.flush(now)
        for _ in range(100):  # round trips alone: nothing is wanted
            peer.take(Kind.ACK, memoryview(ACK.pack(0, 0, 1 << 16, now - trip_ns, 0)), now)
        gap = ACK.pack(0, 1, 1 << 16, 0, 1) + RANGE.pack(0, 0)
        resent = []
        for after_ns in (1.9 * trip_ns, 2.1 * trip_ns, 3.9 * trip_ns, 4.3 * trip_ns):
            peer.take(Kind.ACK, memoryview(gap), now + int(after_ns))
            resent.append(peer.outgoing.resent)
    assert resent == [0, 1, 1, 2]
    peer.close()
