"""Quitting and editing ask before something is lost, and only then; jobs are named, and move nothing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.harness.pointer import Pointer


@pytest.fixture
def screen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Pointer]:
    monkeypatch.chdir(tmp_path)
    made = Pointer("tango-flyaround", panels=False)
    yield made
    made.close()


def test_a_flight_that_nobody_flew_is_left_without_a_question(screen: Pointer) -> None:
    screen.console.do("steer.arm")
    screen.menu("File", "Quit")
    assert screen.console.window.close


def test_a_flown_flight_asks_until_it_is_kept(screen: Pointer) -> None:
    console = screen.console
    console.do("steer.toggle")
    console.pass_time(200)
    screen.menu("File", "Quit")
    assert any("the flight of tango-flyaround, 0 s, is not kept" in text for text in screen.texts())
    screen.press("Stay")
    screen.turn()
    assert not console.window.close
    assert not screen.has("Stay")
    screen.menu("File", "Quit")
    screen.escape()
    screen.turn()
    assert not screen.has("Stay")
    screen.menu("File", "Quit")
    screen.press("Keep all flights")
    for _ in range(200):
        console.pass_time(20)
        if not console.jobs.keeping:
            break
    assert console.losses == []
    console.do("window.quit")
    assert console.window.close


def test_the_question_is_answered_by_its_button_or_by_asking_again(screen: Pointer) -> None:
    console = screen.console
    console.draft.edit("tango-flyaround")
    console.draft.changed = True
    console.do("window.quit")
    screen.turn()
    assert not console.window.close
    screen.press("Quit")
    assert console.window.close
    console.window.close = False
    console.do("window.quit")
    assert console.window.close


def test_each_running_job_and_the_flight_before_are_named(screen: Pointer) -> None:
    console = screen.console
    console.do("docking.approach")
    console._begin(type(console.session).of(console.session.plan.scenario), "")
    console.do("film.start")
    console.do("estimator.run")
    texts = console.losses
    assert len(texts) == 2, "an estimator loses nothing"
    assert texts[0].startswith("film 0 pictures")
    assert "is not kept" in texts[1]
    # at the end of a script nobody answers
    console.do("window.close")
    assert console.window.close


def test_every_flight_that_would_be_lost_is_named_reached_and_kept(screen: Pointer) -> None:
    console = screen.console
    for scenario in ("tango-vbar-approach", "tango-close-3m"):
        console.do("docking.approach")
        console.pass_time(200)
        console.do("scenario.open", scenario)
        screen.turn()
        screen.press(f"Fly {scenario}")
        while console.opener.is_busy():
            console.pass_time(0)
    console.do("docking.approach")
    console.pass_time(200)
    screen.menu("File", "Quit")
    names = ("tango-flyaround", "tango-vbar-approach", "tango-close-3m")
    for name in names:
        assert any(f"the flight of {name}, " in text and "is not kept" in text for text in screen.texts())
    screen.press("Stay")
    console.open_panel("flights", shown=True)
    screen.turn()
    screen.press("tango-flyaround")
    assert console.session.plan.scenario.name == "tango-flyaround"
    assert len(console.losses) == 3
    console.do("timeline.keep-all")
    for _ in range(500):
        console.pass_time(20)
        if not console.jobs.keeping:
            break
    assert console.losses == []
    assert len(console.flights.files) == 3


def test_a_flight_being_written_can_be_cancelled_and_leaves_nothing(screen: Pointer, tmp_path: Path) -> None:
    console = screen.console
    console.do("docking.approach")
    for _ in range(20):
        console.pass_time(200)
    console.do("timeline.keep", str(tmp_path / "mine"))
    screen.turn()
    assert any("writing the flight, 0%" in text for text in screen.texts())
    screen.press("Stop writing")
    assert not (tmp_path / "mine").exists()
    assert any("is not kept" in text for text in console.losses)
    # again, and whole, while the flight is restarted
    console.do("timeline.keep", str(tmp_path / "mine"))
    console.session.restart()
    while console.jobs.keeping:
        console.pass_time(0)
    assert (tmp_path / "mine" / "replay.toml").is_file()
    assert "duration_s = 4" in (tmp_path / "mine" / "replay.toml").read_text()


def test_editing_asks_before_a_changed_text_is_lost(screen: Pointer) -> None:
    console, draft = screen.console, screen.console.draft
    console.do("scenario.edit")
    original = draft.text
    console.do("scenario.edit")
    assert draft.replacement is None, "nothing would be lost"
    draft.text, draft.changed = "mine", True
    console.do("scenario.edit", "tango-vbar-approach")
    for _ in range(5):
        screen.turn()
    assert draft.text == "mine"
    assert any("and edit tango-vbar-approach?" in text for text in screen.texts())
    screen.press("Keep it")
    assert (draft.text, draft.replacement, draft.changed) == ("mine", None, True)
    # asked again, and answered
    console.do("scenario.edit")
    for _ in range(5):
        screen.turn()
    screen.press("Discard the changes")
    screen.turn()
    assert (draft.text, draft.replacement, draft.changed) == (original, None, False)
    assert not screen.has("Discard the changes")


def test_nothing_moves_when_a_job_begins_or_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    screen = Pointer("tango-flyaround")
    console = screen.console

    def places() -> list[tuple[float, ...]]:
        for _ in range(3):
            screen.turn()
        shown = [name for name, is_open in console.shown.items() if is_open]
        return [*map(screen.rect, [*shown, "jobs"]), screen.place("ABORT"), screen.place("Pause")]

    before = places()
    console.do("film.start")
    console.do("estimator.run")
    assert places() == before
    end = screen.place("Finish film###film.stop")
    console.do("estimator.run")
    assert places() == before
    assert not screen.has("Stop estimating###estimator.run")
    assert screen.place("Finish film###film.stop") == end
    # the next job takes the free column
    console.do("estimator.run")
    screen.turn()
    assert screen.place("Stop estimating###estimator.run")[0] < end[0]
    screen.close()


def test_escape_leaves_the_text_and_keeps_what_was_typed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    screen = Pointer("tango-flyaround", panels=False)
    draft = screen.console.draft
    screen.console.do("scenario.edit")
    for _ in range(5):
        screen.turn()
    assert any("not checked yet" in text for text in screen.texts())
    original = draft.text
    screen.click(screen.place("##text"))
    screen.window.plain.get_io().add_input_characters_utf8("!")
    screen.turn()
    assert len(draft.text) == len(original) + 1
    typed = draft.text
    screen.escape()
    for _ in range(5):
        screen.turn()
    assert draft.text == typed
    assert draft.changed
    assert not screen.window.plain.is_any_item_active()
    # leaving checks it, and the wrong line is shown
    assert draft.problem_line is not None
    wrong = typed.splitlines()[draft.problem_line - 1].strip()
    assert f"{draft.problem_line} | {wrong}" in screen.texts()
    # a second visit begins from the kept text
    screen.click(screen.place("##text"))
    screen.escape()
    assert draft.text == typed
    screen.close()


def test_the_buttons_of_the_question_stay_when_a_job_ends(screen: Pointer) -> None:
    console = screen.console
    console.do("docking.approach")
    console.pass_time(200)
    console.do("film.start")
    screen.menu("File", "Quit")
    before = [screen.place(label) for label in ("Keep all flights", "Quit###", "Stay")]
    console.do("film.stop")
    screen.turn()
    assert [screen.place(label) for label in ("Keep all flights", "Quit###", "Stay")] == before
    screen.press("Keep all flights")
    assert [screen.place(label) for label in ("Quit###", "Stay")] == before[1:]
    assert not screen.has("Keep all flights")


def test_time_stands_still_while_quitting_asks_and_runs_on_after_it(screen: Pointer) -> None:
    console = screen.console
    console.do("docking.approach")
    console.pass_time(200)
    screen.menu("File", "Quit")
    t_s = console.session.t_s
    for _ in range(10):
        console.pass_time(200)
    assert console.session.t_s == t_s
    screen.press("Keep all flights")
    while console.jobs.keeping:
        console.pass_time(20)
    assert console.losses == []
    screen.press("Stay")
    console.pass_time(200)
    assert console.session.t_s > t_s


def test_one_button_keeps_every_flight_and_quits(screen: Pointer) -> None:
    console = screen.console
    console.do("docking.approach")
    console.pass_time(200)
    screen.menu("File", "Quit")
    screen.press("Keep flights and quit")
    for _ in range(200):
        console.pass_time(20)
        screen.turn()
        if console.window.close:
            break
    assert console.window.close
    assert len(console.flights.files) == 1


def test_keeping_all_does_not_quit_over_a_text_that_is_not_saved(screen: Pointer) -> None:
    console = screen.console
    console.do("docking.approach")
    console.pass_time(200)
    console.draft.edit("tango-flyaround")
    console.draft.changed = True
    screen.menu("File", "Quit")
    screen.press("Keep flights and quit")
    while console.jobs.keeping:
        console.pass_time(20)
        screen.turn()
    assert not console.window.close
    assert any("the text of" in text for text in screen.texts())


@pytest.mark.parametrize("label", ["Dock", "Pause", "Camera"])
@pytest.mark.parametrize("question", ["quit", "question"])
def test_only_the_question_takes_clicks(question: str, label: str) -> None:
    screen = Pointer("tango-flyaround")
    console = screen.console
    console.do("docking.approach")
    console.pass_time(200)
    console.do(*(["window.quit"] if question == "quit" else ["scenario.open", "tango-close-3m"]))
    for _ in range(3):
        screen.turn()
    place = screen.menus.get(label) or screen.place(label)
    before = dict(console.shown), console.window.layout, console.session.clock.paused
    screen.click(place)
    assert (dict(console.shown), console.window.layout, console.session.clock.paused) == before
    assert not screen.opened
    # the question is still in front, and takes them
    screen.press("Stay")
    for _ in range(3):
        screen.turn()
    assert not console.shown[question]
    screen.click(place)
    now = dict(console.shown), console.window.layout, console.session.clock.paused
    assert screen.opened or now != (before[0] | {question: False}, *before[1:])
    screen.close()


@pytest.mark.parametrize("kept", [False, True])
def test_the_other_future_is_named(screen: Pointer, tmp_path: Path, *, kept: bool) -> None:
    console = screen.console
    console.do("steer.toggle")
    for _ in range(40):
        console.pass_time(200)
    assert not any("dropped future" in text for text in console.losses)
    console.do("timeline.seek", 2.0)
    console.do("timeline.fly-on", asks=False)
    console.pass_time(200)
    if kept:
        console.do("timeline.keep", str(tmp_path / "mine"))
        while console.jobs.keeping:
            console.pass_time(0)
    screen.menu("File", "Quit")
    (named,) = [text for text in screen.texts() if "dropped future" in text]
    assert "tango-flyaround" in named
    assert "6 s" in named
