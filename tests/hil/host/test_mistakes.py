"""A user's mistakes around a run: one sentence each, and the books closed."""

from __future__ import annotations

import csv
import socket
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import msgspec
import pytest
from hil_loop import Loop, board, frames, refused

from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.frames_csv import LedgerWriter, read_ledger
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.link_process.host_link import HostLink
from flyaround.hil.host.link_process.ipc import Board, BoardDown, BoardUp, FrameJob, LinkConfig
from flyaround.hil.host.link_process.process import LinkServer
from flyaround.hil.host.report import write_report
from flyaround.hil.link.clock import answer_time_sync, now_ns
from flyaround.hil.link.packets.messages import (
    Bye,
    Credit,
    ErrorCode,
    ErrorMessage,
    FrameChunk,
    Hello,
    HelloAck,
    PoseMessage,
    TimeSyncRequest,
)
from flyaround.hil.link.session import Link, greet_host
from flyaround.hil.link.transports.url import connect
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.carrier import open_anonymous_file


@contextmanager
def taken_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_port_in_use_is_one_sentence_and_nothing_is_written(tmp_path):
    with taken_port() as port:
        for options in ({"url": f"tcp://127.0.0.1:{port}"}, {"truth_url": f"tcp://127.0.0.1:{port}"}):
            sentence = f"port {port} on 127.0.0.1 is in use by another program: stop it, or choose another"
            with pytest.raises(UserError, match=sentence) as caught:
                Loop().run(frames(1), truth="separate", log_dir=tmp_path / "log", **options)
            assert "\n" not in str(caught.value)
    assert not (tmp_path / "log").exists()


def test_no_board_is_one_sentence_and_the_books_are_closed(tmp_path):
    with pytest.raises(UserError, match=r"no board connected to tcp://127.* within 0\.2 s: start one with"):
        Loop().run(frames(1), log_dir=tmp_path, connect_timeout_s=0.2)
    summary = msgspec.json.decode((tmp_path / "summary.json").read_bytes(), type=LedgerSummary)
    assert (summary.ended, summary.sent) == ("no_board", 0)


def test_a_board_with_another_model_is_refused_by_name():
    loop = Loop(refused(board(model_name="cygnus")))
    with pytest.raises(UserError, match="model of 'cygnus' but the host flies 'tango'"):
        loop.run(frames(1), target_name="tango", connect_timeout_s=1.5)
    loop.threads[0].join(5.0)
    assert "refuses: the board carries a model of 'cygnus'" in loop.results[0]


def test_a_board_at_the_port_of_the_truth_is_sent_to_the_other_and_hears_no_truth():
    sentences = []

    def wrong_port_then_right_one(url):
        sentences.append(refused(lambda _: board()(loop.truth_url))(url))
        return board()(url)

    loop = Loop(wrong_port_then_right_one)
    summary = loop.run(frames(2), truth="separate")
    assert summary.accepted == 2
    assert f"gives ground truth to loggers: connect the board to {loop.url}" in sentences[0]


def test_an_old_ledger_is_not_overwritten(tmp_path):
    (tmp_path / "frames.csv").write_text("precious")
    with pytest.raises(UserError, match="is there already: name another folder"):
        Loop().run(frames(1), log_dir=tmp_path)
    assert (tmp_path / "frames.csv").read_text() == "precious"
    assert not (tmp_path / "run.json").exists()


