"""Runs over a line that does damage, and with boards that leave."""

import threading
import time

import pytest
from estimators import PATIENCE_S
from hil_loop import (
    Instant,
    Loop,
    Proxy,
    adds_up,
    board,
    flip_first,
    frames,
    good_pose,
    greeted,
    serve_by_hand,
)

from flyaround.hil.link.packets.messages import (
    FrameChunk,
    FrameHeader,
    Hello,
    PoseMessage,
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

        def __init__(self):
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
            serve_by_hand(link, lambda m: isinstance(m, FrameChunk) and link.send(good_pose(m.frame_id)))

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


def quitter(url, *, after):
    """A board that vanishes in the middle of a frame, without a goodbye."""
    link, headers = greeted(url), []

    def take(message):
        if isinstance(message, FrameHeader):
            headers.append(message)
        elif isinstance(message, FrameChunk):
            link.send(PoseMessage(message.frame_id, accepted=False, reason="not today"))
        return len(headers) > after

    serve_by_hand(link, take)


def test_a_board_that_comes_back_finishes_the_run():
    def comes_back(url):
        quitter(url, after=2)
        time.sleep(0.2)
        return board()(url)

    rows = []
    summary = Loop(comes_back).run(frames(9), on_row=rows.append)
    assert [row.outcome for row in rows] == ["declined"] * 2 + ["dropped:disconnected"] + ["accepted"] * 6
    assert (summary.ended, summary.link.sessions) == ("completed", 2)
