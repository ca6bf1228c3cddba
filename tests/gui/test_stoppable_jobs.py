"""Every job of the console is named in the strip, with a command that ends it; opening and importing, too."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest

from flyaround.gui.app import unfinished_files
from flyaround.gui.jobs import scenario_opening
from flyaround.gui.jobs.all import running_jobs
from flyaround.simulator.piloting.session import FlightSession
from tests.harness.flown_console import console_flying


def test_an_opening_can_be_stopped_and_the_next_one_does_not_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    console, goes, real = console_flying(), threading.Event(), scenario_opening._open

    def slow(scenario: str, flies: bool) -> FlightSession:  # noqa: FBT001 - as called
        if scenario == "tango-night":
            goes.wait(60.0)
        return real(scenario, flies)

    monkeypatch.setattr(scenario_opening, "_open", slow)
    here = console.session
    console.do("scenario.open", "tango-night")
    (job,) = running_jobs(console.jobs, console.opener.name)
    console.do(job.end)
    console.pass_time(100)
    assert console.session is here
    assert here.t_s > 0
    console.do("scenario.open", "tango-space-10m")
    while console.opener.is_busy():
        console.pass_time(0)
    assert console.session.plan.scenario.name == "tango-space-10m"
    goes.set()
    console.close()


def test_an_import_can_be_stopped(tmp_path: Path) -> None:
    console = console_flying()
    mesh = tmp_path / "cube.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    console.do("file.open", str(mesh))
    (job,) = running_jobs(console.jobs)
    assert job.text == "importing cube"
    console.do(job.end)
    assert running_jobs(console.jobs) == []
    console.do("file.open-stop")
    assert console.messages.waiting == []
    console.close()


def test_flying_on_at_the_end_lets_time_run() -> None:
    console = console_flying()
    console.pass_time(200)
    console.do("time.pause")
    console.do("timeline.fly-on")
    assert not console.session.clock.paused
    console.do("timeline.fly-on")
    assert (console.messages.waiting, console.session.clock.rate) == ([], 1.0)
    console.close()


def test_all_jobs_end_at_the_same_time() -> None:
    console = console_flying()
    meeting = threading.Barrier(3, timeout=20.0)

    class Job:
        def close(self) -> None:
            meeting.wait()

    jobs: Any = console.jobs
    jobs.film, jobs.flight_film, jobs.mesh = Job(), Job(), Job()
    console.close()
    assert not meeting.broken


def test_jobs_that_finish_files_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    console = console_flying()
    assert unfinished_files(console) == []
    console.do("film.start")
    assert unfinished_files(console) == ["film 0 pictures"]
    console.close()
