"""Hand control shows that something else flies, and the advice on the plume is for a pilot alone."""

from __future__ import annotations

from flyaround.gui.console import Console
from flyaround.simulator.piloting.chaser_control import PLUME_CAUTION
from tests.harness.flown_console import console_flying
from tests.harness.pointer import Pointer


def test_hand_control_is_only_armed_while_something_else_flies() -> None:
    at = Pointer("tango-vbar-approach", panels=False)
    console = at.console

    def hand() -> str:
        at.turn()
        return next(n.label for n in at.window.noted if n.label.startswith("HAND")).partition("#")[0]

    assert hand() == "HAND: OFF"
    console.do("steer.arm", True)
    assert hand() == "HAND: ARMED", "the scenario's guidance flies"
    console.do("guidance.drift")
    assert hand() == "HAND: ON"
    console.do("docking.approach", True)
    assert hand() == "HAND: ARMED"
    console.do("steer.pulse", "back")
    assert hand() == "HAND: ON"
    console.session.craft.docking.docked = True
    assert hand() == "HAND: DOCKED"
    at.close()


def test_arming_says_what_flies_until_a_key_does() -> None:
    console = console_flying("tango-vbar-approach")
    console.do("steer.arm", True)
    armed = "hand control is armed: scenario's guidance flies until a key, the mouse or the gamepad does"
    assert console.messages[-1].text == armed
    console.do("guidance.drift")
    console.do("steer.arm", True)
    assert console.messages[-1].text == "keys, mouse and gamepad fly the chaser"
    console.close()


def plume_told(console: Console) -> bool:
    struck = False
    for _ in range(60):
        console.pass_time(100)
        struck |= console.session.craft.steering.plume
    assert struck, "the plume never struck"
    return any(m.text == PLUME_CAUTION for m in console.messages)


def test_the_plume_of_a_controller_is_no_advice() -> None:
    console = console_flying("tango-space-10m")
    console.do("guidance.drift")
    for _ in range(5):
        console.do("steer.pulse", "forward")
        console.pass_time(200)
    console.do("steer.attitude", "target")
    for _ in range(5):
        console.pass_time(200)
    console.do("guidance.hold")
    assert not plume_told(console)
    console.do("guidance.drift")
    console.do("steer.pulse", "back")
    assert plume_told(console)
    console.close()
