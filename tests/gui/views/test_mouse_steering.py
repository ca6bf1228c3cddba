"""The mouse over the camera's picture flies only while hand control is armed."""

from __future__ import annotations

from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.views.mouse_steering import MouseSteering
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow


def test_wheel_and_drag_fly_only_while_hand_control_is_armed() -> None:
    window, console = HeadlessWindow(), console_flying("tango-space-10m")
    steering, io = MouseSteering(window), window.plain.get_io()
    box = Letterbox.fit((96, 60), (10.0, 40.0, 400.0, 300.0))

    def turn() -> None:
        with window.panel("view", 600.0, 600.0):
            steering.take(box, console)

    def use() -> list[str]:
        before = len(console.log.lines)
        io.add_mouse_pos_event(200.0, 180.0)
        turn()
        io.add_mouse_wheel_event(0.0, 1.0)
        turn()
        io.add_mouse_button_event(1, True)
        turn()
        io.add_mouse_pos_event(260.0, 180.0)
        turn()
        io.add_mouse_button_event(1, False)
        turn()
        return [line.name for line in console.log.lines[before:]]

    assert use() == []
    assert console.session.craft.mode == "guidance"
    assert "arm hand control" in console.messages[-1].text
    console.do("steer.arm", True)
    assert use() == ["steer.pulse", "steer.stick-thrust", "steer.stick-thrust"]
    assert console.session.craft.mode == "steer"
    console.close()
    window.close()
