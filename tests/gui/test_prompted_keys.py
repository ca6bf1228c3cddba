"""Keys that a prompt names act, with hand control armed or not."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from flyaround.gui.console import UNARMED, Console
from flyaround.gui.views.docking_hud import status
from flyaround.simulator.piloting.docking_watch import Docking
from tests.harness.flown_console import console_flying


@pytest.fixture
def console(monkeypatch: pytest.MonkeyPatch) -> Iterator[Console]:
    monkeypatch.setattr(Docking, "not_ready", lambda *_: ())
    made = console_flying("tango-vbar-approach")
    yield made
    made.close()


def test_enter_is_a_go_where_the_prompt_names_it(console: Console) -> None:
    console.do("docking.approach", True)
    assert status(console)[0] == "H1 20 m: GO? (Enter)"
    assert not console.hand.armed
    console.press([console.table["docking.go"]])
    assert "go at H1" in console.messages[-1].text
    console.do("docking.no-go")
    assert status(console)[0].startswith("NO-GO")
    console.press([console.table["docking.go"]])
    assert "go at H1" in console.messages[-1].text


def test_elsewhere_neither_is_it_named_nor_does_it_act(
    console: Console, monkeypatch: pytest.MonkeyPatch
) -> None:
    go = console.table["docking.go"]
    for _ in range(2):
        assert "Enter" not in status(console)[0]
        console.press([go])
        assert console.messages[-1].text == f"Go: {UNARMED}"
        monkeypatch.setattr(Docking, "not_ready", lambda *_: ("too far",))
        console.do("docking.approach", True)


def test_other_keys_need_hand_control_at_a_hold_point_too(console: Console) -> None:
    console.do("docking.approach", True)
    console.press([console.table["steer.stop"]])
    assert console.messages[-1].text == f"Stop: {UNARMED}"
    assert console.session.craft.steering.autopilot
