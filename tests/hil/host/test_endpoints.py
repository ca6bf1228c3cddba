"""Who may connect, how many, for how long: the truth endpoint, the frame endpoint, and running out of files."""

import contextlib
import os
import resource
import select
import socket
import time
from contextlib import contextmanager

import pytest
from hil_loop import Loop, adds_up, frames, good_pose, greeted, serve_by_hand

from flyaround.hil.host.camera_endpoint.answer_port import BUSY, AnswerPort
from flyaround.hil.host.camera_endpoint.messages import AnswerTerms
from flyaround.hil.host.link_process import pending
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.link_process.pending import MAX_PENDING, PendingLinks
from flyaround.hil.host.truth import endpoint as truth_endpoint
from flyaround.hil.host.truth.endpoint import MAX_CLIENTS, TruthEndpoint
from flyaround.hil.host.truth.logger import TruthLogger
from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.errors import LinkClosed
from flyaround.hil.link.framing.length_prefix import LengthFraming
from flyaround.hil.link.packets.messages import (
    Bye,
    ErrorCode,
    ErrorMessage,
    FrameChunk,
    FrameHeader,
    Hello,
    HelloAck,
    PoseMessage,
    TimeSyncRequest,
    TruthMessage,
)
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.session import Link, greet_host
from flyaround.hil.link.transports.tcp import TcpListener, connect_tcp
from flyaround.hil.link.transports.url import connect, parse_url

TRUTH = {"note": "x" * 50_000}


def knock(url):
    return socket.create_connection(parse_url(url)[1:], 5.0)


@contextmanager
def endpoint():
    end = TruthEndpoint("tcp://127.0.0.1:0", "tcp://127.0.0.1:5600")
    clients = []

    def client():
        clients.append(connect_tcp(*parse_url(end.url)[1:], 5.0))
        time.sleep(0.01)
        end.accept()
        return clients[-1]

    try:
        yield end, client
    finally:
        end.close()
        for one in clients:
            one.close()


def message(transport):
    """The next one, None where the line was closed."""
    try:
        return Link(transport).recv(5.0)
    except LinkClosed:
        return None


def test_more_loggers_than_the_limit_are_turned_away_and_make_room_by_leaving():
    with endpoint() as (end, client):
        first, *others = [client() for _ in range(MAX_CLIENTS)]
        assert message(client()) == ErrorMessage(
            ErrorCode.BUSY, f"{MAX_CLIENTS} loggers are connected already: stop one first"
        )
        # one that left without a word is found out when its place is needed
        others.pop().close()
        time.sleep(0.01)
        late = client()
        end.publish(3, {"a": 1})
        for one in (first, *others, late):
            assert message(one) == TruthMessage(3, {"a": 1})
        assert message(client()).code == ErrorCode.BUSY
        assert len(end._clients) == MAX_CLIENTS


def test_a_logger_that_is_turned_away_says_so(tmp_path, caplog):
    with endpoint() as (end, client):
        for _ in range(MAX_CLIENTS):
            client()
        logger = TruthLogger(end.url, tmp_path / "truth.jsonl")
        logger.start()
        assert logger.wait_connected(10.0)
        time.sleep(0.05)
        end.accept()
        assert logger.stop(5.0) == 0
    assert "no truth is logged: 16 loggers are connected already" in caplog.text


@pytest.mark.parametrize("limit", ["bytes", "time"])
def test_a_logger_that_does_not_read_is_dropped_and_the_others_hear_on(limit, monkeypatch):
    if limit == "time":
        monkeypatch.setattr(truth_endpoint, "MAX_LAG_NS", 200_000_000)
    with endpoint() as (end, client):
        good, deaf = client(), client()
        sent, until = 0, time.monotonic() + 20.0
        while len(end._clients) == 2 and time.monotonic() < until:
            # enough to fill what the system keeps for it, and what the endpoint does
            if limit == "bytes" or not end.lagging:
                end.publish(sent, TRUTH)
                assert message(good) == TruthMessage(sent, TRUTH)
                sent += 1
            else:
                time.sleep(0.01)
                end.flush()
        assert len(end._clients) == 1
        end.publish(sent, TRUTH)
        assert message(good) == TruthMessage(sent, TRUTH)
        assert not end.lagging
        deaf.close()


