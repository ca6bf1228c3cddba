"""A session with a board on the console's flight: real processes for host, link, drawing and board."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flyaround.gui.jobs.hil_session import BIN_EDGES_MS, HilSession
from flyaround.gui.jobs.hil_stream import DeclineCause, SessionNote
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.link_process.ipc import LinkConfig, Listening
from flyaround.hil.host.run import RunConfig
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.orders import PilotCommand
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.faults import Drop, GainStep
from flyaround.simulator.scenario.load import load_scenario

WAIT_S = 120.0


@pytest.fixture(scope="module")
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-flyaround"))


def config(session: FlightSession, log_dir: Path | None = None) -> RunConfig:
    link = LinkConfig(url="tcp://127.0.0.1:0", mode="lockstep", truth="off", timeout_s=10.0, adds_faults=True)
    target = session.plan.target
    return RunConfig(link=link, log_dir=log_dir, target_name=target.name, target_sha256=target.sha256)


class Turns:
    """The console's loop: the flight goes on, the session is kept up."""

    def __init__(self, hil: HilSession, session: FlightSession) -> None:
        self.hil, self.session = hil, session
        self.notes: list[SessionNote] = []
        self.longest_s = 0.0

    def until(self, done: Callable[[], bool]) -> None:
        end = time.monotonic() + WAIT_S
        while not done():
            assert time.monotonic() < end, f"it did not come: {self.notes}"
            self.session.step(PilotCommand(), 0.02)
            start = time.perf_counter()
            self.notes += self.hil.update(self.session)
            self.longest_s = max(self.longest_s, time.perf_counter() - start)
            time.sleep(0.02)


def row(
    frame_id: int, outcome: str, e2e_ms: float | None = None, faults: tuple[str, ...] = ()
) -> FrameRecord:
    return FrameRecord(
        frame_id=frame_id,
        epoch_utc="",
        t_s=0.1 * frame_id,
        exposure_s=1e-3,
        outcome=outcome,
        e2e_ms=e2e_ms,
        faults=faults,
    )


def test_rows_become_figures(session: FlightSession) -> None:
    hil = HilSession()
    for r in (
        row(0, "accepted", 120.0),
        row(1, "declined", 0.2),
        row(2, "dropped:timeout", faults=("drop",)),
        row(3, "dropped:timeout", faults=("drop", "delay")),
        row(4, "accepted", 1e6),
    ):
        hil._handle(r, [])
    assert (hil.sent, hil.outcomes["accepted"], hil.drops) == (5, 2, {"timeout": 2})
    assert hil.struck == {"drop": 2, "delay": 1}
    counts = hil.latency_counts()
    assert len(counts) == len(BIN_EDGES_MS) - 1
    assert counts.sum() == 3
    assert (counts[0], counts[-1]) == (1, 1)
    assert np.diff(BIN_EDGES_MS).min() > 0


def test_declined_pictures_are_counted_by_reason(session: FlightSession) -> None:
    hil, notes = HilSession(), []
    for k, reason in enumerate(("too dark", "too dark", "ambiguous", "too dark")):
        hil._handle(replace(row(k, "declined"), reason=reason), notes)
    assert hil.declined == {"too dark": 3, "ambiguous": 1}
    assert hil.rows[-1].reason == "too dark"
    assert [n.text for n in notes] == ["the board declines: too dark", "the board declines: ambiguous"]
    assert not any(n.warning for n in notes)


def test_a_declined_picture_says_why_and_what_to_do_once_for_each_cause(session: FlightSession) -> None:
    hil, notes = HilSession(), []
    causes = "the target is dark: 97% of it", "the target is dark: 98% of it", "", "the target is cut off: 9%"
    for k, cause in enumerate(causes):
        if cause:
            hil._handle(DeclineCause(k, cause), notes)
        hil._handle(replace(row(k, "declined"), reason="no target found"), notes)
    assert [n.text for n in notes] == [
        f"the board declines: no target found; {causes[0]}",
        f"the board declines: no target found; {causes[3]}",
    ]
    assert hil.cause == causes[3]
    assert hil.declined == {"no target found": 4}
    hil._handle(DeclineCause(4, causes[3]), notes)
    hil._handle(row(4, "accepted"), notes)
    assert hil.cause == "", "an accepted picture needs no remedy"


@pytest.mark.slow
def test_the_board_of_a_dark_flight_says_that_its_pictures_are_dark(tmp_path: Path) -> None:
    scenario = load_scenario("tango-space-10m")
    sensor = msgspec.structs.replace(scenario.sensor, exposure_s=1e-7)
    dark = FlightSession.of(msgspec.structs.replace(scenario, sensor=sensor))
    with contextlib.closing(HilSession()) as hil:
        turns = Turns(hil, dark)
        hil.start(dark, config(dark))
        hil.start_board("tango", "svd-2018")
        turns.until(lambda: bool(hil.declined))
        assert hil.cause.startswith("the target is dark: ")
        assert "exposure_s in Scenario text" in hil.cause
        assert any(hil.cause in n.text for n in turns.notes)
        hil.stop()


