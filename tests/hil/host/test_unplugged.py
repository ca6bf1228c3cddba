"""A line that swallows everything, without a word to either side: both are through with it within two seconds.

Each prints how long it took (``-rA``); bounds are wider, as machines of tests are busy.
"""

import json
import secrets
import time
from contextlib import suppress
from subprocess import CalledProcessError

import pytest
from hil_loop import Instant, Loop, adds_up, frames
from hil_processes import PATIENCE_S, Cable, Plug, echo_board, host_process, outcomes, tell, wait_until

from flyaround.hil.board.agent import run_board
from flyaround.hil.host.ledger.frames_csv import read_ledger

# the old ways took 10 s (the board) and 30 s (the host)
BUSY_S = 2.8


def test_both_sides_of_a_line_that_is_cut_find_out():
    plugs, ends, rows, cut_s = [], [], [], []

    def start(url):
        plugs.append(Plug(url))
        summary = run_board(plugs[0].url, make_estimator=Instant, silence_s=3.0)
        ends.append((time.monotonic(), summary))

    def on_row(row):
        rows.append((time.monotonic(), row))
        if len(rows) == 3:
            cut_s.append(time.monotonic())
            plugs[0].plugged.clear()

    summary = Loop(start).run(frames(100), on_row=on_row, timeout_s=10.0, silence_s=3.0)
    wait_until(lambda: ends)
    plugs[0].close()
    (ended_s, board), (noticed_s, last) = ends[0], rows[-1]
    tell(f"host after {noticed_s - cut_s[0]:.2f} s, board after {ended_s - cut_s[0]:.2f} s")
    assert adds_up(summary)
    assert (summary.ended, summary.dropped) == ("board_lost", {"disconnected": 1})
    assert "silent for 3 s" in last.reason
    assert not board.goodbye
    assert "the host said nothing for 3 s" in board.ended
    assert max(noticed_s, ended_s) - cut_s[0] < 20.0


def test_a_board_that_computes_for_long_is_not_taken_for_cut_off():
    class Slow(Instant):
        def __init__(self, camera):
            super().__init__(camera)
            self.sleeps = [0.0, 4.0]

    def start(url):
        return run_board(url, make_estimator=Slow, silence_s=2.5)

    summary = Loop(start).run(frames(3), timeout_s=PATIENCE_S, silence_s=2.5)
    assert summary.accepted == 3
    assert summary.link.sessions == 1
    assert summary.e2e_ms_max > 4000.0


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_a_line_that_is_plugged_in_again_goes_on(tmp_path, mode):
    log = tmp_path / "log"
    with host_process(log, mode=mode, n=400, timeout_s=30.0) as (host, url):
        plug = Plug(url)
        with echo_board(plug.url, "--reconnect", "--timeout", "0.5") as board:
            wait_until(lambda: len(outcomes(log)) >= 3)
            plug.plugged.clear()
            noticed = wait_until(lambda: "dropped:disconnected" in outcomes(log))
            time.sleep(1.0)  # and the board
            before = len(outcomes(log))
            plug.plugged.set()
            again = wait_until(lambda: "accepted" in outcomes(log)[before:] or host.poll() is not None)
            assert host.poll() is None
            host.communicate(timeout=PATIENCE_S)
            board.terminate()
            _, said = board.communicate(timeout=PATIENCE_S)
        plug.close()
    tell(f"{mode}: known after {noticed:.2f} s; on again {again:.2f} s after it is in")
    assert noticed < BUSY_S
    assert again < 5.0
    assert "said nothing for 1.5 s" in said
    rows = read_ledger(log)
    # none is answered by the pose of another
    assert all(row.t_m is None or row.t_m == (0.0, 0.0, 1.0) for row in rows)
    assert {row.outcome.split(":")[0] for row in rows} == {"accepted", "dropped"}
    summary = json.loads((log / "summary.json").read_text())
    assert summary["sent"] == len(rows) == summary["accepted"] + sum(summary["dropped"].values())
    # what the board said into the dead line may have come too
    assert summary["link"]["sessions"] >= 2


@pytest.mark.slow
def test_a_cable_between_two_machines(tmp_path):
    """Nobody acknowledges what is sent: not even the system of the other machine."""
    log, key = tmp_path / "log", tmp_path / "key"
    key.write_text(secrets.token_hex(32) + "\n")
    key.chmod(0o600)
    with suppress(CalledProcessError, OSError), Cable() as cable:
        told = {"url": "tcp://10.77.0.1:5600", "key": str(key), "timeout_s": 3.0, "size": 1024}
        with (
            host_process(log, prefix=cable.host, **told) as (host, url),
            echo_board(url, "--key", str(key), prefix=cable.board) as board,
        ):
            wait_until(lambda: len(outcomes(log)) >= 20)
            cable.pull()
            start = time.monotonic()
            noticed = wait_until(lambda: "dropped:disconnected" in outcomes(log))
            board.wait(PATIENCE_S)
            ended = time.monotonic() - start
            host.wait(PATIENCE_S)
        tell(f"host after {noticed:.2f} s, board after {ended:.2f} s")
        assert (board.returncode, host.returncode) == (1, 1)
        assert max(noticed, ended) < BUSY_S
        summary = json.loads((log / "summary.json").read_text())
        assert summary["ended"] == "board_lost"
        assert summary["sent"] == summary["accepted"] + sum(summary["dropped"].values())
        return
    pytest.skip("needs the rights to make network namespaces")
