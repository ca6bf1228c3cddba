"""``flyaround hil host`` ends with 0 only where every frame was offered to a board."""

import json
import socket
import threading

import pytest

from flyaround.__main__ import run
from hil.host.ledger import read_ledger
from hil.link.clock import answer_time_sync, now_ns
from hil.link.messages import FrameHeader, Hello, TimeSyncRequest
from hil.link.session import Link, greet_host
from hil.link.transport import connect

pytestmark = pytest.mark.gl


def leaves_in_the_first_frame(url):
    """A board that takes a frame's header and closes the line, without a goodbye."""
    link = Link(connect(url, 30.0))
    greet_host(link, Hello(), 60.0)
    while not isinstance(message := link.recv(30.0), FrameHeader):
        if isinstance(message, TimeSyncRequest):
            link.send(answer_time_sync(message, now_ns()))
    link.transport.close()


def test_a_board_that_leaves_for_good_is_no_success(capsys, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    board = threading.Thread(target=leaves_in_the_first_frame, args=(url,), daemon=True)
    board.start()
    command = ["hil", "host", "tango-space-10m", "-n", "3", "--truth", "off", "--timeout", "0.5", "--json"]
    code = run([*command, "--listen", url, "--log", str(tmp_path / "log")])
    board.join(10.0)
    said = capsys.readouterr()
    assert code == 1
    assert "the board left after 1 of 3 frames" in " ".join(said.err.split())
    summary = json.loads(said.out)
    assert (summary["ended"], summary["sent"], summary["dropped"]) == ("board_lost", 1, {"disconnected": 1})
    assert [row.outcome for row in read_ledger(tmp_path / "log")] == ["dropped:disconnected"]
