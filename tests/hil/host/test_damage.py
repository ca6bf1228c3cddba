"""Runs over a line that does damage, and with boards that leave."""

from __future__ import annotations

import re
import socket
import threading
import time

import msgspec
import pytest
from estimators import PATIENCE_S
from hil_loop import CAMERA, Instant, Loop, Proxy, adds_up, board, flip_first, frames, refused

from flyaround.hil.board.agent import run_board
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.packets.messages import (
    Bye,
    FrameChunk,
    FrameHeader,
    Hello,
    PoseMessage,
    TimeSyncRequest,
)
from flyaround.hil.link.packets.packet import PacketType, decode_packet
from flyaround.hil.link.session import Link, greet_host
from flyaround.hil.link.transports.url import connect


@pytest.mark.parametrize("kind", [PacketType.FRAME_CHUNK, PacketType.FRAME_HEADER])
def test_a_damaged_frame_is_dropped_as_corrupt_and_the_run_goes_on(kind):
    rows = []
    summary = Loop(Proxy(flip_first(kind, 3))).run(frames(6), on_row=rows.append)
    assert [row.outcome for row in rows] == ["accepted"] * 2 + ["dropped:corrupt"] + ["accepted"] * 3
    assert summary.dropped == {"corrupt": 1}
    assert adds_up(summary)
    assert "lost a packet on the line" in rows[2].reason


def test_a_damaged_pose_is_never_accepted():
    class BadLine:
        """Flips a bit in the third POSE that comes from the board."""

        def __init__(self) -> None:
            self.seen = 0

        def __call__(self, url):
            line = connect(url, 5.0)
            write = line._write

            def damaged(data):
                if decode_packet(bytes(data[4:])).type == PacketType.POSE:
                    self.seen += 1
                    if self.seen == 3:
                        data = data[:60] + bytes([data[60] ^ 1]) + data[61:]
                write(data)

            line._write = damaged
            link = Link(line)
            greet_host(link, Hello(), 5.0)
            while True:
                message = link.recv(5.0)
                if isinstance(message, TimeSyncRequest):
                    link.send(answer_time_sync(message, now_ns()))
                if isinstance(message, Bye):
                    line.close()
                    return
                if isinstance(message, FrameChunk):
                    link.send(
                        PoseMessage(
                            message.frame_id,
                            accepted=True,
                            q_camera_from_target_wxyz=(1, 0, 0, 0),
                            t_camera_from_target_m=(0, 0, 1),
                        )
                    )

    rows = []
    summary = Loop(BadLine()).run(frames(5), on_row=rows.append, timeout_s=3.0)
    assert [row.outcome for row in rows] == ["accepted"] * 2 + ["dropped:corrupt"] + ["accepted"] * 2
    assert summary.link.packets_corrupt == 1


def test_a_board_that_times_out_and_comes_round():
    rows, given_up = [], threading.Event()

    class Sleepy(Instant):
        def estimate(self, image):
            if image[0, 0] == 1:
                assert given_up.wait(PATIENCE_S)
            return super().estimate(image)

    def on_row(row):
        rows.append(row)
        if row.frame_id == 1:
            given_up.set()

    summary = Loop(board(Sleepy)).run(frames(4), on_row=on_row, timeout_s=2.5)
    assert [row.outcome for row in rows] == ["accepted", "dropped:timeout", "accepted", "accepted"]
    assert rows[1].reason == "no pose within 2.5 s"
    assert summary.link.late_poses == 1


def quitter(url, *, after: int):
    """A board that vanishes in the middle of a frame, without a goodbye."""
    link = Link(connect(url, 10.0))
    greet_host(link, Hello(), 10.0)
    headers = 0
    while True:
        message = link.recv(5.0)
        if isinstance(message, FrameHeader):
            headers += 1
            if headers > after:
                link.transport.close()
                return
        elif isinstance(message, FrameChunk):
            link.send(PoseMessage(message.frame_id, accepted=False, reason="not today"))
        elif isinstance(message, TimeSyncRequest):
            link.send(answer_time_sync(message, now_ns()))


def test_a_board_that_disconnects_mid_frame_and_stays_away(tmp_path):
    summary = Loop(lambda url: quitter(url, after=2)).run(frames(9), log_dir=tmp_path, timeout_s=2.5)
    assert summary.ended == "board_lost"
    assert (summary.sent, summary.declined, summary.dropped) == (3, 2, {"disconnected": 1})
    assert [row.outcome for row in read_ledger(tmp_path)] == ["declined", "declined", "dropped:disconnected"]
    assert msgspec.json.decode((tmp_path / "summary.json").read_bytes(), type=LedgerSummary) == summary


def test_a_board_that_comes_back_finishes_the_run():
    def comes_back(url):
        quitter(url, after=2)
        time.sleep(0.2)
        return board()(url)

    rows = []
    summary = Loop(comes_back).run(frames(9), on_row=rows.append)
    assert [row.outcome for row in rows] == ["declined"] * 2 + ["dropped:disconnected"] + ["accepted"] * 6
    assert (summary.ended, summary.link.sessions) == ("completed", 2)


def test_a_second_board_is_turned_away_with_a_sentence():
    answered, turned_away = threading.Event(), threading.Event()

    def second(url):
        assert answered.wait(PATIENCE_S)
        try:
            return refused(board())(url)
        finally:
            turned_away.set()

    def source():
        for frame in frames(10):
            yield frame
            # the first one's session lasts until the other has heard
            assert frame.number != 1 or turned_away.wait(PATIENCE_S)

    loop = Loop(board(), second)
    summary = loop.run(source(), on_row=lambda _: answered.set())
    assert summary.accepted == 10
    assert "another board is connected to this host: stop it first" in str(loop.results[0])


def test_the_host_goes_away_without_a_goodbye():
    with socket.create_server(("127.0.0.1", 0)) as server:
        done = []
        thread = threading.Thread(
            target=lambda: done.append(
                run_board(f"tcp://127.0.0.1:{server.getsockname()[1]}", make_estimator=Instant)
            )
        )
        thread.start()
        from flyaround.hil.link.packets.messages import HelloAck
        from flyaround.hil.link.transports.tcp import TcpTransport

        sock, _ = server.accept()
        link = Link(TcpTransport(sock, "board"), 5)
        assert isinstance(link.recv(PATIENCE_S), Hello)
        link.send(HelloAck(CAMERA, 64, 48))
        link.transport.close()
        thread.join(PATIENCE_S)
    assert not done[0].goodbye
    assert re.fullmatch(r"the host went away without a goodbye \(.*\) after 0 frames", done[0].ended)
