"""Typed values: what is refused stays in its field with the reason, until it is mended or Esc brings the value back."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from flyaround.gui import style
from flyaround.gui.console import Console
from flyaround.gui.panels.board_link import BoardLinkPanel
from flyaround.gui.panels.capture import CapturePanel
from flyaround.gui.panels.lights import LightsPanel
from flyaround.gui.panels.picture import PicturePanel
from flyaround.gui.panels.sensor import SensorPanel
from flyaround.gui.panels.steering import SteeringPanel
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.readouts import mission_time
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.pointer import Pointer


@pytest.fixture
def console() -> Iterator[Console]:
    made = console_flying("tango-vbar-approach")
    made.do("burn.plan", 500.0, 0.0, 0.01, 0.0)
    yield made
    made.close()


class Typist:
    """Types into the fields of one panel, and sees the reasons beside them."""

    def __init__(self, window: HeadlessWindow, console: Console, panel: Panel) -> None:
        self.window, self.console, self.panel = window, console, panel
        self.reasons: list[str] = []
        self.shown: dict[str, str] = {}
        noted = self
        real = window.plain.input_text

        def input_text(label: str, text: str, *rest: object) -> object:
            changed, text = real(label, text, *rest)
            noted.shown[label] = text
            noted.colours[label] = window.plain.get_style_color_vec4(window.plain.Col_.text)
            low, high = window.plain.get_item_rect_min(), window.plain.get_item_rect_max()
            self.places[label] = ((low.x + high.x) / 2, (low.y + high.y) / 2)
            return changed, text

        self.colours: dict[str, Any] = {}
        self.places: dict[str, tuple[float, float]] = {}
        window.imgui.input_text = input_text
        self.turn()

    def turn(self) -> None:
        self.window.flaw = ""
        with self.window.panel("typed", 420.0, 1700.0):
            self.panel.draw(self.console)
        self.reasons = [self.window.flaw] if self.window.flaw else []

    def key(self, *names: str) -> None:
        io, keys = self.window.plain.get_io(), self.window.plain.Key
        for down in (True, False):
            for name in names:
                io.add_key_event(getattr(keys, name), down)
            self.turn()

    def type(self, field: str, text: str, *, end: str = "enter") -> None:
        io = self.window.plain.get_io()
        for down in (None, True, False):
            io.add_mouse_pos_event(*self.places[field])
            if down is not None:
                io.add_mouse_button_event(0, down)
            self.turn()
        self.key("mod_ctrl", "a")
        io.add_input_characters_utf8(text)
        self.turn()
        if end:
            self.key(end)
        self.turn()


def burn_s(console: Console) -> float:
    return console.session.craft.steering.burns.burns[0].t_s


@pytest.mark.parametrize("wrong", ["abc", "-5", "1,5", "1e99"])
def test_a_refused_text_stays_until_it_is_mended(
    window: HeadlessWindow, console: Console, wrong: str
) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##t0", wrong)
    assert typist.shown["##t0"] == wrong
    assert any("allowed: h:min:s, or seconds from 0" in reason for reason in typist.reasons)
    assert burn_s(console) == 500.0
    assert not console.messages.waiting, "a slip of the fingers is no caution of the flight"
    typist.type("##t0", "700")
    assert burn_s(console) == 700.0
    assert typist.reasons == []


def test_esc_brings_the_value_back(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##t0", "abc")
    typist.key("escape")
    typist.turn()
    assert typist.reasons == []
    assert typist.shown["##t0"] == "00:08:20.0"
    before = len(console.log.lines)
    typist.type("##t0", "800", end="escape")
    assert burn_s(console) == 500.0
    assert len(console.log.lines) == before


def test_leaving_a_field_takes_it(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##t0", "650", end="")
    typist.type("##v01", "0.002", end="tab")
    assert burn_s(console) == 650.0
    assert console.session.craft.steering.burns.burns[0].delta_v_lvlh_m_s == (0.002, 0.01, 0.0)


def test_a_refused_text_belongs_to_its_burn(window: HeadlessWindow, console: Console) -> None:
    console.do("burn.plan", 600.0, 0.0, 0.01, 0.0)
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##v01", "abc")
    console.do("burn.cancel", 500.0)
    typist.turn()
    assert typist.shown["##v01"] == "0"
    assert typist.reasons == []


@pytest.mark.parametrize("field", ["##t0", "##v01", "##v03"])
def test_a_burn_changed_on_the_map_shows_its_values(
    window: HeadlessWindow, console: Console, field: str
) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    before = typist.shown[field]
    typist.type(field, "1e9x")
    assert typist.shown[field] == "1e9x"
    console.do("burn.plan", 500.0, 0.0, 0.02, 0.0, 500.0)
    typist.turn()
    assert typist.shown[field] == before
    assert typist.reasons == []


def test_a_refused_text_stays_while_the_number_beside_it_is_typed(
    window: HeadlessWindow, console: Console
) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##v01", "1e9x")
    typist.type("##v02", "0.03")
    assert console.session.craft.steering.burns.burns[0].delta_v_lvlh_m_s == (0.0, 0.03, 0.0)
    assert typist.shown["##v01"] == "1e9x"
    assert typist.reasons


def test_a_value_that_undo_changes_is_shown(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, SensorPanel(window))
    before = typist.shown["##bits"]
    console.do("sensor.set", "bits", "10")
    typist.turn()
    typist.type("##bits", "many")
    assert typist.reasons
    console.do("settings.undo")
    typist.turn()
    assert typist.shown["##bits"] == before != "10"
    assert typist.reasons == []


def test_esc_and_a_change_of_layout_end_a_refusal(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, SteeringPanel(window))

    def hide() -> None:
        for _ in range(2):
            with window.panel("other", 420.0, 1700.0):
                pass

    for field, end in (("##t0", hide), ("##point1", hide), ("##point1", lambda: typist.key("escape"))):
        before = typist.shown[field]
        typist.type(field, "abc")
        assert typist.shown[field] == "abc"
        end()
        typist.turn()
        typist.turn()
        assert typist.shown[field] == before
        assert typist.reasons == []


def test_the_components_of_a_burn_are_three_equal_fields(window: HeadlessWindow, console: Console) -> None:
    panel = SteeringPanel(window)
    fields: dict[str, tuple[float, float]] = {}
    real = window.plain.input_text

    def input_text(label: str, text: str) -> object:
        given = real(label, text)
        fields[label] = (window.plain.get_item_rect_min().x, window.plain.get_item_rect_max().x)
        return given

    window.imgui.input_text = input_text
    for _ in range(2):
        with window.panel("narrow", 254.0, 1700.0):
            panel.draw(console)
    spans = [fields[f"##v0{axis}"] for axis in (1, 2, 3)]
    assert max(b - a for a, b in spans) - min(b - a for a, b in spans) < 1.0
    assert all(b - a > window.plain.calc_text_size("-0.00123").x for a, b in spans)
    assert all(0 < a < b < 254.0 for a, b in spans)
    assert spans[0][1] < spans[1][0] < spans[1][1] < spans[2][0]


def test_what_a_command_refuses_is_said_at_the_field(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, SensorPanel(window))
    typist.type("##bits", "99")
    assert typist.shown["##bits"] == "99"
    assert typist.reasons == ["Depth [bit] is 99, allowed: 8 to 16"]
    assert console.options.settings.sensor_changes == {}


@pytest.mark.parametrize(
    ("panel", "field", "wrong", "reason"),
    [
        (CapturePanel, "##frames", "0", "Capture: frames is '0', allowed: a whole number from 1 to"),
        (
            CapturePanel,
            "##workers",
            "many",
            "Capture: processes is 'many', allowed: a whole number from 1 to",
        ),
        (CapturePanel, "##film0", "3", "Film: width [px] is '3', allowed: a whole number from 16 to 7680"),
        (BoardLinkPanel, "##seconds", "abc", "Fault: seconds [s] is 'abc', allowed: a number from"),
        (
            SteeringPanel,
            "##point1",
            "abc",
            "Fly to: along [m] is 'abc', allowed: a number from -100000 to 100000",
        ),
    ],
)
def test_a_wrong_number_is_named_as_its_field_while_it_is_typed(
    window: HeadlessWindow, console: Console, panel: type[Panel], field: str, wrong: str, reason: str
) -> None:
    typist = Typist(window, console, panel(window))
    typist.type(field, wrong, end="")
    assert typist.shown[field] == wrong
    assert [r[: len(reason)] for r in typist.reasons] == [reason]


@pytest.mark.parametrize(
    ("field", "wrong", "reason"),
    [("##power_w", "-5", "Power [W] is -5"), ("##offset_m1", "abc", "Place [m] is '0,abc,0', allowed: ")],
)
def test_a_refused_value_of_a_light_stays_until_it_is_mended(
    window: HeadlessWindow, console: Console, field: str, wrong: str, reason: str
) -> None:
    console.do("light.add", "lamp")
    typist = Typist(window, console, LightsPanel(window))
    before = typist.shown[field]
    typist.type(field, wrong)
    assert typist.shown[field] == wrong
    assert [r[: len(reason)] for r in typist.reasons] == [reason]
    assert not console.messages.waiting
    typist.key("escape")
    typist.turn()
    assert typist.shown[field] == before
    typist.type(field, "7")
    assert typist.shown[field] == "7"
    assert typist.reasons == []


def test_a_refused_exposure_stays_until_it_is_mended(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, PicturePanel(window))
    typist.type("##stops", "99")
    assert typist.shown["##stops"] == "99"
    assert typist.reasons == ["Exposure: stops [powers of two] is '99', allowed: a number from -8 to 8"]
    typist.key("escape")
    typist.turn()
    assert typist.shown["##stops"] == "+0.0"
    typist.type("##stops", "1.5")
    assert console.options.settings.exposure_stops == 1.5


def drifting(console: Console) -> None:
    console.do("steer.toggle")
    console.do("time.rate", "100")
    for _ in range(10):
        console.pass_time(100)


@pytest.mark.parametrize("wrong", ["abc", "1e9"])
def test_esc_lets_a_refused_point_follow_the_chaser_again(
    window: HeadlessWindow, console: Console, wrong: str
) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##point1", wrong)
    assert typist.reasons == [f"Fly to: along [m] is '{wrong}', allowed: a number from -100000 to 100000"]
    typist.key("escape")
    drifting(console)
    typist.turn()
    assert typist.shown["##point1"] == f"{console.session.craft.state_lvlh()[0][1]:z.2f}"
    assert typist.reasons == []


@pytest.mark.parametrize("undo", ["escape", "delete"])
def test_a_typed_point_follows_again_after_esc_in_its_field_or_without_text(
    window: HeadlessWindow, console: Console, undo: str
) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##point1", "25")
    drifting(console)
    typist.turn()
    assert typist.shown["##point1"] == "25"
    typist.type("##point1", "" if undo == "delete" else "26", end=undo)
    typist.key("enter")
    typist.turn()
    assert typist.shown["##point1"] == f"{console.session.craft.state_lvlh()[0][1]:z.2f}"


def test_a_click_into_a_field_that_follows_is_no_input(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##point1", "", end="")
    drifting(console)
    typist.turn()
    typist.key("tab")
    typist.turn()
    typist.turn()
    assert typist.shown["##point1"] == f"{console.session.craft.state_lvlh()[0][1]:z.2f}"


def test_a_typed_number_looks_unlike_one_that_follows(window: HeadlessWindow, console: Console) -> None:
    typist = Typist(window, console, SteeringPanel(window))
    typist.type("##point1", "25")
    typist.turn()
    typed, follows = (typist.colours[f"##point{k}"] for k in (1, 0))
    assert [round(c, 3) for c in (typed.x, typed.y, typed.z)] == [round(c, 3) for c in style.INK[:3]]
    assert [round(c, 3) for c in (follows.x, follows.y, follows.z)] == [round(c, 3) for c in style.QUIET[:3]]


def test_the_end_of_a_film_follows_the_flight_again_after_esc(
    window: HeadlessWindow, console: Console
) -> None:
    typist = Typist(window, console, CapturePanel(window))
    typist.type("##film4", "abc")
    assert typist.reasons[0].startswith("Film: end [h:min:s or s] is 'abc', allowed: ")
    typist.key("escape")
    drifting(console)
    typist.turn()
    assert console.session.t_s > 50.0
    assert typist.shown["##film4"] == mission_time(console.session.t_s, whole=True)[2:]


def test_a_hover_text_shows_no_digits_that_nobody_typed(console: Console) -> None:
    place = (-0.123456789012345, 29.770000000000003, 1 / 3)
    (line,) = console.table["guidance.waypoint"].hover_text(*place).splitlines()[-1:]
    assert line == "guidance.waypoint -0.123457 29.77 0.333333"


@pytest.mark.parametrize("address", ["tcp://0.0.0.0:5600", "nonsense", "tcp://127.0.0.1:port"])
def test_the_address_of_a_board_is_framed_while_it_is_refused(address: str) -> None:
    screen = Pointer("tango-space-10m", opened=("board-link",))
    assert not screen.framed(style.BAD)
    screen.type(screen.sight("##url"), address)
    screen.turn()
    assert screen.framed(style.BAD)
    refusal = screen.console.attempt("hil.start", address)
    assert refusal
    assert any(refusal.startswith(text) for text in screen.texts() if len(text) > 20)
    screen.type(screen.sight("##url"), "tcp://127.0.0.1:5601")
    screen.turn()
    assert not screen.framed(style.BAD)
    screen.close()
