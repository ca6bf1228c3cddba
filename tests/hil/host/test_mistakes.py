"""A user's mistakes around a run: one sentence each, and the books closed."""

import csv
import socket
from contextlib import contextmanager
from dataclasses import replace

import msgspec
import pytest
from hil_loop import Loop, board, frames, good_pose, greeted, refused, serve_by_hand

from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.frames_csv import LedgerWriter, read_ledger
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.link_process.host_link import HostLink
from flyaround.hil.host.link_process.ipc import FrameJob, LinkConfig
from flyaround.hil.host.report import write_report
from flyaround.hil.host.run_config import RunConfig
from flyaround.hil.link.packets.messages import (
    Credit,
    FrameChunk,
    HelloAck,
)
from flyaround.simulator.errors import UserError


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


def test_a_board_at_the_port_of_the_truth_is_sent_to_the_other_and_hears_no_truth():
    sentences = []

    def wrong_port_then_right_one(url):
        sentences.append(refused(lambda _: board()(loop.truth_url))(url))
        return board()(url)

    loop = Loop(wrong_port_then_right_one)
    summary = loop.run(frames(2), truth="separate")
    assert summary.accepted == 2
    assert f"serves ground truth to loggers: connect the board to {loop.url}" in sentences[0]


def test_an_old_ledger_is_not_overwritten(tmp_path):
    (tmp_path / "frames.csv").write_text("precious")
    with pytest.raises(UserError, match="exists already: name another folder"):
        Loop().run(frames(1), log_dir=tmp_path)
    assert (tmp_path / "frames.csv").read_text() == "precious"
    assert not (tmp_path / "run.json").exists()


def test_a_run_whose_terms_cannot_be_written_leaves_no_ledger(tmp_path):
    (tmp_path / "run.json").mkdir()
    for _ in range(2):  # the second try finds the folder as the first did
        with pytest.raises(UserError, match=r"run\.json"):
            Loop().run(frames(1), log_dir=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["run.json"]


LINK = LinkConfig(url="tcp://127.0.0.1:0", mode="lockstep", truth="off", timeout_s=1.0)


def test_a_dead_link_process_is_the_same_sentence_to_whoever_speaks_to_it():
    with HostLink(LINK) as link:
        link.open(HelloAck({}, 64, 48), 4, 64 * 48)
        link._process.kill()
        link._process.wait()
        (frame,) = frames(1)
        with pytest.raises(UserError, match="the link process ended unexpectedly"):
            link.submit(frame.image, FrameJob(record=FrameRecord.from_frame(frame), bits=8))
        with pytest.raises(UserError, match="the link process ended unexpectedly"):
            link.open(HelloAck({}, 64, 48), 4, 64 * 48)


def test_a_renderer_that_fails_leaves_a_ledger_that_adds_up(tmp_path):
    def failing():
        yield from frames(3)
        raise UserError("the renderer lost its context")

    with pytest.raises(UserError, match="lost its context"):
        Loop(board()).run(failing(), log_dir=tmp_path)
    summary = msgspec.json.decode((tmp_path / "summary.json").read_bytes(), type=LedgerSummary)
    assert (summary.ended, summary.accepted, len(read_ledger(tmp_path))) == ("failed", 3, 3)


def answers_besides(url, lies):
    """A board that answers each frame, after what ``lies`` sends for it."""
    link = greeted(url)

    def take(message):
        if isinstance(message, FrameChunk):
            lies(link, good_pose(message.frame_id))
            link.send(good_pose(message.frame_id))

    serve_by_hand(link, take)


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


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: replace(LINK, silence_s=float("nan")), "silence_s"),
        (lambda: replace(LINK, timeout_s=float("inf")), "timeout_s"),
        (lambda: RunConfig(link=LINK, latency_s=float("nan")), "latency_s"),
        (lambda: RunConfig(link=LINK, deadline_s=float("nan")), "deadline_s"),
    ],
)
def test_times_of_a_run_that_are_not_finite_are_refused(make, key):
    with pytest.raises(UserError, match=f"{key} is"):
        make()
