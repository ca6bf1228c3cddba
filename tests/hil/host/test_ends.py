"""How a run ends that does not end well: stopped, killed, on a full disk, before a board that hangs."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from hil_loop import BOARD, Instant, Loop, board, frames
from hil_processes import PATIENCE_S, host_process, outcomes, started, wait_until

from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig, deferred_signals, run_host
from flyaround.simulator.errors import UserError
from tests.harness.full_device import FULL, needs_full_device


def answered(row):
    return row.outcome in {"accepted", "declined"}


def test_the_board_of_a_killed_host_takes_it_for_no_goodbye(tmp_path):
    log = tmp_path / "log"
    with (
        host_process(log, truth="inline", silence_s=60.0) as (host, url),
        started([sys.executable, "-c", BOARD, url]) as answering,
    ):
        wait_until(lambda: len(outcomes(log)) >= 3)
        host.kill()
        said, _ = answering.communicate(timeout=PATIENCE_S)
    assert answering.returncode == 1
    assert said.count("\n") == 1
    assert "the host ended the session: the host's run was killed or died, without a goodbye" in said
    assert json.loads((log / "run.json").read_text())["truth"] == "inline"
    assert not (log / "summary.json").exists()
    assert len(read_ledger(log)) >= 3


def test_a_full_disk_is_one_sentence_and_the_rows_so_far_are_whole(tmp_path):
    log = tmp_path / "log"
    with host_process(log, most_rows=4, silence_s=60.0) as (host, url):
        summary = board()(url)
        _, said = host.communicate(timeout=PATIENCE_S)
    assert host.returncode == 2, said
    assert said.count("\n") == 1
    assert (
        "frames.csv cannot be written (File too large): its 5 rows so far are complete: free some space, or"
        in said
    )
    assert [row.frame_id for row in read_ledger(log)] == [0, 1, 2, 3, 4]
    assert (log / "frames.csv").read_bytes().endswith(b"\n")
    assert "the run failed at the host" in summary.ended
    assert not list(log.glob(".*"))  # nothing half-written


@needs_full_device
def test_a_disk_that_is_full_from_the_start_leaves_no_ledger(tmp_path, monkeypatch):
    from flyaround.hil.host.ledger.frames_csv import LedgerWriter

    plain = Path.open
    monkeypatch.setattr(Path, "open", lambda _, __, **more: plain(FULL, "wb", **more))
    with pytest.raises(UserError, match=r"\(No space left on device\): its 0 rows so far are complete"):
        LedgerWriter(tmp_path)
    assert not list(tmp_path.iterdir())


@contextmanager
def hung_after(n):
    """Starts a board in a process of its own and stops it, as a debugger would, once it has answered ``n`` frames.

    Gives the rows up to the stop, and those after it, too.
    """
    processes, before, after = [], [], []

    def start(url):
        processes.append(subprocess.Popen([sys.executable, "-c", BOARD, url], stdout=subprocess.DEVNULL))

    def on_row(row):
        if sum(answered(row) for row in before) == n:
            after.append(row)
            return
        before.append(row)
        if sum(answered(row) for row in before) == n:
            os.kill(processes[0].pid, signal.SIGSTOP)
            # one thread takes the signal, when it gets a processor: until then the others go on and answer
            os.waitid(os.P_PID, processes[0].pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)

    try:
        yield start, on_row, after
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_hung_board_counts_as_gone_after_three_misses_and_ends_the_run():
    with hung_after(2) as (start, on_row, after):
        # its silence is another matter
        summary = Loop(start).run(frames(500), on_row=on_row, timeout_s=1.0, silence_s=60.0)
    # 500 misses would take 500 s
    assert summary.ended == "board_lost"
    assert "answered none of 3 frames in a row" in summary.board_gone
    # two that the line took, and the one that found no credit for want of an answer
    assert [row.outcome for row in after] == ["dropped:timeout", "dropped:timeout", "dropped:disconnected"]


def test_another_board_may_take_the_place_of_a_hung_one():
    with hung_after(2) as (start, on_row, after):

        def second(url):
            wait_until(lambda: len(after) >= 2)
            return board()(url)

        def patient(url):
            # turned away while the hung one holds the place
            from flyaround.hil.link.errors import LinkError

            deadline = time.monotonic() + PATIENCE_S
            while time.monotonic() < deadline:
                with suppress(LinkError):
                    return second(url)
                time.sleep(0.05)
            return None

        summary = Loop(start, patient).run(
            frames(12), on_row=on_row, timeout_s=2.5, max_misses=2, silence_s=60.0
        )
    assert summary.ended == "completed"
    assert summary.link.sessions == 2
    assert [row.outcome for row in after[:2]] == ["dropped:timeout", "dropped:disconnected"]
    assert {row.outcome for row in after[2:]} == {"accepted"}


def test_a_board_that_stalls_once_in_real_time_goes_on():
    """Frames that it was never sent meanwhile, for it had one, are no misses of it."""

    class Stalls(Instant):
        def __init__(self, camera):
            super().__init__(camera)
            self.sleeps = [0.0, 0.0, 3.0]

    rows = []
    summary = Loop(board(Stalls)).run(
        frames(100, every_s=0.05), mode="realtime", timeout_s=2.0, silence_s=60.0, on_row=rows.append
    )
    assert summary.ended == "completed"
    assert "disconnected" not in summary.dropped
    assert summary.dropped["timeout"] == 1
    assert summary.dropped["superseded"] > 3
    stalled = next(k for k, row in enumerate(rows) if row.outcome == "dropped:timeout")
    assert "accepted" in {row.outcome for row in rows[stalled:]}


def test_a_slow_board_is_not_taken_for_a_hung_one():
    class Slow(Instant):
        def __init__(self, camera):
            super().__init__(camera)
            self.sleeps = [0.6] * 6

    summary = Loop(board(Slow, window=8)).run(frames(7), timeout_s=0.5, max_misses=5, window=8)
    # every pose comes late, but it comes
    assert summary.ended == "completed"
    assert "disconnected" not in summary.dropped


@pytest.fixture
def interruptible():
    """Ctrl-C interrupts: what runs in the background, as the workers of tests do, is started without."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_signals_wait_until_the_books_are_closed():
    done = []

    def close_books(error=None):
        with deferred_signals():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)
            done.append("closed")
            if error is not None:
                raise error

    with pytest.raises(KeyboardInterrupt):
        close_books()
    assert done == ["closed"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    with pytest.raises(ValueError, match="first"):
        close_books(ValueError("the first says why"))


@pytest.mark.usefixtures("interruptible")
def test_the_end_is_told_though_ctrl_c_comes_again_while_the_books_are_closed(tmp_path):
    ends = []

    def source():
        try:
            yield from frames(500)
        finally:
            # closed with the books
            signal.raise_signal(signal.SIGINT)

    loop = Loop(board())
    link = LinkConfig(url="tcp://127.0.0.1:0", mode="lockstep", truth="off", timeout_s=PATIENCE_S)
    with pytest.raises(KeyboardInterrupt):
        run_host(
            source(),
            RunConfig(link=link, log_dir=tmp_path / "log"),
            on_row=lambda _: signal.raise_signal(signal.SIGINT),
            on_listening=loop.on_listening,
            on_end=ends.append,
        )
    assert [(end.ended, end.sent) for end in ends] == [("interrupted", 1)]
    assert json.loads((tmp_path / "log" / "summary.json").read_text())["sent"] == 1
