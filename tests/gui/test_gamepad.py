"""A gamepad's states as commands: dead middle, even steps, buttons once, unplugged while it pushes."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.gui.app import command_table
from flyaround.gui.gamepad import BUTTONS, Gamepad, share, sticks
from flyaround.simulator.piloting.control_laws import ACCELERATION_M_S2
from tests.harness.flown_console import console_flying

FREE = (0.0, 0.0, 0.0, 0.0, -1.0, -1.0)
UP = (False,) * 15
TICK_MS = 20


def axes(**moved: float) -> tuple[float, ...]:
    names = ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")
    return tuple(moved.get(name, free) for name, free in zip(names, FREE, strict=True))


def test_the_middle_is_dead_and_the_ends_are_whole() -> None:
    assert share(0.1) == share(-0.1) == 0.0
    assert share(1.0) == 1.0
    assert share(-1.0) == -1.0
    assert share(0.5) == pytest.approx(0.45)


def test_sticks_push_and_turn_as_a_control_column_does() -> None:
    assert sticks(FREE, UP) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert sticks(axes(left_x=1.0, left_y=-1.0), UP)[0] == (1.0, -1.0, 0.0)
    assert sticks(axes(right_trigger=1.0), UP)[0] == (0.0, 0.0, 1.0)
    assert sticks(axes(left_trigger=1.0), UP)[0] == (0.0, 0.0, -1.0)
    # pulled back the nose goes up
    assert sticks(axes(right_x=-1.0, right_y=1.0), UP)[1] == (1.0, -1.0, 0.0)
    right = tuple(k == 5 for k in range(15))
    assert sticks(FREE, right)[1] == (0.0, 0.0, 1.0)


def test_what_does_not_change_is_told_once() -> None:
    pad = Gamepad()
    pushed = ("pad", axes(left_x=0.6), UP)
    assert pad.commands(pushed) == [("steer.stick-thrust", 0.55, 0.0, 0.0)]
    assert pad.commands(pushed) == []
    assert pad.commands(("pad", axes(left_x=0.605), UP)) == []
    assert pad.commands(("pad", FREE, UP)) == [("steer.stick-thrust", 0.0, 0.0, 0.0)]


def test_a_button_does_its_command_when_it_goes_down() -> None:
    pad = Gamepad()
    down = tuple(k == 1 for k in range(15))
    assert pad.commands(("pad", FREE, UP)) == []
    assert pad.commands(("pad", FREE, down)) == [("docking.abort",)]
    assert pad.commands(("pad", FREE, down)) == []
    # one that is down when the gamepad is plugged in has not been pressed
    assert Gamepad().commands(("pad", FREE, down)) == []


def test_every_button_is_a_command_that_there_is() -> None:
    table = command_table()
    assert len(BUTTONS) == 15
    for what in BUTTONS:
        if what:
            table[what[0]].checked(what[1:])


def test_unplugged_while_it_pushes_the_thrust_stops_and_a_warning_is_given() -> None:
    console = console_flying()
    pad = Gamepad()

    def turn(state: tuple[str, tuple[float, ...], tuple[bool, ...]] | None, times: int) -> None:
        for _ in range(times):
            for name, *arguments in pad.commands(state):
                console.steer(name, *arguments)
            console.pass_time(TICK_MS)

    console.do("steer.arm", True)
    turn(("pad", axes(right_trigger=1.0), UP), 50)
    assert console.session.craft.mode == "steer"
    spent = console.session.craft.steering.propellant.delta_v_m_s
    assert spent == pytest.approx(ACCELERATION_M_S2 * 1.0, rel=0.05)
    turn(None, 1)
    spent = console.session.craft.steering.propellant.delta_v_m_s
    turn(None, 50)
    assert console.session.craft.steering.propellant.delta_v_m_s == spent
    assert console.messages[-1].level == "warning"
    assert "gamepad was disconnected" in console.messages[-1].text
    # the log has it too, so that a script flies the same flight
    assert [line.name for line in console.log.lines][-1] == "steer.stick-lost"
    assert np.isfinite(console.session.craft.world.range_m)


def test_a_gamepad_flies_only_while_hand_control_is_armed() -> None:
    console = console_flying()
    pad = Gamepad()

    def turn(axes: tuple[float, ...], button: int | None = None) -> None:
        for name, *arguments in pad.commands(("pad", axes, tuple(k == button for k in range(15)))):
            console.steer(name, *arguments)
        console.pass_time(TICK_MS)

    turn(axes(right_trigger=1.0))
    for stop in (0, 3, 11):
        turn(axes(right_trigger=1.0), stop)
    assert console.session.craft.mode == "guidance"
    assert "arm hand control" in console.messages[-1].text
    # the guide button arms; a stick that was pushed before acts when it is moved
    turn(axes(right_trigger=1.0), 8)
    assert console.hand.armed
    assert console.session.craft.mode == "guidance"
    turn(axes(right_trigger=0.5))
    assert console.session.craft.mode == "steer"
    # disarmed while it pushes, the thrust stops
    turn(axes(right_trigger=0.5), 8)
    spent = console.session.craft.steering.propellant.delta_v_m_s
    turn(axes(right_trigger=0.5))
    assert console.session.craft.steering.propellant.delta_v_m_s == spent
    turn(axes(right_trigger=0.5), 1)
    assert console.session.craft.steering.doing == "abort"
    console.close()


def test_a_gamepad_that_rests_is_missed_without_alarm() -> None:
    console = console_flying()
    pad = Gamepad()
    for state in (("pad", FREE, UP), None, None):
        for name, *arguments in pad.commands(state):
            console.do(name, *arguments)
    assert [m.level for m in console.messages] == ["note"]
