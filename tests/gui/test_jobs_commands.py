"""Commands of the estimator, the board's link and captures: what they ask for, and what they refuse."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from flyaround.gui.app import command_table
from flyaround.gui.command_table import CommandTable
from flyaround.gui.commands.hil import FAULTS
from flyaround.gui.console import Console
from flyaround.gui.jobs.all import running_jobs
from flyaround.gui.jobs.capture_job import CaptureRequest
from flyaround.gui.picture.feed import Picture
from flyaround.gui.transport import JobStrip
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


@pytest.fixture(scope="module")
def table() -> CommandTable:
    return command_table()


@pytest.fixture
def console(table: CommandTable, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Console:
    monkeypatch.chdir(tmp_path)
    return console_flying(table=table)


@pytest.fixture
def asked(console: Console, monkeypatch: pytest.MonkeyPatch) -> list[CaptureRequest]:
    """What captures are asked for; none is started."""
    requests: list[CaptureRequest] = []
    monkeypatch.setattr(console.jobs.capture, "start", requests.append)
    return requests


def test_a_capture_of_the_flight_is_of_its_scenario(console: Console, asked: list[CaptureRequest]) -> None:
    console.do("capture.start", 5)
    assert asked[0].arguments == (
        "capture",
        "tango-flyaround",
        "-o",
        "out/console/set-tango-flyaround",
        "-n",
        "5",
    )
    console.do_line("capture.start 7 eval-black my-set coco,speed 3")
    assert " ".join(asked[1].arguments) == (
        "capture eval-black -o my-set -n 7 --format coco,speed --workers 3"
    )
    console.do("capture.start", 0)
    assert "from 1 to" in console.messages[-1].text
    assert len(asked) == 2


@pytest.mark.parametrize(("level", "word"), [(0, "dark"), (255, "burnt out"), (90, "")])
@pytest.mark.parametrize(
    ("line", "follows"),
    [
        ("film.start", True),
        ("film.flight", True),
        ("capture.start 5", True),
        ("capture.start 5 what-i-flew", True),
        ("capture.start 5 eval-black", False),
    ],
)
@pytest.mark.usefixtures("asked")
def test_a_film_and_a_capture_say_that_they_will_be_dark_or_burnt_out(
    console: Console, monkeypatch: pytest.MonkeyPatch, line: str, *, follows: bool, level: int, word: str
) -> None:
    film = SimpleNamespace(path=Path("film.mp4"), share=0.0, update=lambda: None, close=lambda: None)
    monkeypatch.setattr("flyaround.gui.commands.capture.FlightFilm", lambda *_: film)
    session, scene = console.session, console.session.scene()
    image = np.full((scene.camera.height_px, scene.camera.width_px), level, np.uint8)
    console.feed.newest = Picture(Frame(scene, image, NO_RADIANCE), session.state, session.plan.target, 1)
    console.pass_time(200)
    console.do_line(line)
    for _ in range(100):
        console.pass_time(20)
    said = next(m.text for m in console.messages if m.text.startswith(("filming", "rendering", "capturing")))
    assert ("Expose by the meter" in said) == (follows and bool(word))
    assert not follows or word in said
    if console.jobs.film is not None:
        console.do("film.stop")


def test_an_edited_flight_is_captured_as_it_was_edited(console: Console, asked: list[CaptureRequest]) -> None:
    edited = msgspec.structs.replace(load_scenario("tango-flyaround"), duration_s=30.0)
    console.session = FlightSession.of(edited)
    console.do("capture.start", 5)
    written = load_scenario(asked[0].what)
    assert written == edited


def test_going_on_needs_a_capture(console: Console) -> None:
    console.do("capture.resume")
    assert "start one" in console.messages[-1].text
    console.do("capture.stop")
    console.pass_time(0)


def test_an_estimator_that_runs_is_in_the_strip_of_jobs_with_a_button_that_ends_it(console: Console) -> None:
    assert running_jobs(console.jobs) == []
    console.do("estimator.run")
    (job,) = running_jobs(console.jobs)
    assert job.text == "hybrid starting"
    console.do(job.end)
    assert running_jobs(console.jobs) == []


def test_a_job_that_gives_nothing_yet_tells_how_long_it_is_at_work(
    console: Console, window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(console.opener, "is_busy", lambda: True)
    console.opener.name = "tango-limb"
    strip = JobStrip(window)
    texts = []
    for _ in range(8):
        window.noted.clear()
        with window.panel("jobs", 1200.0, 60.0):
            strip.draw(console)
        texts.append(next(n.label for n in window.noted if n.what == "text" and n.label))
    assert texts[0] == "opening tango-limb"
    assert texts[-1] == "opening tango-limb, 4 s"


def test_a_session_only_listens_where_it_may(console: Console) -> None:
    console.do("hil.start", "tcp://0.0.0.0:5600")
    assert "key" in console.messages[-1].text
    assert not console.jobs.hil.on
    console.do("hil.fault", "gain_step")
    assert "start one" in console.messages[-1].text
    console.do("hil.fault", "bogus")
    assert "allowed" in console.messages[-1].text
    console.do("hil.stop")
    console.do("hil.board-stop")
    console.pass_time(0)
    assert all(m.level == "note" for m in console.messages)


def test_every_fault_of_a_button_is_one_of_the_files(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    struck: list[msgspec.Struct] = []
    monkeypatch.setattr(console.jobs.hil, "add_fault", struck.append)
    for kind in FAULTS:
        console.do("hil.fault", kind, 3.0)
    assert [f.__struct_config__.tag for f in struck] == list(FAULTS)
    assert {(f.start_s, f.end_s) for f in struck} == {(0.0, 3.0)}  # type: ignore[attr-defined]


def test_the_estimator_is_switched_by_commands(console: Console) -> None:
    console.do("estimator.method", "svd-thesis")
    console.do("estimator.stages", True)
    console.do("estimator.run", True)
    assert (console.jobs.estimates.on, console.jobs.estimates.method) == (True, "svd-thesis")
    assert console.jobs.estimates.with_stages
    console.do("estimator.run")
    assert not console.jobs.estimates.on
    console.do("estimator.forget")
    console.pass_time(0)
    assert console.messages == []
    console.close()
