"""The example boards, in C and in Python without our code, before a real host: also on a damaged line, and at ends."""

import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from c_program import compiled
from hand_made_host import hand_made_host, leave_with_a_goodbye
from hil_loop import CAMERA, Loop, Proxy, adds_up, flip_first, made_frame
from serial_line import null_modem

from flyaround.hil.link.packets.packet import PacketType

ROOT = Path(__file__).parents[3]
EXAMPLES = ROOT / "examples"
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def c_board(tmp_path_factory):
    return [str(compiled(EXAMPLES / "board_c" / "board.c", tmp_path_factory.mktemp("c")))]


@pytest.fixture(scope="module", params=["c", "python"])
def command(request):
    """How an example is started."""
    if request.param == "python":
        # isolated: nothing of this project can be imported
        return [sys.executable, "-I", str(EXAMPLES / "board_python.py")]
    return request.getfixturevalue("c_board")


def started(command, url):
    return subprocess.Popen(
        [*command, *url.partition("://")[2].replace("?baud=", ":").rsplit(":", 1)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process):
    try:
        said, wrong = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
        process.communicate()
    assert "runtime error" not in wrong
    return process.returncode, said, wrong


def spots(n, *, every_s=0.02):
    """A bright spot that wanders over black; the third picture is dark."""
    for k in range(n):
        image = np.zeros((48, 64), np.uint8)
        if k != 2:
            image[20:23, 10 + 2 * k : 13 + 2 * k] = 200
        yield made_frame(k, image, every_s=every_s)


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_an_example_board_serves_a_run(command, mode):
    rows, processes = [], []
    loop = Loop(lambda url: processes.append(started(command, url)))
    summary = loop.run(spots(12), on_row=rows.append, mode=mode)
    code, said, wrong = ended(processes[0])
    assert (code, wrong) == (0, "")
    assert "the host ended the session: the run is over" in said
    assert summary.ended == "completed"
    assert adds_up(summary)
    assert summary.link.protocol_mistakes == summary.link.packets_corrupt == 0
    if mode == "lockstep":
        assert (summary.sent, summary.accepted, summary.declined) == (12, 11, 1)
    answered = [row for row in rows if row.outcome in {"accepted", "declined"}]
    # a newer frame takes the place of one that a busy machine holds up
    assert len(answered) >= (12 if mode == "lockstep" else 1)
    for row in answered:
        assert row.outcome == ("declined" if row.frame_id == 2 else "accepted")
        if row.frame_id == 2:
            assert row.reason == "nothing bright in the picture"
            continue
        x = (11 + 2 * row.frame_id - CAMERA["cx_px"]) / CAMERA["fx_px"] * 10.0
        y = (21 - CAMERA["cy_px"]) / CAMERA["fy_px"] * 10.0
        assert row.t_m == pytest.approx((x, y, 10.0))
        assert row.e2e_ms > 0.0
        assert list(row.stages_ms) == ["centroid"]


@pytest.mark.parametrize("kind", [PacketType.FRAME_HEADER, PacketType.FRAME_CHUNK])
def test_an_example_board_outlives_damage(command, kind):
    rows, processes = [], []

    class ToExample(Proxy):
        """The harness's man in the middle, before an example."""

        def board(self, url):
            processes.append(started(command, url))
            return ended(processes[0])

    loop = Loop(ToExample(flip_first(kind, 2)))
    summary = loop.run(spots(6), on_row=rows.append, timeout_s=5.0)
    assert loop.results[0][0] == 0
    assert adds_up(summary)
    assert summary.ended == "completed"
    assert rows[1].outcome in {"dropped:corrupt", "dropped:timeout", "dropped:lost"}
    assert [row.outcome for row in rows if row.frame_id not in {1, 2}] == ["accepted"] * 4


@pytest.mark.parametrize("damage_every", [0, 9_000])
def test_the_example_in_c_on_a_serial_line(c_board, damage_every):
    rows, processes = [], []
    with null_modem(damage_every) as (left, right):
        loop = Loop(lambda _: processes.append(started(c_board, f"serial://{right}?baud=921600")))
        url = f"serial://{left}?baud=921600"
        summary = loop.run(spots(12), on_row=rows.append, url=url, timeout_s=3.0)
        code, said, wrong = ended(processes[0])
    assert (code, wrong) == (0, "")
    assert "the host ended the session: the run is over" in said
    assert adds_up(summary)
    assert summary.board.encoding == "raw"
    if damage_every:
        assert 2 <= summary.dropped["corrupt"] == summary.dropped_total <= 6
    else:
        assert (summary.accepted, summary.declined) == (11, 1)
    for row in rows:
        if row.outcome == "accepted":
            assert row.t_m[1] == pytest.approx((21 - CAMERA["cy_px"]) / CAMERA["fy_px"] * 10.0)


def test_an_example_board_tells_its_end_by_its_code(command):
    with hand_made_host() as host:
        process = started(command, host.url)
        host.meet()
        leave_with_a_goodbye(host)
        assert ended(process)[0] == 0
    with hand_made_host() as host:
        process = started(command, host.url)
        host.meet()
        host.ask_clock()
        host.send_frame(1, level=90)
        assert host.pose().accepted
        host.vanish()
        code, _, wrong = ended(process)
    assert code == 1
    assert wrong.startswith("the host went away without a goodbye")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        code, _, wrong = ended(started(command, f"tcp://127.0.0.1:{free.getsockname()[1]}"))
    assert code == 2
    assert wrong.count("\n") == 1
