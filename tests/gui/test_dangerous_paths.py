"""A path through the keep-out sphere or into the target is coloured, and is a caution that ends with it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from flyaround.gui import style
from flyaround.gui.console import Console
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer

INWARD = (60.0, 0.0, -0.1, 0.0)
"""A burn towards the target, which the chaser is ahead of."""
THROUGH = "leads through the keep-out sphere of 12 m"


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-vbar-approach")
    made.do("docking.keep-out", "port")
    made.do("guidance.drift")
    made.do("steer.stop")
    for _ in range(20):
        made.pass_time(200)
    made.messages.acknowledge()
    yield made
    made.close()


def waiting(console: Console) -> list[str]:
    console.pass_time(100)
    return [m.text for m in console.messages.waiting if not m.text.startswith("the plume")]


def test_a_burn_into_the_sphere_is_a_caution_until_it_is_cancelled(console: Console) -> None:
    assert waiting(console) == []
    console.do("burn.plan", *INWARD)
    (caution,) = waiting(console)
    assert caution.startswith("a burn of 0.1000 m/s is planned at T+00:01:00.0")
    assert "the path with it leads " in caution
    console.do("burn.cancel")
    assert waiting(console) == []


def test_a_harmless_burn_is_none(console: Console) -> None:
    console.do("burn.plan", 60.0, 0.0, 0.0, 0.01)
    assert console.messages[-1].level == "note"
    assert waiting(console) == []


def test_a_drift_into_the_sphere_is_a_caution_until_it_is_stopped(console: Console) -> None:
    console.do("steer.attitude", "rate")
    console.do("steer.lvlh", True)
    for _ in range(20):
        console.do("steer.pulse", "back")
        console.pass_time(100)
    for _ in range(20):
        console.pass_time(100)
    assert any(text.startswith("the free drift leads ") for text in waiting(console)), waiting(console)
    console.do("guidance.hold")
    assert waiting(console) == []


def test_path_and_figure_are_coloured() -> None:
    at = Pointer("tango-vbar-approach", panels=False, opened=("lvlh-map", "steering"))
    console = at.console
    console.do("guidance.drift")
    console.do("burn.plan", 60.0, 0.0, 0.0, 0.01)
    drawn: list[tuple[str, style.Rgba]] = []
    for panel in at.layout.panels:
        widgets, real = panel._w, panel._w.one_line

        def one_line(text: str, rgba: style.Rgba, real=real) -> None:  # type: ignore[no-untyped-def]
            drawn.append((text, rgba))
            real(text, rgba)

        widgets.one_line = one_line  # type: ignore[method-assign]
    at.turn()
    assert not [text for text, colour in drawn if colour == style.BAD and "leads" in text]
    console.do("burn.plan", *INWARD)
    for _ in range(3):
        at.turn()
    assert [text for text, colour in drawn if colour == style.BAD and "leads" in text]
    at.close()


def test_risks_of_paths(console: Console) -> None:
    craft = console.session.craft
    axis = np.array(craft.sphere.corridor_axis_lvlh) if craft.sphere is not None else np.zeros(3)
    across = np.cross(axis, (1.0, 0.3, 0.2))
    across /= np.linalg.norm(across)
    # samples that lie outside on both sides
    assert craft.risk_of(np.array([30 * across + 5 * axis, -30 * across + 5 * axis])) == THROUGH
    assert craft.risk_of(np.array([30 * across, -30 * across])) == "leads into the target"
    assert craft.risk_of(np.array([30 * across, 13 * across])) == ""
    assert craft.risk_of(np.zeros((0, 3))) == ""
    console.do("docking.keep-out", "lifted", asks=False)
    assert craft.risk_of(np.array([30 * across + 5 * axis, -30 * across + 5 * axis])) == ""
