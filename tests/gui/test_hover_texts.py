"""Every panel's controls and figures tell what they are: panels are laid out without a window, with much to show."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flyaround.gui import hover_text, style
from flyaround.gui.app import command_table
from flyaround.gui.canvas import Canvas
from flyaround.gui.command_table import CommandTable
from flyaround.gui.console import Console
from flyaround.gui.jobs.capture_job import Thumbnail
from flyaround.gui.jobs.estimates import compared
from flyaround.gui.jobs.estimator_process import Answer
from flyaround.gui.panels.all import PANELS
from flyaround.gui.picture.feed import Feed, Picture
from flyaround.gui.picture.label_images import LABELS
from flyaround.simulator.camera.lens.camera_model import reduced_camera
from flyaround.simulator.frame import Frame, take_frame
from flyaround.simulator.piloting.docking_figures import judge_contact
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from tests.gui.jobs.test_hil_session import row
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import FIGURE, HeadlessWindow, Noted
from tests.harness.no_renderer import NoRenderer

pytest.importorskip("imgui_bundle", reason="the gui extra is not installed")

WORDS_ALONE = {"log", "keys", "help", "tour", "scenarios"}
"""Panels whose figures are parts of sentences, names and commands."""


@pytest.fixture(scope="module")
def table() -> CommandTable:
    return command_table()


@pytest.fixture(scope="module")
def frame() -> Frame:
    session = FlightSession.of(load_scenario("tango-space-10m"))
    scene = session.scene()
    scene = replace(scene, camera=reduced_camera(scene.camera, 4), quality="draft")
    with Renderer() as renderer:
        return take_frame(renderer, scene, session.plan.target, labels=LABELS)


@pytest.fixture(scope="module")
def console(frame: Frame, table: CommandTable) -> Console:
    """A flight with something in every panel: burns, bookmarks, a contact, estimates, a session, a capture."""
    console = console_flying("tango-vbar-closed-loop", table)
    session = console.session
    for line in ("burn.plan 60 0 0.02 0", "steer.pulse forward", "time.rate 1"):
        console.do_line(line)
    for _ in range(20):
        console.pass_time(100)
    for line in (
        "guidance.hold",
        "timeline.bookmark ends",
        "timeline.seek 1",
        "sensor.set gaussian_variance 0.003",
    ):
        console.do_line(line)
    raised = [m for m in console.messages if m.level != "note"]
    assert all("the path with it leads" in m.text or "would undo it" in m.text for m in raised), raised
    picture = Picture(frame, session.state, session.plan.target, 4)
    console.feed.newest = picture
    for feed in (console.feeds.setdefault(n, Feed(NoRenderer())) for n in ("orbit-camera", "labels")):
        feed.newest = picture
    answer = Answer(
        accepted=True,
        reason="",
        q_camera_from_target_wxyz=frame.scene.q_camera_from_target_wxyz,
        t_camera_from_target_m=frame.scene.t_camera_from_target_m,
        confidence=0.95,
        stages_ms={"propose": 40.0, "refine": 12.0},
    )
    console.jobs.estimates.on = True
    for k in range(3):
        console.jobs.estimates.newest = compared(picture, "hybrid", answer, float(k))
        console.jobs.estimates.history.append(console.jobs.estimates.newest)
    for k, outcome in enumerate(("accepted", "declined", "dropped:timeout")):
        console.jobs.hil._add(row(k, outcome, 80.0, ("drop",)))
    figures = session.craft.docking.figures(session.craft.chaser, session.flight)
    session.craft.docking.contacts.append(judge_contact(figures, session.craft.docking.limits, at_port=True))
    console.options.overlays.docking = console.options.overlays.times = True
    console.jobs.capture.thumbnails = [Thumbnail("000000.png", np.zeros((8, 12), np.uint8))]
    console.jobs.capture.outcome = "captured: 3 frames"
    console.draft.edit("tango-space-10m")
    # asks, because this flight is in no file
    console.do("time.restart")
    return console


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadlessWindow]:
    window = HeadlessWindow()
    told = window.noted

    tell = hover_text.item_tip

    def item_tip(imgui: Any, text: str, **options: Any) -> None:
        told.append(Noted("tip", text))
        tell(imgui, text, **options)

    def noting(draw: Any) -> Any:
        def letters(canvas: Canvas, at: Any, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
            told.append(Noted("text", text))
            if tip:
                told.append(Noted("tip", tip))
            draw(canvas, at, text, rgba, tip)

        return letters

    monkeypatch.setattr(hover_text, "item_tip", item_tip)
    monkeypatch.setattr(Canvas, "text", noting(Canvas.text))
    monkeypatch.setattr(Canvas, "plain_text", noting(Canvas.plain_text))
    yield window
    window.close()


def untold(noted: list[Noted], *, figures: bool) -> list[str]:
    """Controls, and texts with figures, that no hover text follows."""
    found = []
    for here, after in zip(noted, [*noted[1:], Noted("end", "")], strict=False):
        wants = here.what == "control" or (figures and here.what == "text" and FIGURE.search(here.label))
        if wants and not (after.what == "tip" and after.label):
            found.append(f"{here.what} '{here.label}'")
    return found


@pytest.mark.parametrize("panel", PANELS, ids=lambda p: p.name)
def test_every_control_and_figure_of_a_panel_is_told(
    panel: Any, console: Console, window: HeadlessWindow
) -> None:
    drawn = panel(window)
    for width in (420.0, 900.0):
        for _ in range(2):
            window.noted.clear()
            with window.panel(panel.name, width, 780.0):
                drawn.draw(console)
        assert window.noted or panel.name in {"parts", "camera"}
        assert untold(window.noted, figures=panel.name not in WORDS_ALONE) == [], panel.name


def test_a_control_tells_its_command_keys_units_and_line(table: CommandTable) -> None:
    save = table["picture.save"].hover_text()
    assert save.splitlines() == ["PNG and JSON into out/console (P / F12)", "picture.save"]
    told = table["guidance.vbar"].hover_text().splitlines()
    assert told[1] == "hold [m], 0.1 to 100000: from the target's centre of mass"
    assert told[-1] == "guidance.vbar [hold] [speed]"
    assert table["time.rate"].hover_text("10").splitlines()[-1] == "time.rate 10"
    assert "detail: how fine (auto, full, half, quarter)" in table["picture.detail"].hover_text()
    # what is switched needs no word on its one argument
    assert "state" not in table["overlay.box"].hover_text().splitlines()[1:-1]


def test_every_number_has_its_unit(table: CommandTable) -> None:
    numbers = [(c.name, a) for c in table for a in c.arguments if a.kind == "number"]
    assert len(numbers) > 20
    assert [name for name, a in numbers if not a.unit or not a.help] == []


def test_the_mouse_over_a_control_and_over_a_place_shows_it(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    imgui, io = window.plain, window.plain.get_io()
    told: list[str] = []
    monkeypatch.setattr(hover_text, "_show", lambda _, text: told.append(text))

    def rest(x: float, y: float) -> set[str]:
        for _ in range(4):
            io.add_mouse_pos_event(x, y)
            told.clear()
            with window.panel("one", 300.0, 400.0):
                imgui.begin_disabled()
                imgui.button("hello", imgui.ImVec2(200.0, 60.0))
                imgui.end_disabled()
                hover_text.item_tip(window.imgui, "the button")
                hover_text.area_tip(window.imgui, (40.0, 150.0), (80.0, 20.0), "the figure")
        return set(told)

    assert rest(60.0, 60.0) == {"the button"}
    assert rest(60.0, 160.0) == {"the figure"}
    assert rest(60.0, 260.0) == set()


def test_a_text_stays_off_what_was_clicked_until_the_pointer_has_left(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    imgui, io = window.plain, window.plain.get_io()
    told: list[str] = []
    monkeypatch.setattr(hover_text, "_show", lambda _, text: told.append(text))

    def rest(x: float, *, down: bool = False) -> list[str]:
        for _ in range(4):
            io.add_mouse_pos_event(x, 60.0)
            io.add_mouse_button_event(0, down)
            told.clear()
            with window.panel("one", 600.0, 400.0):
                imgui.button("hello", imgui.ImVec2(200.0, 60.0))
                hover_text.item_tip(window.imgui, "the button")
        return told

    assert rest(60.0)
    assert not rest(60.0, down=True)
    assert not rest(60.0)
    assert not rest(500.0)
    assert rest(60.0)


def hovering(window: HeadlessWindow, left: float, top: float, *, held: bool = False) -> Any:
    """The window of the hover text of a button, with the pointer on it; None without one."""
    imgui, io = window.plain, window.plain.get_io()
    for _ in range(4):
        io.add_mouse_pos_event(left + 10.0, top + 10.0)
        io.add_mouse_button_event(0, held)
        with window.panel("strip", *window.size):
            imgui.set_cursor_screen_pos(imgui.ImVec2(left, top))
            imgui.button("HAND: OFF", imgui.ImVec2(60.0, 20.0))
            hover_text.item_tip(window.imgui, "a text that is wider than what is left of the window " * 3)
    return imgui.internal.find_window_by_name("##Tooltip_00")


@pytest.mark.parametrize("left", [20.0, 640.0, 1200.0])
@pytest.mark.parametrize("top", [80.0, 750.0])
def test_a_text_lies_beside_its_control_and_within_the_window(
    window: HeadlessWindow, left: float, top: float
) -> None:
    tip = hovering(window, left, top)
    assert tip.size.x > 100.0
    assert tip.pos.x >= 0.0
    assert tip.pos.x + tip.size.x <= window.size[0]
    assert tip.pos.y >= top + 20.0 or tip.pos.y + tip.size.y <= top


@pytest.mark.parametrize("left", [0.0, 1000.0])
@pytest.mark.parametrize("top", [80.0, 400.0, 640.0])
def test_a_text_leaves_the_rows_of_its_panel_free(window: HeadlessWindow, left: float, top: float) -> None:
    imgui, io = window.plain, window.plain.get_io()
    for _ in range(4):
        io.add_mouse_pos_event(left + 30.0, top + 10.0)
        io.delta_time = 0.5
        imgui.new_frame()
        imgui.set_next_window_pos(imgui.ImVec2(left, 0))
        imgui.set_next_window_size(imgui.ImVec2(280.0, 700.0))
        imgui.begin("panel")
        imgui.set_cursor_screen_pos(imgui.ImVec2(left + 10.0, top))
        imgui.button("Stop board here", imgui.ImVec2(200.0, 20.0))
        hover_text.item_tip(window.imgui, "a text about the button, over several lines " * 5)
        imgui.end()
        imgui.render()
    tip = imgui.internal.find_window_by_name("##Tooltip_00")
    assert tip.size.x > 100.0
    assert tip.pos.x >= left + 280.0 or tip.pos.x + tip.size.x <= left
    assert tip.pos.x >= 0.0
    assert tip.pos.x + tip.size.x <= window.size[0]
    assert tip.pos.y + tip.size.y <= window.size[1]


def test_no_text_lies_over_what_is_pressed(window: HeadlessWindow) -> None:
    assert hovering(window, 640.0, 80.0, held=True) is None
