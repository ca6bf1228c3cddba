"""A film of a whole flight: rendered by a program of its own, with progress, and nothing left if it is stopped."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import av
import pytest

from flyaround.gui.console import Console
from flyaround.gui.jobs.all import RunningJob, running_jobs
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer

pytestmark = pytest.mark.timeout(300)


@pytest.fixture
def console(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Console]:
    monkeypatch.chdir(tmp_path)
    made = console_flying("tango-space-10m")
    made.do("time.rate", "10")
    for _ in range(20):
        made.pass_time(200)
    made.do("time.pause")
    yield made
    made.close()


def row(console: Console) -> RunningJob | None:
    """The film in the strip of jobs, after a turn of the loop."""
    console.pass_time(20)
    time.sleep(0.02)
    return next((j for j in running_jobs(console.jobs) if j.end == "film.flight-stop"), None)


def test_a_part_of_the_flight_is_rendered_at_a_size_rate_and_speed(console: Console) -> None:
    console.do("picture.exposure", 1.0)
    console.do("film.flight", 160, 5.0, 10.0, 5.0, 35.0, "mine.mp4")
    while console.jobs.keeping:
        console.pass_time(20)
    assert not Path("mine.mp4").exists()
    shares = []
    while (job := row(console)) is not None:
        shares.append(job.share)
    assert console.messages[-1].text == "filmed mine.mp4", console.messages[-1]
    assert shares == sorted(shares)
    assert any(0.1 < share < 0.9 for share in shares)
    with av.open("mine.mp4") as film:
        stream = film.streams.video[0]
        assert (stream.width, stream.height) == (160, 100)
        assert stream.average_rate == 5
        assert stream.frames == 16
    # with the operator's exposure
    assert "exposure_s" in next(Path("out/console/flights").glob("*/replay.toml")).read_text()
    # the film exists: another name is needed
    assert "exists already" in console.attempt("film.flight", 160, 5.0, 10.0, 5.0, 35.0, "mine.mp4")


def test_a_stopped_film_leaves_nothing(console: Console, tmp_path: Path) -> None:
    console.do("film.flight", 640, 60.0)
    while console.jobs.keeping:
        console.pass_time(20)
    while not ((job := row(console)) and job.share):
        assert job is not None, console.messages[-1]
    assert any("film of the flight" in text for text in console.losses)
    assert "is being rendered" in console.attempt("film.flight")
    console.do(job.end)
    while row(console) is not None:
        pass
    assert "is not kept: it was stopped" in console.messages[-1].text
    assert console.messages.waiting == []
    assert [p for p in (tmp_path / "out" / "console").iterdir() if "mp4" in p.name] == []


def test_a_film_that_cannot_be_made_says_why(console: Console) -> None:
    console.do("film.flight", 160, 5.0, 10.0, 5.0, 999.0)
    while console.jobs.keeping:
        console.pass_time(20)
    while row(console) is not None:
        pass
    (caution,) = console.messages.waiting
    assert "choose --to within it" in caution.text


def test_the_capture_panel_says_how_long_the_film_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    screen = Pointer("tango-space-10m", panels=False, opened=("capture",))
    for _ in range(53):
        screen.console.pass_time(200)
    screen.turn()
    assert "1 s, 25 pictures" in screen.texts()
    screen.sight("Film the whole flight")
    screen.type(screen.sight("##film2"), "2")
    assert "5 s, 125 pictures" in screen.texts()
    # the label names the part
    screen.type(screen.sight("##film4"), "0:04")
    assert "2 s, 50 pictures" in screen.texts()
    assert screen.has("Film 00:00:00 to 0:04")
    assert not screen.has("Film the whole flight")
    # which ends with the flight
    console = screen.console
    console._begin(type(console.session).of(console.session.plan.scenario), "")
    screen.turn()
    assert screen.has("Film the whole flight")
    screen.close()


def test_a_film_that_would_end_before_its_start_is_refused(console: Console) -> None:
    assert console.attempt("film.flight", 160, 5.0, 1.0, 35.0, 5.0).startswith(
        "Film the whole flight: start is T+00:00:35.0"
    )
    assert console.attempt("film.flight", 160, 5.0, 1.0, 1e6).startswith(
        "Film the whole flight: start is T+277:46:40.0"
    )
    assert console.jobs.flight_film is None
