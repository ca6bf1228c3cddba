"""Lights of a flight, changed by commands and by the pointer, and another target."""

from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

from flyaround.gui.console import Console
from flyaround.gui.picture.orbit_picture import orbit_scene
from flyaround.gui.picture.view_settings import apply_view_settings
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.state import SceneState
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-eclipse-lamp")
    yield made
    made.close()


def seen(console: Console) -> SceneState:
    """The scene of the next picture."""
    return apply_view_settings(console.session.scene(), console.options.settings)


def test_a_lamp_is_switched_changed_and_removed_in_the_next_picture(console: Console) -> None:
    own = console.session.scene().lamp
    assert own is not None
    console.do("light.switch", 0, False)
    assert seen(console).lamp is None
    console.do("light.switch", 0)
    console.do("light.set", 0, "power_w", "55")
    console.do("light.set", 0, "offset_m", "0.1,-0.2,0")
    assert seen(console).lamp == msgspec.structs.replace(own, power_w=55.0, offset_m=(0.1, -0.2, 0.0))
    console.do("light.remove", 0)
    assert seen(console).lamp is None
    console.do("settings.undo")
    console.do("light.reset")
    assert seen(console).lamp == own


def test_a_box_is_added_moved_and_seen_from_outside(console: Console) -> None:
    console.do("light.add", "box")
    console.do("light.set", 1, "frame", "target")
    console.do("light.set", 1, "position_m", "0,0,-3")
    (box,) = seen(console).area_lights
    assert box.frame == "target"
    np.testing.assert_array_equal(box.position_m, (0.0, 0.0, -3.0))
    options = console.options
    assert orbit_scene(console.session, options.settings, options.orbit, 2, None).area_lights == (box,)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("light.set 0 power_w -3", r"Power [W] is -3"),
        ("light.set 0 colour red", "colour"),
        ("light.set 7 power_w 3", "there is no light 7"),
        ("light.add lamp", "at most 1 lamp"),
    ],
)
def test_what_no_light_has_is_refused_and_changes_nothing(console: Console, line: str, why: str) -> None:
    before = seen(console)
    console.do_line(line)
    assert why in console.messages[-1].text
    assert seen(console) == before


def test_the_lights_of_here_are_those_of_a_new_flight(console: Console) -> None:
    console.do("light.add", "box")
    console.do("light.switch", 0, False)
    console.do("light.fly")
    scenario = console.opener.scenario
    assert scenario == msgspec.structs.replace(
        load_scenario("tango-eclipse-lamp"), lamp=None, lights=list(seen(console).area_lights)
    )


def test_another_scenario_has_its_own_lights(console: Console) -> None:
    console.do("light.add", "box")
    console.do("scenario.open", "tango-space-10m")
    while console.opener.is_busy():
        console.pass_time(0)
    assert not seen(console).area_lights


@pytest.mark.parametrize("size", [(800, 600), (1280, 800)])
def test_by_pointer_the_lamp_goes_out_and_a_box_is_added(size: tuple[int, int]) -> None:
    screen = Pointer("tango-eclipse-lamp", size)
    screen.menu("Camera", "Lights")
    screen.press("On")
    assert seen(screen.console).lamp is None
    screen.press("Add a box")
    assert len(seen(screen.console).area_lights) == 1
    screen.press("Remove", 1)
    assert not seen(screen.console).area_lights
    screen.close()


@pytest.mark.parametrize("panel", ["target", "scenarios"])
def test_a_new_flight_begins_after_a_question_only_if_something_was_flown(panel: str) -> None:
    screen = Pointer("tango-space-10m")
    console = screen.console
    console.open_panel(panel, shown=True)
    screen.turn()

    def choose() -> None:
        if panel == "target":
            x, y = screen.place("##scenario.target")
            screen.click((x, y))
            screen.click((x, y + 60.0))
        else:
            screen.press("##tango-close-3m")
        screen.turn()

    console.do("steer.toggle")
    for answer in ("Stay here", ""):
        choose()
        assert not console.opener.is_busy()
        assert any("Previous flight returns to it until you quit" in text for text in screen.texts())
        screen.press(answer or console.asked.answer)
        screen.turn()
        assert not screen.has("Stay here")
    assert console.opener.is_busy()
    screen.close()
    screen = Pointer("tango-space-10m")
    console = screen.console
    console.open_panel(panel, shown=True)
    screen.turn()
    choose()
    assert console.opener.is_busy()
    screen.close()


def test_a_typed_change_of_a_light_is_confirmed_and_the_picture_panel_leads_to_lights() -> None:
    screen = Pointer("tango-space-10m")
    console = screen.console
    screen.press("Lights###panel.lights")
    assert console.shown["lights"]
    console.do("light.add", "lamp")
    for _ in range(14):
        screen.turn()
    screen.type(screen.sight("##power_w"), "4000")
    assert "Lamp on the chaser: Power [W] is now 4000" in screen.texts()
    screen.close()


@pytest.mark.parametrize("kind", ["lamp", "box"])
def test_a_light_that_is_too_faint_at_the_target_says_so(kind: str) -> None:
    screen = Pointer("tango-space-10m", opened=("lights",))
    console = screen.console
    console.do("light.add", kind)
    field, power = ("power_w", 40.0) if kind == "lamp" else ("radiance_w_m2_sr", 500.0)

    def said() -> str:
        for _ in range(3):
            screen.turn()
        (text,) = [text for text in screen.texts() if "full scale" in text]
        return text

    faint = said()
    assert "too faint" in faint
    share = float(faint.partition("%")[0].split()[-1])
    console.do("light.set", 0, field, 10.0 * power)
    assert float(said().partition("%")[0].split()[-1]) == pytest.approx(10.0 * share, rel=0.1)
    # four stops are sixteen times the light
    console.do("light.set", 0, field, power)
    console.do("picture.exposure", 4.0)
    assert float(said().partition("%")[0].split()[-1]) == pytest.approx(16.0 * share, rel=0.1)
    assert "too faint" not in said()
    screen.close()


def test_a_lamp_that_lights_an_eclipse_is_not_called_faint() -> None:
    screen = Pointer("tango-eclipse-lamp", opened=("lights",))
    assert not any("too faint" in text for text in screen.texts())
    # a lamp lights what is in its beam
    screen.console.do("light.set", 0, "profile", "flat")
    screen.console.do("light.set", 0, "half_angle_deg", 0.5)
    screen.console.do("light.set", 0, "offset_m", "3,0,0")
    for _ in range(3):
        screen.turn()
    assert any("too faint" in text for text in screen.texts())
    screen.close()
