"""The LVLH map keeps its scale while the pointer works on it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.canvas import point
from flyaround.gui.picture.relative_map import MapPort
from flyaround.gui.views.burn_nodes import handle
from flyaround.gui.views.lvlh_map import LvlhMap
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
    x, y = handle(point(before.at(craft.predicted_burns().nodes_lvlh_m[0])), burn, before.plane)
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