def test_the_goodbye_waits_for_all_loggers_together(monkeypatch):
    monkeypatch.setattr(truth_endpoint, "CLOSE_S", 2.0)
    with endpoint() as (end, client):
        for _ in range(6):
            client()
        for k in range(200):
            end.publish(k, TRUTH)
            if all(one.backlog for one in end._clients):
                break
        assert end.lagging
        start = time.monotonic()
    # one after another they would take six times as long as one
    assert time.monotonic() - start < 11.0


def test_a_board_at_the_truth_is_known_by_a_magic_in_two_pieces():
    with endpoint() as (end, client):
        one = client()
        for piece in (b"\0\0\0\0FL", b"YA"):
            one._sock.send(piece)
            time.sleep(0.02)
            end.flush()
        assert "connect the board to tcp://127.0.0.1:5600" in message(one).text


@contextmanager
def no_more_files():
    """Every descriptor that this process may have is taken."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    free = os.dup(0)
    os.close(free)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free, hard))
    try:
        with pytest.raises(OSError, match="Too many open files"):
            os.dup(0)
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_accept_survives_running_out_of_files_and_turns_away_who_waits():
    listener = TcpListener("127.0.0.1", 0)
    waiting = [knock(listener.url) for _ in range(3)]
    with no_more_files():
        assert [listener.accept(1.0) for _ in range(3)] == [None] * 3
        # nobody is left waiting, so that who polls the listener is not told of it for ever
        assert listener.accept(0.0) is None
    for one in waiting:
        with contextlib.suppress(ConnectionResetError):
            assert one.recv(1) == b""
        one.close()
    with knock(listener.url):
        line = listener.accept(5.0)
        assert line is not None
        line.close()
    listener.close()


@contextmanager
def pending_links():
    listener, gone = TcpListener("127.0.0.1", 0), []
    links, clients = PendingLinks(gone.append), []

    def client():
        clients.append(connect(listener.url, 5.0))
        links.add(listener.accept(5.0))
        return Link(clients[-1])

    yield links, client, gone
    links.refuse_all("the test is over")
    for one in clients:
        one.close()
    listener.close()


def ready(links):
    time.sleep(0.02)
    return links.transports


def test_two_boards_that_greet_a_camera_at_once_both_have_an_answer():
    link = LinkConfig(url="tcp://127.0.0.1:0", mode="realtime", truth="off", timeout_s=5.0)
    port = AnswerPort(AnswerTerms(link, HelloAck({}, 64, 64)), lambda _row: None, lambda _sentence: None)

    def step():
        time.sleep(0.05)
        port.step(select.select(port.sources, [], [], 5.0)[0])

    first = Link(connect(port.url, 5.0))
    step()
    second = Link(connect(port.url, 5.0))
    for board in (first, second):
        board.send(Hello())
    step()
    assert isinstance(first.recv(5.0), HelloAck)
    assert second.recv(5.0) == ErrorMessage(ErrorCode.BUSY, BUSY)
    for end in (port, first, second):
        end.close()


def test_the_first_to_say_hello_is_the_board_whoever_came_before():
    with pending_links() as (links, client, gone):
        silent, talks, late = client(), client(), client()
        talks.send(Bye("no hello"))
        talks.transport._write(b"GET / HTTP/1.1\r\n\r\n" * 4)
        assert links.receive_hello(ready(links)) is None
        late.send(Hello(board="mine"))
        link, hello = links.receive_hello(ready(links))
        assert hello.board == "mine"
        assert len(links) == 2
        links.refuse_all("another board is connected")
        assert silent.recv(5.0) == ErrorMessage(ErrorCode.BUSY, "another board is connected")
        assert gone == []
        link.transport.close()


def test_connections_that_say_nothing_are_few_and_closed_in_time():
    with pending_links() as (links, client, gone):
        start = now_ns()
        oldest = client()
        for _ in range(MAX_PENDING):
            client()
        assert "while others connected: send HELLO at once" in oldest.recv(5.0).text
        assert start < links.first_deadline_ns - pending.HELLO_TIMEOUT_NS <= now_ns()
        links.expire(links.first_deadline_ns - 1)
        assert len(links) == MAX_PENDING
        links.expire(now_ns() + pending.HELLO_TIMEOUT_NS)
        assert (len(links), len(gone)) == (0, MAX_PENDING + 1)
        assert gone[1] == "it sent no packet of the link protocol"
        assert links.first_deadline_ns is None


def test_a_hello_that_cannot_be_read_is_refused_with_a_sentence():
    with pending_links() as (links, client, gone):
        one = client()
        bad = Hello(board="x").encode()[:-1]
        one.transport.send_packet(Packet(PacketType.HELLO, bad))
        assert links.receive_hello(ready(links)) is None
        assert one.recv(5.0) == ErrorMessage(ErrorCode.FORMAT, "a HELLO payload has 199 bytes, expected 200")
        assert len(links) == 0
        assert "199 bytes" in gone[0]


# --- whole runs --------------------------------------------------------------------------------


def hand_made(answer):
    """A board of another make: ``answer(frame id)`` gives the payload of its POSE; it never sends CREDIT."""

    def start(url):
        link = greeted(url)
        return serve_by_hand(link, lambda m: isinstance(m, FrameChunk) and link.send(answer(m.frame_id)))

    return start


def test_credit_may_be_left_out_for_frames_that_are_answered():
    loop = Loop(hand_made(good_pose))
    summary = loop.run(frames(6, every_s=0.1), mode="realtime", window=4)
    # a newer frame takes the place of one that a busy machine holds up
    assert summary.accepted == 6 - summary.dropped.get("superseded", 0) >= 2
    assert summary.board.window == 1
    assert loop.results == ["the run is over"]


class Unchecked:
    """A POSE whose payload is not looked at on its way out."""

    TYPE = PacketType.POSE

    def __init__(self, payload):
        self.payload = payload

    def encode(self):
        return self.payload


def test_a_quaternion_of_length_two_is_never_scored():
    def answer(frame_id):
        q = (2.0 if frame_id % 2 else 1.0, 0.0, 0.0, 0.0)
        fixed = PoseMessage.LAYOUT.pack(frame_id, 1, 1, 0, 0.5, *q, 0.0, 0.0, 1.0, 1, 2, 3, 0, 0)
        return Unchecked(fixed)

    rows = []
    summary = Loop(hand_made(answer)).run(frames(6), on_row=rows.append, timeout_s=20.0)
    assert [row.outcome for row in rows] == ["accepted", "dropped:protocol"] * 3
    assert "the quaternion of a POSE has length 2" in rows[1].reason
    assert rows[1].q_wxyz is None
    assert rows[1].E_R_deg is None
    assert summary.dropped == {"protocol": 3}
    assert (summary.link.protocol_mistakes, summary.link.packets_corrupt) == (3, 0)
    assert adds_up(summary)


def test_a_board_that_never_stops_talking_does_not_hold_the_run():
    """Packets of another session without end: neither deadlines nor the end of the run wait for silence."""

    def start(url):
        link = Link(connect(url, 5.0))
        greet_host(link, Hello(), 10.0)
        while not isinstance(heard := link.recv(10.0), FrameHeader):
            if isinstance(heard, TimeSyncRequest):
                link.send(answer_time_sync(heard, now_ns()))
        packet = Packet(PacketType.BYE, Bye("x").encode(), link.session_id ^ 1)
        flood = LengthFraming().encode(packet) * 20_000
        with contextlib.suppress(LinkClosed):
            while True:  # faster than the host can read it
                link.transport._write(flood)
                while link.transport._read(0.0):
                    pass
        link.transport.close()

    rows = []
    summary = Loop(start).run(frames(2), on_row=rows.append, timeout_s=0.5)
    assert summary.ended == "completed"
    # nothing was damaged on the line, so the first frame keeps the board's one credit
    assert [row.outcome for row in rows] == ["dropped:timeout", "dropped:no_credit"]
    assert summary.link.packets_corrupt == 0
