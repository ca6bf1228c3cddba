"""What ``flyaround hil board`` prints of what a host said."""

from __future__ import annotations

import threading

from hil_loop import CAMERA, Instant

from flyaround.__main__ import run
from flyaround.commands import hil as command
from hil.board.agent import run_board
from hil.link.packets.messages import Bye, Hello, HelloAck
from hil.link.session import Link
from hil.link.transports.tcp import TcpListener


def test_a_goodbye_in_brackets_is_printed_as_it_came(monkeypatch, capsys):
    # the real session with a real host; only the estimator is one that needs no pictures
    monkeypatch.setattr(command, "run_board", lambda url, *_, **__: run_board(url, make_estimator=Instant))
    listener = TcpListener("127.0.0.1", 0)

    def host() -> None:
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
