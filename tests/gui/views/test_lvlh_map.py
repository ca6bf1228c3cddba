"""The LVLH map keeps its scale while the pointer works on it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from flyaround.gui.canvas import Canvas, point
from flyaround.gui.picture.relative_map import MapPort
from flyaround.gui.views.burn_nodes import handle
from flyaround.gui.views.lvlh_map import KEYS, LvlhMap
from tests.harness.pointer import FAR, Pointer


@pytest.fixture
def screen() -> Iterator[Pointer]:
    made = Pointer("tango-space-10m")
    made.console.do("layout.fly")
    made.console.do("burn.plan", 60.0, 0.0, 0.02, 0.0)
    for _ in range(4):
        made.turn()
    yield made
    made.close()


def test_the_scale_stays_while_a_handle_is_dragged_and_fits_again_after(screen: Pointer) -> None:
    view = next(panel for panel in screen.layout.panels if isinstance(panel, LvlhMap))
    craft, io = screen.console.session.craft, screen.window.plain.get_io()

    def port() -> MapPort:
        return view.ports[0]

    (burn,), before = craft.steering.burns.burns, port()
    x, y = handle(point(before.at(craft.predicted_burns().nodes_lvlh_m[0])), burn, before)
    screen.move((x, y))
    io.add_mouse_button_event(0, True)
    screen.turn()
    # a burn so large that the fitted map would show a much longer path
    for far in (40.0, 80.0, 120.0):
        screen.move((x, y - far))
        screen.turn()
        assert port() == before
    io.add_mouse_button_event(0, False)
    screen.turn()
    screen.move(FAR)
    for _ in range(3):
        screen.turn()
    assert port().scale < before.scale


def test_no_hover_text_covers_the_path_from_a_press_until_the_pointer_leaves_the_handle(
    screen: Pointer,
) -> None:
    view = next(panel for panel in screen.layout.panels if isinstance(panel, LvlhMap))
    craft, io = screen.console.session.craft, screen.window.plain.get_io()

    def handle_at() -> tuple[float, float]:
        (burn,), port = craft.steering.burns.burns, view.ports[0]
        return handle(point(port.at(craft.predicted_burns().nodes_lvlh_m[0])), burn, port)

    def tip() -> bool:
        for _ in range(4):
            screen.turn()
        return any("Tooltip" in part._owner_name for part in screen.window.plain.get_draw_data().cmd_lists)

    x, y = handle_at()
    screen.move((x, y))
    assert tip()
    for down in (True, False):
        io.add_mouse_button_event(0, down)
        assert not tip()
        screen.move((x + 4.0, y - 4.0))
        assert not tip()
    screen.move(FAR)
    screen.turn()
    screen.move(handle_at())
    assert tip()


@pytest.mark.parametrize("delta_v", [(0.0, 0.02, 0.0), (0.1, 0.3, 0.0)])
def test_a_burn_leaves_the_target_and_its_surroundings_readable(delta_v: tuple[float, float, float]) -> None:
    screen = Pointer("tango-flyaround")
    console = screen.console
    console.do("steer.toggle")
    screen.turn()
    before_m = console.options.map.width_m
    console.do("burn.plan", 60.0, *delta_v)
    for _ in range(4):
        screen.turn()
    assert console.options.map.width_m < 3.5 * before_m
    (view,) = (panel for panel in screen.layout.panels if isinstance(panel, LvlhMap))
    node = console.session.craft.predicted_burns().nodes_lvlh_m[0]
    assert all(port.inside(*port.at(node)) for port in view.ports)
    screen.close()


@pytest.mark.parametrize("delta_v", [(0.0, 3.0, 0.0), (-2.0, 0.5, 1.0), (0.0, 0.02, 0.0)])
def test_every_handle_is_inside_the_map_and_shows_that_it_can_be_dragged(
    screen: Pointer, delta_v: tuple[float, float, float]
) -> None:
    view = next(panel for panel in screen.layout.panels if isinstance(panel, LvlhMap))
    screen.console.do("burn.cancel")
    screen.console.do("burn.plan", 60.0, *delta_v)
    for _ in range(4):
        screen.turn()
    craft = screen.console.session.craft
    (burn,) = craft.steering.burns.burns
    cursor = screen.window.plain.MouseCursor_
    for port in view.ports:
        at = handle(point(port.at(craft.predicted_burns().nodes_lvlh_m[0])), burn, port)
        assert port.inside(*at)
        screen.move(at)
        for _ in range(4):
            screen.turn()
        assert screen.window.plain.get_mouse_cursor() == cursor.hand
        assert any("drag: size and direction of the burn" in text for text in screen.texts())
        screen.move(FAR)
        screen.turn()
        assert screen.window.plain.get_mouse_cursor() != cursor.hand


def drawn_texts(screen: Pointer, monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[float, float]]:
    """The texts that the map draws in a frame, with their places."""
    found: dict[str, tuple[float, float]] = {}
    real, left = Canvas.plain_text, screen.rect("lvlh-map")[0]

    def plain_text(canvas: Canvas, at: tuple[float, float], text: str, *rest: Any, **more: Any) -> None:
        found.update({text: at} if at[0] >= left else {})
        real(canvas, at, text, *rest, **more)

    with monkeypatch.context() as patched:
        patched.setattr(Canvas, "plain_text", plain_text)
        screen.turn()
    return found


def test_the_legend_names_what_the_map_has_above_it(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Pointer("tango-vbar-approach")
    made.console.do("layout.fly")
    for _ in range(14):
        made.turn()
    view = next(panel for panel in made.layout.panels if isinstance(panel, LvlhMap))
    found = drawn_texts(made, monkeypatch)
    names = {"chaser", "boresight", "target", "flown", "planned", "drift", "keep-out", "corridor"}
    assert {key.name for key in KEYS} & set(found) == names
    low = view.ports[0].rect[1] - 10.0
    _, y, _, _ = made.rect("lvlh-map")
    for name in names:
        assert y < found[name][1] < low
    made.console.do("burn.plan", 600.0, 0.0, 0.02, 0.0)
    made.turn()
    assert "burns" in drawn_texts(made, monkeypatch)
    made.console.do("layout.first")
    for _ in range(14):
        made.turn()
    assert "keep-out" not in drawn_texts(made, monkeypatch), "a small map has hover texts"
    made.close()


def test_the_map_of_a_docking_frames_the_last_metres() -> None:
    made = Pointer("tango-vbar-approach", panels=False, opened=("lvlh-map",))
    console, craft = made.console, made.console.session.craft
    view = next(panel for panel in made.layout.panels if isinstance(panel, LvlhMap))
    console.do("docking.approach")
    made.turn()
    far_m = view.ports[0].width_m
    chaser = craft.steered
    assert chaser is not None
    shares = 3.0 / np.linalg.norm(chaser.position_eci_m)
    near = tuple(shares * x for x in chaser.position_eci_m)
    craft.steered = dataclasses.replace(chaser, position_eci_m=near)
    made.move(FAR)
    for _ in range(3):
        made.turn()
    port = view.ports[0]
    assert port.width_m < min(far_m / 3, 20.0)
    assert port.inside(*point(port.at(craft.world.position_lvlh_m)))
    made.close()