def test_a_run_whose_terms_cannot_be_written_leaves_no_ledger(tmp_path):
    (tmp_path / "run.json").mkdir()
    for _ in range(2):  # the second try finds the folder as the first did
        with pytest.raises(UserError, match=r"run\.json"):
            Loop().run(frames(1), log_dir=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


def test_no_open_port_however_a_run_is_started(tmp_path):
    loop = Loop()
    with pytest.raises(UserError, match="give both sides a key"):
        loop.run(frames(1), url="tcp://0.0.0.0:0", truth="separate", log_dir=tmp_path / "log")
    assert not (tmp_path / "log").exists()


LINK = LinkConfig(url="tcp://127.0.0.1:0", mode="lockstep", truth="off", timeout_s=1.0)


def test_a_stranger_does_not_change_why_and_since_when_the_board_is_gone():
    with HostLink(LINK) as link:
        link._take(BoardDown("it was no board"))
        assert link.down_reason == "it was no board"  # all that is known before the first
        board = Board(name="board", model="tango", method="hybrid", encoding="raw", window=2)
        link._take(BoardUp("peer", board))
        link._take(BoardDown("its cable was pulled"))
        since = link.down_since_s
        link._take(BoardDown("it said nothing that the link protocol knows"))
        assert (link.down_reason, link.down_since_s) == ("its cable was pulled", since)


def test_a_dead_link_process_is_the_same_sentence_to_whoever_speaks_to_it():
    with HostLink(LINK) as link:
        link.open(HelloAck({}, 64, 48), 4, 64 * 48)
        link._process.kill()
        link._process.wait()
        (frame,) = frames(1)
        with pytest.raises(UserError, match="the link process ended unexpectedly"):
            link.submit(frame.image, FrameJob(record=FrameRecord.of(frame), bits=8))
        with pytest.raises(UserError, match="the link process ended unexpectedly"):
            link.open(HelloAck({}, 64, 48), 4, 64 * 48)


@pytest.mark.parametrize("code", ErrorCode)
def test_only_word_of_damage_is_a_damaged_frame(code):
    ours, theirs = Pipe()
    server = LinkServer(theirs, open_anonymous_file(), LINK)
    try:
        server._in_flight.start(FrameRecord(frame_id=5, epoch_utc="", t_s=0.0, exposure_s=0.01), 0)
        server._board._take_error(ErrorMessage(code, "the board says so", 5))
        result = ours.recv()
    finally:
        server._shut()
    damage = code in {ErrorCode.CORRUPT, ErrorCode.INCOMPLETE}
    assert result.outcome == ("dropped:corrupt" if damage else "dropped:protocol")
    assert (result.frame_id, result.reason) == (5, "the board says so")
    assert server._in_flight.held == 0


def test_a_link_process_whose_run_was_killed_ends_in_order():
    ours, theirs = Pipe()
    server = LinkServer(theirs, open_anonymous_file(), LINK)
    port = int(server._listener.url.rsplit(":", 1)[1])
    ours.close()
    server.run()  # what it has to say first finds nobody
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port), timeout=5.0)


def test_a_renderer_that_fails_leaves_a_ledger_that_adds_up(tmp_path):
    def failing():
        yield from frames(3)
        raise UserError("the renderer lost its context")

    with pytest.raises(UserError, match="lost its context"):
        Loop(board()).run(failing(), log_dir=tmp_path)
    summary = msgspec.json.decode((tmp_path / "summary.json").read_bytes(), type=LedgerSummary)
    assert (summary.ended, summary.accepted, len(read_ledger(tmp_path))) == ("failed", 3, 3)


def test_the_agent_as_a_program_says_one_sentence(tmp_path):
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "flyaround.hil.board",
            "tcp://127.0.0.1:1",
            "--model",
            str(tmp_path / "none.json"),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=Path(__file__).parents[3],
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "none.json cannot be read" in done.stderr


def answers_besides(url, lies):
    """A board that answers each frame, after what ``lies`` sends for it."""
    link = Link(connect(url, 5.0))
    greet_host(link, Hello(window=1), 10.0)
    while True:
        message = link.recv(60.0)
        if isinstance(message, TimeSyncRequest):
            link.send(answer_time_sync(message, now_ns()))
        elif isinstance(message, FrameChunk):
            pose = PoseMessage(message.frame_id, True, "", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5)
            lies(link, pose)
            link.send(pose)
        elif isinstance(message, Bye):
            link.transport.close()
            return


def sends_other_session(link, pose):
    session_id, link.session_id = link.session_id, 12345
    link.send(pose)
    link.session_id = session_id


