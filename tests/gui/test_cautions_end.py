"""Cautions wait until they are seen or until their cause ends."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from flyaround.gui.console import Console
from flyaround.gui.panels.steering import GUIDANCE
from flyaround.simulator.runtime.files import write_atomic
from tests.harness.flown_console import console_flying


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-space-10m")
    made.do("guidance.hold")
    yield made
    made.close()


def waiting(console: Console) -> list[str]:
    console.pass_time(20)
    return [m.text for m in console.messages.waiting]


def plan(console: Console, t_s: float = 500.0) -> None:
    console.do("burn.plan", t_s, 0.0, 0.01, 0.0)


def test_the_caution_of_a_burn_goes_with_it(console: Console) -> None:
    console.do("time.pause")
    plan(console)
    plan(console, 700.0)
    assert len(waiting(console)) == 2
    console.do("burn.cancel", 500.0)
    assert len(waiting(console)) == 1
    assert "T+00:11:40.0" in waiting(console)[0]
    console.do("guidance.drift")
    assert waiting(console) == []


@pytest.mark.parametrize(
    "guidance",
    [*(name for name in GUIDANCE if name != "guidance.drift"), "docking.approach", "steer.toggle"],
)
def test_any_guidance_chosen_after_a_burn_was_planned_is_a_caution(guidance: str) -> None:
    console = console_flying("tango-vbar-approach")
    console.do("time.pause")
    plan(console)
    assert waiting(console) == []
    console.do("docking.keep-out", "port")
    for name in ("guidance.hold", guidance):
        console.do(name, *[True] * (name == "docking.approach"))
        (text,) = waiting(console)
        assert "0.0100 m/s is planned at T+00:08:20.0, but " in text
        assert text.endswith(" would undo it: choose Free drift first")
    assert ("station keeping would" in text) == (guidance == "guidance.hold")
    console.do("guidance.drift")
    assert waiting(console) == []
    console.close()


def test_the_caution_of_a_plume_goes_once_it_is_clear(console: Console) -> None:
    for command, *value in (("guidance.drift",), ("steer.attitude", "target"), ("steer.arm", True)):
        console.do(command, *value)
    strikes = "the plume strikes the target: push sideways, or from farther away"
    for _ in range(2):
        for _ in range(100):
            console.pass_time(100, frozenset({"steer.back"}))
            if console.messages.waiting:
                break
        assert waiting(console) == [strikes]
        console.do("time.rate", "10")
        for _ in range(10):
            console.pass_time(200)
        console.do("time.rate", "1")
        assert waiting(console) == []


def about(console: Console, folder: Path) -> list[str]:
    """Waiting cautions that name a folder."""
    return [text for text in waiting(console) if str(folder) in text]


WRITING = ("log.save", "film.start", "timeline.keep", "capture.start", "window.screenshot")


def write(console: Console, command: str, folder: Path) -> None:
    """Have a command write into a folder."""
    endings = {"log.save": ".script", "film.start": ".mp4", "window.screenshot": ".png"}
    path = str(folder / f"result{endings.get(command, '')}")
    console.do(command, *((3, "tango-space-10m", path) if command == "capture.start" else (path,)))
    request, console.window.screenshot = console.window.screenshot, None
    if request is not None:
        console.save(request, lambda path: write_atomic(path, b"a picture"), command)


@pytest.mark.parametrize("command", WRITING)
def test_the_caution_of_a_folder_goes_once_it_can_be_written(
    console: Console, command: str, tmp_path: Path
) -> None:
    console.pass_time(200)
    # a file in its way stops the superuser, too
    blocked = tmp_path / "blocked"
    blocked.write_text("")
    write(console, command, blocked / "deeper")
    for _ in range(30):
        assert len(about(console, tmp_path)) == 1
        console.pass_time(100)
    assert str(blocked) in about(console, tmp_path)[0]
    blocked.unlink()
    for _ in range(15):
        console.pass_time(100)
    assert about(console, tmp_path) == []


@pytest.mark.parametrize("command", ["log.save", "film.start", "timeline.keep", "window.screenshot"])
def test_the_caution_of_a_folder_goes_when_another_one_is_written(
    console: Console, command: str, tmp_path: Path
) -> None:
    console.pass_time(200)
    (tmp_path / "blocked").write_text("")
    write(console, command, tmp_path / "blocked" / "deeper")
    assert len(about(console, tmp_path)) == 1
    write(console, command, tmp_path)
    for _ in range(30):
        console.pass_time(20)
    assert about(console, tmp_path) == []


def test_the_caution_of_a_refused_command_goes_once_it_is_done(console: Console) -> None:
    console.do("time.pause")
    console.do("guidance.vbar", 0.2)
    console.do("picture.detail", "full")
    assert len(waiting(console)) == 1
    console.do("guidance.vbar", 12.0)
    assert waiting(console) == []


def test_other_cautions_stay(console: Console) -> None:
    console.do("time.pause")
    console.say("the disk is full", "caution")
    assert waiting(console) == ["the disk is full"]
