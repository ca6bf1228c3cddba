"""``flyaround hil board``: what it prints of what a host said, and that it has the options of the bundle's agent."""

import sys
import threading
from pathlib import Path

import pytest
from hand_made_host import hand_made_host
from hil_loop import CAMERA, Instant
from hil_processes import started

from flyaround.__main__ import run
from flyaround.hil.board import agent, options
from flyaround.hil.board.__main__ import main
from flyaround.hil.board.agent import BoardAgent
from flyaround.hil.board.gige.options import CAMERA_OPTIONS
from flyaround.hil.board.options import AGENT_OPTIONS
from flyaround.hil.board.service import ExitCode
from flyaround.hil.link.packets.messages import Bye, Hello, HelloAck
from flyaround.hil.link.session import Link
from flyaround.hil.link.transports.tcp import TcpListener

DOCS = Path(__file__).parents[2] / "docs"
HARNESS = Path(__file__).parents[1] / "harness"


def test_a_goodbye_in_brackets_is_printed_as_it_came(monkeypatch, capsys):
    # the real session with a real host; only the estimator is one that needs no pictures
    monkeypatch.setattr(agent, "estimator_factory", lambda *_: (Instant, "", ""))
    listener = TcpListener("127.0.0.1", 0)

    def host():
        link = Link(listener.accept(30.0), 7)
        assert isinstance(link.recv(30.0), Hello)
        link.send(HelloAck(CAMERA, 64, 48))
        link.send(Bye("[/bold] over [red]"))
        link.recv(30.0)
        link.transport.close()

    thread = threading.Thread(target=host, daemon=True)
    thread.start()
    assert run(["hil", "board", listener.url]) == 0
    thread.join(30.0)
    listener.close()
    said = capsys.readouterr().err
    assert "0 frames, 0 accepted: the host ended the session ([/bold] over [red])" in " ".join(said.split())


def test_one_table_of_options_for_the_bundle_the_workstation_and_the_page(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    pages = [capsys.readouterr().out, (DOCS / "hil_board.md").read_text()]
    run(["hil", "board", "--help"])
    pages.append(capsys.readouterr().out)
    for option in (*AGENT_OPTIONS, *CAMERA_OPTIONS):
        assert all(option.flag in page for page in pages), option.flag


def test_options_reach_the_agent_and_its_end_is_told_by_the_code(monkeypatch, capsys):
    made = {}

    class Told(BoardAgent):
        def __init__(self, *_, **given):
            made.update(given)
            super().__init__("tcp://127.0.0.1:1", make_estimator=Instant, connect_timeout_s=0.05)

    monkeypatch.setattr(options, "BoardAgent", Told)
    words = ["--watchdog", "7", "--silence", "3", "--window", "4", "--timeout", "9"]
    assert run(["hil", "board", "tcp://127.0.0.1:1", *words]) == ExitCode.NO_SESSION == 4
    assert made == {"watchdog_s": 7.0, "silence_s": 3.0, "window": 4, "connect_timeout_s": 9.0, "key": None}
    assert "nobody listens" in capsys.readouterr().err
    for bad in (["--watchdog", "0"], ["--silence", "nan"], ["--timeout", "-1"], ["--window", "0"]):
        assert run(["hil", "board", "tcp://127.0.0.1:1", *bad]) == 2
        assert f"{bad[0]} {bad[1]} is invalid" in " ".join(capsys.readouterr().err.split())


STUCK = f"""
import sys
sys.path.insert(0, {str(HARNESS)!r})
from estimators import Stuck
from flyaround.hil.board import agent
agent.estimator_factory = lambda *_: (Stuck, "tango", "")
from flyaround.__main__ import run
sys.exit(run(sys.argv[1:]))
"""


def test_a_board_of_the_workstation_that_hangs_ends_with_a_code_of_its_own():
    words = [sys.executable, "-c", STUCK, "hil", "board"]
    with hand_made_host() as host, started([*words, host.url, "--watchdog", "0.2"]) as board:
        host.meet(60.0)
        host.send_frame(1, level=7)
        assert "watchdog" in host.pose().reason
        assert board.wait(30.0) == ExitCode.WATCHDOG == 3
