"""Menus and the status line of the whole layout, laid out without a window."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from flyaround.gui.menus import MENUS, commands_of
from flyaround.gui.transport import GUARD_MS
from flyaround.gui.usable import NEEDS, is_usable
from tests.harness.pointer import FAR, Pointer


@pytest.fixture
def screen() -> Iterator[Pointer]:
    made = Pointer(panels=False)
    yield made
    made.close()


def test_escape_closes_a_menu_and_the_next_click_opens_it_again(screen: Pointer) -> None:
    for _ in range(4):
        screen.click(screen.menus["View"])
        assert "View" in screen.opened
        screen.escape()
        assert not screen.opened
        screen.window.plain.get_io().add_mouse_pos_event(*FAR)
        screen.turn()


@pytest.mark.parametrize("paused", [True, False], ids=["rests", "clicks at once"])
def test_a_click_on_another_menu_opens_that_one(screen: Pointer, *, paused: bool) -> None:
    screen.click(screen.menus["View"])
    for menu in ("Camera", "File", "Help"):
        if paused:
            screen.move(screen.menus[menu])
            screen.turn()
        screen.click(screen.menus[menu])
        assert [m for m in screen.opened if m in dict(MENUS)] == [menu]
    screen.click(screen.menus["Help"])
    assert not screen.opened


def test_the_status_line_shows_the_newest_caution_and_message(screen: Pointer) -> None:
    screen.console.say("the board is gone", "warning")
    screen.console.say("bad.toml is no scenario", "caution")
    screen.turn()
    assert any("bad.toml is no scenario (F9" in text for text in screen.texts())
    assert "the board is gone" in screen.texts()
    screen.console.say("saved a picture")
    screen.turn()
    # the caution stays, the newest message follows it
    assert any("bad.toml is no scenario (1 more" in text for text in screen.texts())
    assert "saved a picture" in screen.texts()
    screen.console.messages.acknowledge()
    screen.turn()
    assert "saved a picture" in screen.texts()
    # long ones share the line, and both can be read
    screen.console.say("a board that answers nothing " * 9, "caution")
    screen.console.say("kept the flight " * 15)
    screen.turn()
    for begins in ("a board that answers nothing a", "kept the flight kept the flight"):
        assert any(text.startswith(begins) and text.endswith("...") for text in screen.texts())


def test_the_result_of_a_job_stays_beside_a_caution_until_it_is_seen(screen: Pointer) -> None:
    console = screen.console
    console.say("too near", "caution")
    console.say("filmed out/view.mp4", of="film.flight")
    console.say("not aborted", "caution")
    screen.turn()
    assert "filmed out/view.mp4" in screen.texts()
    assert any("not aborted (1 more" in text for text in screen.texts())
    screen.press("CAUTION 2")
    screen.turn()
    assert "filmed out/view.mp4" not in screen.texts()


def test_help_is_about_the_panel_under_the_pointer() -> None:
    screen = Pointer("tango-space-10m", opened=("steering",))
    console = screen.console
    x, y, width, _ = screen.rect("steering")
    screen.click((x + width - 40.0, y + 8.0))
    x, y, width, height = screen.rect("lvlh-map")
    screen.move((x + width / 2, y + height - 20.0))
    screen.turn()
    console.do("help.panel")
    assert console.help.panel == "lvlh-map"
    screen.close()


def test_help_is_about_the_panel_clicked_last_if_the_pointer_is_over_none() -> None:
    screen = Pointer("tango-space-10m", opened=("steering",))
    console = screen.console
    x, y, width, _ = screen.rect("steering")
    # beside its tab
    screen.click((x + width - 40.0, y + 8.0))
    screen.move(screen.place("HAND: OFF"))
    screen.click(screen.place("HAND: OFF"))
    console.do("help.panel")
    assert console.help.panel == "steering"
    # the help itself is over the left part of the panel
    x, y, width, _ = screen.rect("picture")
    screen.click((x + width - 4.0, y + 60.0))
    console.do("help.panel")
    assert console.help.panel == "picture"
    # Dear ImGui's own frame is for the keyboard
    assert not screen.window.plain.get_current_context().nav_cursor_visible
    screen.close()


def test_the_picture_panel_says_that_a_stage_hides_the_camera() -> None:
    screen = Pointer("tango-space-10m")
    console = screen.console
    assert not screen.has("Show the camera")
    console.do("estimator.stage", "edges")
    for _ in range(14):
        screen.turn()
    assert "The view shows a stage of the estimator." in screen.texts()
    screen.press("Show the camera")
    for _ in range(14):
        screen.turn()
    assert not screen.has("Show the camera")
    assert {"stage", "camera"} <= {name for name, shown in console.shown.items() if shown}
    assert "stage" in console.help.behind
    screen.close()


def test_seven_menus_hold_every_command_once(screen: Pointer) -> None:
    offered = [c.name for c in screen.console.table if not c.held and c.at_once]
    held = [
        name
        for _, entries in MENUS
        for _, names in entries
        for entry in names
        for name in commands_of(screen.console.table, entry)
    ]
    assert len(MENUS) == 7
    # questions before something is lost, an answer, and what About this panel and Start the tour open
    left_out = {"panel.question", "panel.quit", "window.close", "panel.help", "panel.tour"}
    assert sorted(name for name in held if screen.console.table[name].at_once) == sorted(
        {*offered} - left_out
    )
    assert len({*held}) == len(held)
    for menu, entries in MENUS:
        seen = [title for title, _ in entries if title]
        for title, names in entries:
            entry_titles = [
                screen.console.table[n].title for e in names for n in commands_of(screen.console.table, e)
            ]
            assert len({*entry_titles}) == len(entry_titles), title
            seen += entry_titles if not title else []
        assert len({*seen}) == len(seen), menu


def test_an_entry_whose_command_needs_numbers_opens_its_panel(screen: Pointer) -> None:
    for path, panel in (
        (("Vehicle", "Burns", "Plan a burn"), "steering"),
        (("Vehicle", "Docking", "Keep-out sphere"), "docking"),
        (("Tools", "Hardware in the loop", "Fault"), "board-link"),
    ):
        screen.menu(*path)
        assert screen.console.shown[panel], path


def test_entries_with_nothing_to_act_on_are_grey(screen: Pointer, tmp_path: Path) -> None:
    console = screen.console

    def grey() -> set[str]:
        return {c.name for c in console.table if not is_usable(console, c.name)}

    assert grey() == NEEDS.keys()
    screen.menu("File", "Stop opening")
    assert console.messages == []
    console.do("burn.plan", 100.0, 0.0, 0.01, 0.0)
    console.do("film.start", str(tmp_path / "view.mp4"))
    console.do("timeline.bookmark", "here")
    console.say("too near", "caution")
    for name in ("burn.cancel", "film.stop", "timeline.unbookmark", "window.acknowledge"):
        assert name not in grey(), name
    console.do("film.stop")
    console.do("burn.cancel")
    assert {"film.stop", "burn.cancel"} <= grey()


def test_the_tour_has_one_entry_until_it_runs(screen: Pointer) -> None:
    console, steps = screen.console, {"help.tour-next", "help.tour-back", "help.tour-end"}
    (entries,) = (dict(entries)["Tour"] for menu, entries in MENUS if menu == "Help")
    offered = [name for entry in entries for name in commands_of(console.table, entry)]

    def usable() -> set[str]:
        return {name for name in offered if is_usable(console, name)}

    assert usable() == {"help.tour"}
    console.do("help.tour")
    assert usable() == {"help.tour", *steps} - {"help.tour-back"}
    console.do("help.tour-next")
    assert usable() == {"help.tour", *steps}
    console.do("help.tour-end")
    assert usable() == {"help.tour"}
    console.do("help.tour")
    assert console.help.tour_step == 1, "it goes on where it was closed"
    for _ in range(9):
        console.do("help.tour-next")
    assert usable() == {"help.tour", *steps} - {"help.tour-next"}
    console.do("help.tour")
    assert console.help.tour_step == 0


def test_abort_takes_two_clicks_and_its_guard_closes_by_itself(screen: Pointer) -> None:
    done: list[str] = []
    screen.console.do = lambda name, *_: done.append(name)  # type: ignore[method-assign]
    assert screen.place("HAND: OFF")
    abort = screen.place("ABORT")
    screen.click(abort)
    assert done == []
    screen.console.clock_ms += GUARD_MS
    screen.click(abort)
    assert done == []
    screen.click(abort)
    assert done == ["docking.abort"]


def test_a_panel_fills_the_window_until_escape(screen: Pointer) -> None:
    screen.console.do("window.enlarge", "lvlh-map")
    screen.turn()
    x, _, width, _ = screen.rect("enlarged")
    assert (x, width) == (0.0, screen.window.size[0])
    screen.escape()
    assert screen.console.window.enlarged == ""
    screen.console.do("window.enlarge", "no-such-panel")
    screen.turn()
    assert "there is no panel" in screen.console.messages[-1].text


def test_the_bar_names_the_scenario_that_is_flown() -> None:
    at = Pointer("tango-vbar-approach", panels=False)
    assert "tango-vbar-approach" in at.texts()
    at.close()
    narrow = Pointer("tango-vbar-approach", (800, 600), panels=False)
    assert narrow.has("Fly###layout.fly"), "it leaves the layouts their room"
    narrow.close()


def test_the_finder_is_as_tall_as_its_list() -> None:
    screen = Pointer("tango-space-10m", opened=("keys",))
    io = screen.window.plain.get_io()
    whole = screen.rect("keys")
    assert whole[3] > 600.0
    io.add_input_characters_utf8("docking.abort")
    for _ in range(4):
        screen.turn()
    x, y, wide, tall = screen.rect("keys")
    assert (x, y, wide) == whole[:3], "the typed line stays in its place"
    assert tall < 160.0
    left, top = screen.place("Abort")
    assert x < left < x + wide
    assert y < top < y + tall
    io.add_input_characters_utf8("xyz")
    for _ in range(4):
        screen.turn()
    x, y, wide, tall = screen.rect("keys")
    assert tall < 160.0
    assert "no command has 'docking.abortxyz'" in screen.texts()
    for _ in range(16):
        for down in (True, False):
            io.add_key_event(screen.window.plain.Key.backspace, down)
            screen.turn()
    for _ in range(3):
        screen.turn()
    assert screen.rect("keys") == whole
    screen.close()
