"""The slider of the rate in the strip: a double click sets 1x, also while the button is held."""

from __future__ import annotations

from tests.harness.pointer import Pointer


def test_a_double_click_on_the_rate_sets_1x() -> None:
    at = Pointer("tango-vbar-approach", panels=False)
    x, y = at.place("##rate")
    io = at.window.plain.get_io()
    at.move((x + 60.0, y))
    for down in (True, False, True):
        io.add_mouse_button_event(0, down)
        at.turn()
        if not down:
            assert at.console.session.clock.rate > 100.0
    at.turn()
    io.add_mouse_button_event(0, False)
    at.turn()
    assert at.console.session.clock.rate == 1.0
    at.drag((x, y), (x + 60.0, y))
    assert at.console.session.clock.rate > 100.0
    at.close()