@pytest.mark.parametrize(
    ("lies", "kind", "at_least"),
    [
        (
            lambda link, pose: link.send(replace(pose, frame_id=pose.frame_id + 1000)),
            "an answer to a frame that was never sent",
            4,
        ),
        (
            lambda link, pose: link.send(Credit(pose.frame_id + 1000, 1)),
            "credit for a frame that was never sent",
            4,
        ),
        (lambda link, pose: link.send(pose), "a second answer to a frame", 3),
        (sends_other_session, "a packet of a session that was never opened", 4),
    ],
)
def test_each_lie_about_a_frame_is_counted_by_its_kind(lies, kind, at_least, tmp_path):
    loop = Loop(lambda url: answers_besides(url, lies))
    summary = loop.run(frames(4), log_dir=tmp_path)
    assert summary.accepted == 4
    assert list(summary.link.mistakes) == [kind]
    assert at_least <= summary.link.mistakes[kind] == summary.link.protocol_mistakes <= 4
    assert kind in write_report(tmp_path).read_text()


def test_a_board_that_is_off_by_one_answers_no_frame(tmp_path):
    def one_on(url):
        link = Link(connect(url, 5.0))
        greet_host(link, Hello(window=1), 10.0)
        while not isinstance(message := link.recv(60.0), Bye):
            if isinstance(message, TimeSyncRequest):
                link.send(answer_time_sync(message, now_ns()))
            elif isinstance(message, FrameChunk):
                link.send(
                    PoseMessage(message.frame_id + 1, True, "", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5)
                )
        link.transport.close()

    summary = Loop(one_on).run(frames(2), log_dir=tmp_path, timeout_s=1.0)
    assert (summary.accepted, summary.dropped_total) == (0, 2)
    assert summary.link.mistakes["an answer to a frame that was never sent"] >= 1


SECOND_NS = 1_000_000_000


@pytest.mark.parametrize(
    ("times", "why"),
    [
        (lambda now: (now, now + 5, now - 2 * SECOND_NS), "not in this order"),
        (lambda now: (now - 10 * SECOND_NS, now, now), "before it was sent"),
        (lambda now: (now, now, now + 10 * SECOND_NS), "after the answer came"),
        # a wall clock's nanoseconds, and the largest number that there is
        (lambda _: (1_800_000_000 * SECOND_NS,) * 3, "after the answer came"),
        (lambda _: (2**64 - 1,) * 3, "after the answer came"),
    ],
)
def test_board_times_that_cannot_be_are_left_out_and_told(times, why, tmp_path):
    def lies(link, pose):
        receive, start, end = times(now_ns())
        link.send(replace(pose, receive_ns=receive, start_ns=start, end_ns=end))

    def board_of_lies(url):
        link = Link(connect(url, 5.0))
        greet_host(link, Hello(window=1), 10.0)
        while not isinstance(message := link.recv(60.0), Bye):
            if isinstance(message, TimeSyncRequest):
                link.send(answer_time_sync(message, now_ns()))
            elif isinstance(message, FrameChunk):
                lies(
                    link, PoseMessage(message.frame_id, True, "", (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5)
                )
        link.transport.close()

    summary = Loop(board_of_lies).run(frames(3), log_dir=tmp_path)
    assert (summary.accepted, summary.time_faults) == (3, 3)
    assert summary.board_total_ms_p50 is None
    for row in read_ledger(tmp_path):
        assert why in row.time_fault
        assert row.board_total_ms is row.uplink_ms is row.downlink_ms is row.staleness_ms is None
        assert row.received_on_board_utc == ""
    assert "times that cannot be for 3 frames" in write_report(tmp_path).read_text()


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "'quoted", "\t=1"])
def test_no_cell_of_text_is_a_formula(text, tmp_path):
    writer = LedgerWriter(tmp_path)
    row = FrameRecord(frame_id=0, epoch_utc="", t_s=0.0, exposure_s=0.0, outcome="declined", reason=text)
    writer.add(row)
    writer.close()
    with (tmp_path / "frames.csv").open(newline="") as file:
        (cells,) = csv.DictReader(file)
    assert cells["reason"] == f"'{text}"
    assert read_ledger(tmp_path)[0].reason == text
