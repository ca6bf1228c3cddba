"""A user's mistakes around a run: one sentence each, and the books closed."""

from __future__ import annotations

import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from hil_loop import Loop, board, frames, refused

from hil.host.ledger import read_ledger
from hil.host.summary import LedgerSummary
from simulator.errors import UserError


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
        [sys.executable, "-m", "hil.board", "tcp://127.0.0.1:1", "--model", str(tmp_path / "none.json")],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "none.json cannot be read" in done.stderr
