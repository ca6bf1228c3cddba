"""Commands of the link to a board: a session on this flight, a board of this machine, faults on purpose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from flyaround.gui.command_table import command, number, word
from flyaround.gui.jobs.program import FOLDER
from flyaround.gui.texts import texts
from flyaround.hil.board.method_names import HYBRID
from flyaround.hil.host.ledger.run_terms import Provenance
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig
from flyaround.hil.host.truth_policy import check_access
from flyaround.simulator.runtime.files import new_path
from flyaround.simulator.scenario.faults import CameraFault, LineFault

if TYPE_CHECKING:
    from flyaround.gui.console import Console

LISTEN = "tcp://127.0.0.1:5600"
POSE_S, CONNECT_S = 10.0, 600.0  # longest wait for a pose, and for a board
FAULT_S = 10.0  # duration of a fault unless given
FAULTS: dict[str, tuple[CameraFault | LineFault, str]] = {
    kind: (msgspec.convert({"kind": kind, **numbers}, CameraFault | LineFault), text)
    for kind, (text, numbers) in texts("faults").items()
}


def _start(console: Console, url: str | None = None) -> None:
    link = LinkConfig(url=url or LISTEN, mode="lockstep", truth="off", timeout_s=POSE_S, adds_faults=True)
    check_access(link)
    target = console.session.plan.target
    config = RunConfig(
        link=link,
        log_dir=new_path(FOLDER, f"hil-{console.session.plan.scenario.name}"),
        connect_timeout_s=CONNECT_S,
        target_name=target.name,
        target_sha256=target.sha256,
        provenance=Provenance.from_plan(console.session.plan),
    )
    console.jobs.hil.start(console.session, config, console.device_index)


def _board(console: Console, method: str | None = None, url: str | None = None) -> None:
    if not console.jobs.hil.on:
        _start(console, url)
    console.jobs.hil.start_board(console.session.plan.target.name, method or HYBRID)


def _fault(console: Console, kind: str, seconds: float | None = None) -> None:
    fault, text = FAULTS[kind]
    start = console.session.t_s
    length = FAULT_S if seconds is None else seconds
    console.jobs.hil.add_fault(msgspec.structs.replace(fault, start_s=start, end_s=start + length))
    session, text = console.session, f"fault {kind} for {length:g} s of the flight: {text}"
    console.say(text, over=lambda: session.t_s >= start + length)


URL = word("url", "tcp://HOST:PORT or serial:///DEVICE?baud=N to listen on", optional=True)
METHOD = word("method", "its estimator; hybrid unless given", optional=True)
LASTS = "how long it acts, in time of the flight; 10 unless given"
SECONDS = number("seconds", LASTS, 0.1, 3600.0, "s", optional=True)

COMMANDS = (
    command("hil.start", _start, URL),
    command("hil.stop", lambda console: console.jobs.hil.stop()),
    command("hil.board", _board, METHOD, URL),
    command("hil.board-stop", lambda console: console.jobs.hil.stop_board()),
    command("hil.fault", _fault, word("kind", "which one", tuple(FAULTS)), SECONDS),
)
