"""A key on the line: who has it gets in, who has not is told so, and no packet counts twice or changed."""

import contextlib
import os
import threading
import time
from dataclasses import replace

import pytest
from hil_loop import Instant, Loop, adds_up, board, frames
from virtual_line import virtual_pair

from flyaround.hil.host.truth.logger import TruthLogger
from flyaround.hil.link.errors import LinkError, PacketError, UnsealedPacket
from flyaround.hil.link.packets.messages import Bye
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.security import (
    NONCE_BYTES,
    TRAILER_BYTES,
    WINDOW,
    HostHandshake,
    HostTransport,
    Seal,
    prove_to_host,
    read_key,
)
from flyaround.hil.link.session import Link
from flyaround.hil.link.transports.tcp import connect_tcp
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.faults import ClockDrift, Faults

KEY, OTHER = b"0123456789abcdef", b"fedcba9876543210"
POSE = Packet(PacketType.POSE, b"a pose", session_id=7, sequence=3)


def pair():
    nonces = bytes(range(64))
    return Seal(KEY, nonces, is_host=True), Seal(KEY, nonces, is_host=False)


def test_what_was_sealed_opens_once():
    host, board_side = pair()
    sealed = board_side.seal(POSE)
    assert len(sealed.payload) == len(POSE.payload) + TRAILER_BYTES
    assert host.open(sealed) == POSE
    with pytest.raises(PacketError, match="received twice"):
        host.open(sealed)


@pytest.mark.parametrize("at", range(6 + TRAILER_BYTES))
def test_a_changed_byte_is_refused(at):
    host, board_side = pair()
    sealed = board_side.seal(POSE)
    data = bytearray(sealed.payload)
    data[at] ^= 1
    with pytest.raises(PacketError, match="wrong MAC"):
        host.open(replace(sealed, payload=bytes(data)))


@pytest.mark.parametrize("change", [{"type": PacketType.CREDIT}, {"session_id": 8}, {"sequence": 4}])
def test_a_changed_header_is_refused(change):
    host, board_side = pair()
    with pytest.raises(PacketError, match="wrong MAC"):
        host.open(replace(board_side.seal(POSE), **change))


def test_a_packet_is_not_turned_back_at_its_sender_nor_used_in_another_session():
    host, board_side = pair()
    sealed = board_side.seal(POSE)
    with pytest.raises(PacketError, match="wrong MAC"):
        board_side.open(sealed)
    with pytest.raises(PacketError, match="wrong MAC"):
        Seal(KEY, bytes(64), is_host=True).open(sealed)
    with pytest.raises(PacketError, match="no MAC"):
        host.open(POSE)


def test_packets_may_overtake_each_other_within_the_window():
    host, board_side = pair()
    sealed = [board_side.seal(replace(POSE, sequence=k)) for k in range(WINDOW + 2)]
    order = [5, 3, 4, 0, WINDOW + 1]
    assert [host.open(sealed[k]).sequence for k in order] == order
    for late in (0, 1, 3):
        with pytest.raises(PacketError, match="twice, or much too late"):
            host.open(sealed[late])
    assert host.open(sealed[WINDOW]).sequence == WINDOW


def host_of(line, key, heard):
    def serve():
        secured = HostTransport(line, key)
        try:
            while True:
                packet = secured.recv_packet(20.0)
                if packet is not None:
                    heard.append(packet)
                    secured.send_packet(replace(packet, type=PacketType.CREDIT))
                    return
        except LinkError as error:
            heard.append(error)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    return thread


def test_another_key_is_told_at_once():
    here, there = virtual_pair()
    host_of(there, OTHER, [])
    begin = time.monotonic()
    with pytest.raises(LinkError, match="has another key"):
        prove_to_host(here, KEY)
    assert time.monotonic() - begin < 2


def test_runs_with_a_key(tmp_path):
    loggers, rows = [], []

    def listen(_url):
        loggers.append(TruthLogger(loop.truth_url, tmp_path / "truth.jsonl", KEY))
        loggers.append(TruthLogger(loop.truth_url, tmp_path / "stranger.jsonl", OTHER))
        for logger in loggers:
            logger.start()
        assert loggers[0].wait_connected(60)
        time.sleep(0.3)
        board(Instant, key=KEY)(loop.url)

    loop = Loop(listen)
    summary = loop.run(frames(10), key=KEY, truth="separate", on_row=rows.append)
    assert adds_up(summary)
    assert summary.accepted == 10
    assert loggers[0].stop(60.0) == 10
    assert loggers[1].stop(0.1) == 0
    assert (tmp_path / "stranger.jsonl").read_text() == ""