@pytest.mark.parametrize("here", [True, False])
def test_a_session_says_who_may_connect(*, here: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    with contextlib.closing(HilSession()) as hil:
        started: list[tuple[str, str]] = []
        monkeypatch.setattr(hil, "start_board", lambda *board: started.append(board))
        monkeypatch.setattr(HilSession, "on", True)
        if here:
            HilSession.start_board(hil, "tango", "hybrid")
        notes: list[SessionNote] = []
        hil._handle(Listening("tcp://127.0.0.1:5600", None), notes)
        (note,) = notes
        assert ("may connect" in note.text) == (not here)
        assert note.text.endswith("tcp://127.0.0.1:5600")
        assert bool(started) == here


def test_what_needs_a_session_says_so(session: FlightSession) -> None:
    hil = HilSession()
    assert hil.state == "off"
    assert hil.update(session) == []
    with pytest.raises(UserError, match="start one"):
        hil.add_fault(GainStep())
    with pytest.raises(UserError, match="no host listens"):
        hil.start_board("tango", "hybrid")
    hil.stop()
    hil.close()


@pytest.mark.slow
def test_a_board_answers_the_flight_and_faults_strike(session: FlightSession, tmp_path: Path) -> None:
    with contextlib.closing(HilSession()) as hil:
        turns = Turns(hil, session)
        hil.start(session, config(session, tmp_path / "hil"))
        # it starts once the host listens
        hil.start_board("tango", "hybrid")
        assert hil.board_running
        with pytest.raises(UserError, match="runs on this machine already"):
            hil.start_board("tango", "hybrid")
        turns.until(lambda: hil.outcomes["accepted"] >= 2)
        assert hil.state == "streaming"
        assert "method hybrid" in hil.board_name
        times = [r.t_s for r in hil.rows]
        assert times == sorted(times)
        assert all(r.E_R_deg is not None and r.E_R_deg < 5 for r in hil.rows if r.outcome == "accepted")
        # of the camera, and of the line, from now on for ten seconds of the flight
        now = session.t_s
        hil.add_fault(GainStep(start_s=now, end_s=now + 10, factor=3.0))
        hil.add_fault(Drop(start_s=now, end_s=now + 10, chance=1.0, direction="to_board"))
        turns.until(lambda: hil.struck["gain_step"] > 0 and hil.struck["drop"] > 0)
        assert hil.drops
        assert turns.longest_s < 2.0, "the window waited"
        hil.stop()
        turns.until(lambda: not hil.on)
        turns.until(lambda: not hil.board_running)
    assert (tmp_path / "hil" / "summary.json").is_file()
    assert any("run in a terminal: flyaround hil report" in n.text for n in turns.notes)
    assert any("the host ended the session" in n.text and not n.warning for n in turns.notes), turns.notes


@pytest.mark.slow
def test_a_host_that_dies_is_told_and_another_can_begin(session: FlightSession) -> None:
    with contextlib.closing(HilSession()) as hil:
        turns = Turns(hil, session)
        hil.start(session, config(session))
        turns.until(lambda: hil.url != "")
        assert hil.pid is not None
        os.kill(hil.pid, signal.SIGKILL)
        turns.until(lambda: not hil.on)
        assert turns.notes[-1].warning
        assert "unexpectedly" in turns.notes[-1].text
        # a port that is taken is said, too
        hil.start(session, config(session))
        turns.until(lambda: hil.url != "")
        with contextlib.closing(HilSession()) as second:
            other = Turns(second, session)
            link = LinkConfig(url=hil.url, mode="lockstep", truth="off", timeout_s=5.0)
            second.start(session, RunConfig(link=link))
            other.until(lambda: not second.on)
            assert "in use" in other.notes[-1].text
        # one that waits for a board is interrupted
        hil.stop()
        turns.until(lambda: not hil.on)


@pytest.mark.slow
def test_another_flight_ends_the_session(session: FlightSession) -> None:
    with contextlib.closing(HilSession()) as hil:
        turns = Turns(hil, session)
        hil.start(session, config(session))
        turns.until(lambda: hil.url != "")
        turns.session = FlightSession.of(load_scenario("tango-space-10m"))
        turns.until(lambda: not hil.on)
        assert "another flight" in " ".join(n.text for n in turns.notes)


@pytest.mark.slow
def test_a_ledger_whose_folder_is_gone_is_told(session: FlightSession, tmp_path: Path) -> None:
    with contextlib.closing(HilSession()) as hil:
        turns = Turns(hil, session)
        hil.start(session, config(session, tmp_path / "hil"))
        hil.start_board("tango", "hybrid")
        turns.until(lambda: hil.outcomes["accepted"] + hil.outcomes["declined"] >= 1)
        (tmp_path / "hil").rename(tmp_path / "elsewhere")
        hil.stop()
        turns.until(lambda: not hil.on)
        turns.until(lambda: not hil.board_running)
    told = [n.text for n in turns.notes if n.warning]
    assert any("cannot write" in text for text in told), turns.notes
    assert not any("Traceback" in text for text in told)
