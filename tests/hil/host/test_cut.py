"""Boards and hosts that are killed, a device that is gone: the other side goes on or ends, and nothing stale is taken.

Each prints how long it took, which is to be within 2 s; bounds are wider, as machines of tests are busy.
"""

import json
import os
import pty
import signal
import time
from pathlib import Path

import pytest
from hand_made_host import in_thread
from hil_loop import Instant, Loop, adds_up, frames, good_pose, greeted, serve_by_hand
from hil_processes import (
    PATIENCE_S,
    children_of,
    echo_board,
    free_url,
    host_process,
    kill_all,
    outcomes,
    tell,
    wait_until,
)

from flyaround.hil.board.agent import run_board
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.link.packets.messages import FrameChunk

BUSY_S = 20.0


@pytest.mark.slow
def test_a_killed_board_is_known_at_once_and_its_successor_goes_on(tmp_path):
    log = tmp_path / "log"
    with host_process(log, n=60) as (host, url):
        with echo_board(url) as first:
            wait_until(lambda: len(outcomes(log)) >= 3)
            first.send_signal(signal.SIGKILL)
            took = wait_until(lambda: "dropped:disconnected" in outcomes(log) or host.poll() is not None)
        with echo_board(url) as second:
            host.communicate(timeout=PATIENCE_S)
            second.communicate(timeout=PATIENCE_S)
    tell(f"a killed board is known after {took:.2f} s")
    assert took < BUSY_S
    assert (host.returncode, second.returncode) == (0, 0)
    rows = read_ledger(log)
    summary = json.loads((log / "summary.json").read_text())
    assert summary["sent"] == len(rows) == 60 == summary["accepted"] + sum(summary["dropped"].values())
    assert summary["dropped"] in ({"disconnected": 1}, {})
    assert summary["link"]["sessions"] == 2


@pytest.mark.slow
@pytest.mark.parametrize("how", ["SIGTERM", "SIGKILL", "power"])
def test_the_board_of_a_host_that_ends_meets_the_next_one(tmp_path, how):
    url = free_url()
    with echo_board(url, "--reconnect", "--timeout", "1") as board:
        with host_process(tmp_path / "first", url=url) as (host, _):
            wait_until(lambda: len(outcomes(tmp_path / "first")) >= 3)
            children = children_of(host.pid)
            if how == "power":
                kill_all([*children, host.pid])
            else:
                host.send_signal(getattr(signal, how))
            host.wait(PATIENCE_S)
            # its link process says goodbye, and leaves the port
            wait_until(lambda: not any(Path(f"/proc/{pid}/exe").exists() for pid in children))
        with host_process(tmp_path / "second", url=url, n=5) as (host, there):
            assert there == url
            start = time.monotonic()
            host.communicate(timeout=PATIENCE_S)
            took = time.monotonic() - start
        assert host.returncode == 0
        board.send_signal(signal.SIGTERM)
        _, said = board.communicate(timeout=PATIENCE_S)
    tell(f"{how}: five frames of the next host after {took:.2f} s")
    assert took < BUSY_S
    assert board.returncode == 143
    assert outcomes(tmp_path / "second") == ["accepted"] * 5
    # before the first host listened, it may have said so
    met = [line for line in said.splitlines() if "nobody listens" not in line]
    assert "the host" in met[0]


def test_a_serial_line_that_is_pulled_out_ends_the_session():
    """The device goes away under the board, as that of a USB adapter does."""
    pytest.importorskip("serial")
    from hil_loop import CAMERA

    from flyaround.hil.link.framing.cobs import CobsFraming
    from flyaround.hil.link.packets.messages import HelloAck
    from flyaround.hil.link.packets.packet import Packet, PacketType

    master, slave = pty.openpty()
    url = f"serial://{os.ttyname(slave)}?baud=921600"
    thread, ended = in_thread(lambda: run_board(url, make_estimator=Instant))
    assert os.read(master, 4096)
    ack = Packet(PacketType.HELLO_ACK, HelloAck(CAMERA, 64, 48).encode(), 7)
    os.write(master, CobsFraming().encode(ack))
    said, kinds = CobsFraming(), set()
    while PacketType.TIME_SYNC_REQUEST not in kinds:
        # in session it asks for the time
        said.feed(os.read(master, 4096))
        while (packet := said.next_packet()) is not None:
            kinds.add(packet.type)
    os.close(slave)
    os.close(master)
    start = time.monotonic()
    thread.join(PATIENCE_S)
    took = time.monotonic() - start
    tell(f"a serial device that is gone is known after {took:.2f} s")
    assert took < BUSY_S
    assert not ended[0].goodbye
    assert "is it still plugged in?" in ended[0].ended


def test_a_pose_of_an_earlier_session_is_never_taken():
    """A board that came back, and answers with what it had begun for the session before."""

    def start(url):
        first = greeted(url)
        stale_id = first.session_id
        first.transport.close()
        link = greeted(url)
        good_id = link.session_id
        assert good_id != stale_id

        def take(message):
            if isinstance(message, FrameChunk):
                for session_id, z_m in ((stale_id, 999.0), (good_id, 1.0)):
                    link.session_id = session_id
                    link.send(good_pose(message.frame_id, z_m))

        return serve_by_hand(link, take)

    rows = []
    loop = Loop(start)
    summary = loop.run(frames(5), on_row=rows.append)
    assert [row.t_m for row in rows] == [(0.0, 0.0, 1.0)] * 5
    assert adds_up(summary)
    assert summary.link.sessions == 2
