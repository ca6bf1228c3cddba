"""An operator's tasks by mouse alone, in a small, a usual and a large window; each click is counted."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from flyaround.gui.canvas import point
from flyaround.gui.layout import NARROW
from flyaround.gui.views.burn_nodes import handle
from flyaround.gui.views.lvlh_map import LvlhMap
from tests.harness.pointer import Pointer

SIZES = ((800, 600), (1280, 800), (1920, 1080))
BESIDE = frozenset(
    {
        *("hil.start", "hil.board", "capture.start", "estimator.run", "film.start"),
        *("scenario.open", "scenario.target", "picture.save", "timeline.dataset", "timeline.keep"),
    }
)
"""Commands that start processes or threads; here they are noted, not done."""


@pytest.fixture(params=SIZES, ids=lambda s: f"{s[0]}x{s[1]}")
def at(request: pytest.FixtureRequest) -> Iterator[Pointer]:
    made = Pointer("tango-vbar-closed-loop", request.param)
    done: list[str] = []
    real = made.console.attempt

    def attempt(name: str, *arguments: Any, **options: Any) -> str:
        done.append(name)
        return "" if name in BESIDE else real(name, *arguments, **options)

    made.console.attempt = attempt  # type: ignore[method-assign]
    made.done = done  # type: ignore[attr-defined]
    yield made
    made.close()


def layout(at: Pointer, title: str) -> None:
    """Choose a layout at the right end of the menu bar."""
    at.press(f"{title}###layout")
    for _ in range(14):
        at.turn()


def change_scenario(at: Pointer) -> None:
    at.menu("File", "Scenarios")
    at.press("##tango-close-3m")


def move_by_five_metres(at: Pointer) -> None:
    layout(at, "Fly")
    at.press("Counted from here")
    at.type(at.sight("##point0"), "5")
    at.press("Fly there")


def dock(at: Pointer) -> None:
    layout(at, "Dock")
    at.press("Autopilot")
    at.press("Go")


def estimate(at: Pointer) -> None:
    layout(at, "Estimate")
    at.press("Estimate###estimator.run")
    at.press("Stages as pictures")


def expose(at: Pointer) -> None:
    at.press("Expose by the meter")
    at.press("Noise")
    at.press("Colour")


def expose_by_hand(at: Pointer) -> None:
    x, y = at.sight("##exposure")
    at.drag((x, y), (x + 40.0, y))
    assert at.console.options.settings.exposure_stops > 0.2
    # back to the scenario's own
    at.click((x, y), button=1)
    assert at.console.options.settings.exposure_stops == 0.0


def choose_another(at: Pointer, label: str) -> None:
    """Open a list of choices and click its second or third entry."""
    x, y = at.sight(label)
    at.click((x, y))
    at.click((x, y + 40.0))


def change_camera(at: Pointer) -> None:
    at.menu("Camera", "Sensor")
    choose_another(at, "##camera.use")
    assert at.console.options.settings.camera is not None


def change_target(at: Pointer) -> None:
    at.menu("Camera", "Target")
    choose_another(at, "##scenario.target")


def change_a_light(at: Pointer) -> None:
    at.menu("Camera", "Lights")
    at.press("Add a lamp")
    at.type(at.sight("##power_w"), "55")
    at.press("On")


def plan_and_drag_a_burn(at: Pointer) -> None:
    layout(at, "Fly")
    if at.window.size[0] < NARROW:
        at.menu("View", "Maps", "LVLH map")
    view = next(panel for panel in at.layout.panels if isinstance(panel, LvlhMap))
    craft = at.console.session.craft
    port = view.ports[0]
    seen = [
        place for place in map(point, port.at(craft.predicted_burns().points_lvlh_m)) if port.inside(*place)
    ]
    at.click(seen[len(seen) // 2], button=1)
    for _ in range(5):
        at.turn()
    (burn,), port = craft.steering.burns.burns, view.ports[0]
    x, y = handle(point(port.at(craft.predicted_burns().nodes_lvlh_m[0])), burn, port)
    at.drag((x, y), (x, y + 24.0))
    (dragged,) = craft.steering.burns.burns
    assert dragged.t_s == burn.t_s
    assert dragged.delta_v_lvlh_m_s[0] < burn.delta_v_lvlh_m_s[0]


def eclipse(at: Pointer) -> None:
    at.menu("Flight", "Jump to", "Jump to the next eclipse")
    x, y = at.place("##rate")
    at.click((x + 30.0 * at.window.scale, y))


def look_back_and_fly_on(at: Pointer) -> None:
    for _ in range(20):
        at.console.pass_time(100)
    at.turn()
    x, y = at.place("##t")
    at.drag((x + 20, y), (x - 20, y))
    at.press("Fly on" if at.has("Fly on") else "###timeline.fly-on")


def film(at: Pointer) -> None:
    at.menu("File", "Export", "Film the view")


def data_set(at: Pointer) -> None:
    layout(at, "Capture")
    at.press("Capture###capture.start")


def board(at: Pointer) -> None:
    layout(at, "Link")
    at.press("Start session")
    at.press("Start board here")


def abort(at: Pointer) -> None:
    at.press("ABORT")
    at.press("ABORT? again")


TASKS: dict[Callable[[Pointer], None], tuple[tuple[str, ...], int]] = {
    change_scenario: (("scenario.open",), 3),
    move_by_five_metres: (("guidance.waypoint",), 4),
    dock: (("docking.approach", "docking.go"), 3),
    estimate: (("estimator.run", "estimator.stages"), 3),
    expose_by_hand: (("picture.exposure",), 2),
    change_camera: (("camera.use",), 4),
    change_target: (("scenario.target",), 4),
    change_a_light: (("light.add", "light.set", "light.switch"), 5),
    plan_and_drag_a_burn: (("burn.plan",), 5),
    expose: (("picture.meter", "picture.noise", "picture.colour"), 3),
    eclipse: (("time.next-eclipse", "time.rate"), 4),
    look_back_and_fly_on: (("timeline.seek", "timeline.fly-on"), 2),
    film: (("film.start",), 3),
    data_set: (("capture.start",), 2),
    board: (("hil.start", "hil.board"), 3),
    abort: (("docking.abort",), 2),
}
"""Commands that a task ends in, and the most clicks that it may take."""


@pytest.mark.parametrize("task", TASKS, ids=lambda t: t.__name__)
def test_a_task_takes_few_clicks(
    at: Pointer, task: Callable[[Pointer], None], record_property: Callable[[str, object], None]
) -> None:
    commands, most = TASKS[task]
    task(at)
    assert [name for name in commands if name not in at.done] == []  # type: ignore[attr-defined]
    record_property("clicks", at.clicks)
    assert at.clicks <= most


def test_the_tour_lies_beside_the_list_of_scenarios_at_the_first_start() -> None:
    first = Pointer(opened=("scenarios", "tour"))
    assert first.has("Skip this")
    assert first.has("##find")
    first.close()


def test_a_menu_brings_a_panel_behind_a_tab_to_the_front_and_then_closes_it() -> None:
    narrow = Pointer(size=(800, 600))
    shown = narrow.console.shown
    narrow.menu("Camera", "Target")
    assert shown["target"]
    assert any("triangles" in text for text in narrow.texts())
    narrow.menu("Camera", "Target")
    assert not shown["target"]
    narrow.close()