def test_a_key_less_host_and_a_board_with_one():
    def start(url):
        line = connect_tcp("127.0.0.1", int(url.rsplit(":", 1)[1]), 5.0)
        with pytest.raises(LinkError, match="--key"):
            prove_to_host(line, KEY, 1.5)
        line.close()
        board(Instant)(url)

    assert Loop(start).run(frames(2)).accepted == 2


def test_other_machines_need_a_key():
    with pytest.raises(UserError, match="hil key FILE"):
        Loop().run(frames(1), url="tcp://0.0.0.0:0")
    with pytest.raises(UserError, match="hil key FILE"):
        Loop().run(frames(1), truth="separate", truth_url="tcp://0.0.0.0:0")
    with pytest.raises(UserError, match="clock_drift"):
        Loop().run(frames(1), key=KEY, faults=Faults(line=(ClockDrift(ppm=1.0),)))
    summary = Loop(lambda url: board(Instant, key=KEY)(f"tcp://127.0.0.1:{url.rsplit(':', 1)[1]}")).run(
        frames(2), url="tcp://0.0.0.0:0", key=KEY, truth="inline"
    )
    assert (summary.accepted, summary.truth) == (2, "inline")


def test_key_files(tmp_path):
    path = tmp_path / "key"
    path.write_bytes(KEY + b"\n")
    path.chmod(0o600)
    assert read_key(str(path)) == KEY
    path.chmod(0o644)
    with pytest.raises(LinkError, match="chmod 600"):
        read_key(str(path))
    path.chmod(0o600)
    path.write_bytes(b"short")
    with pytest.raises(LinkError, match="16 to 4096"):
        read_key(str(path))
    with pytest.raises(LinkError, match="cannot be read"):
        read_key(str(tmp_path / "none"))


def test_a_host_that_answers_late_is_proved_to():
    """Requests are repeated each second; any of the answers may be proved."""
    here, there = virtual_pair()
    heard = []
    starts = threading.Timer(1.5, lambda: host_of(there, KEY, heard).join(60))
    starts.start()
    line = prove_to_host(here, KEY, 60.0)
    line.send_packet(POSE)
    assert line.recv_packet(60.0) == replace(POSE, type=PacketType.CREDIT)
    starts.join(60)
    assert heard == [POSE]


def proved():
    """A handshake in which a board has proved itself, its clock, and the board's seal."""
    now = [0.0]
    handshake = HostHandshake(KEY, lambda: now[0])
    here, there = virtual_pair()
    board_side = []
    thread = threading.Thread(target=lambda: board_side.append(prove_to_host(here, KEY)), daemon=True)
    thread.start()
    while handshake.seal is None:
        answer = handshake.take(there.recv_packet(20.0))
        if answer is not None:
            there.send_packet(answer)
    thread.join(20)
    return handshake, now


def test_a_flood_without_a_seal_ends_no_session():
    handshake, now = proved()
    seal = handshake.seal
    answered = 0
    for k in range(1000):
        now[0] += 0.01
        request = Packet(PacketType.AUTH_REQUEST, bytes([k % 256] * NONCE_BYTES))
        with contextlib.suppress(UnsealedPacket):
            answered += handshake.take(request) is not None
        with pytest.raises(UnsealedPacket):
            handshake.take(Packet(PacketType.AUTH_PROOF, bytes(32)))
    assert handshake.seal is seal
    # ten seconds of it: a board that begins again is heard, and no more often than it would ask
    assert 2 <= answered <= 25


def test_what_has_no_seal_is_dropped_and_counted():
    here, there = virtual_pair()
    lines = []
    thread = threading.Thread(target=lambda: lines.append(prove_to_host(here, KEY)), daemon=True)
    thread.start()
    host = Link(HostTransport(there, KEY))
    while not lines:
        host.recv(0.05)
    for payload in (b"", bytes(40)):
        here.send_packet(Packet(PacketType.BYE, payload))
    board_side = Link(lines[0])
    board_side.send(Bye("it is over"))
    assert host.recv(20.0) == Bye("it is over")
    assert host.stats.kinds == {"a packet without the seal of the session": 2}
    assert host.stats.mistakes == 2


def test_a_board_without_a_key_learns_why_it_is_refused():
    said = []

    def both(url):
        with pytest.raises(LinkError) as caught:
            board(Instant)(url)
        said.append(str(caught.value))
        board(Instant, key=KEY)(url)

    assert Loop(both).run(frames(2), key=KEY).accepted == 2
    assert "the host asks for a key: start the board with --key FILE" in said[0]


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero")])
def test_a_key_from_a_pipe_or_a_device_is_refused(tmp_path, make):
    make(tmp_path / "key")
    with pytest.raises(LinkError, match="is a pipe or a device: copy the key to an ordinary file"):
        read_key(str(tmp_path / "key"))
