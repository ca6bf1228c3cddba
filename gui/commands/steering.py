"""Commands of the chaser: thrust and rotation while a key is held, and automatic modes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from flyaround.gui.command_table import Argument, Command, command, number, switch, word
from flyaround.gui.texts import texts
from flyaround.simulator.piloting.chaser_control import ATTITUDE_MODES
from flyaround.simulator.piloting.control_laws import NO_DEMAND, SWITCHES
from flyaround.simulator.piloting.orders import Centre, Control, FollowGuidance, Order, Pulse, Stop, TakeOver

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.messages import Level


def order(make: Callable[..., Order]) -> Callable[..., None]:
    """Return a command's function that gives the order made from its arguments."""
    return lambda console, *values: console.order(make(*values))


def _shares(*names: str) -> tuple[Argument, ...]:
    return tuple(number(name, "of what a key gives", -1.0, 1.0, "share") for name in names)


def _control(name: str, key: str, field: str, on: str, off: str) -> Command:
    """Return the switch of a field of the control between two values."""
    controls: dict[bool, dict[str, Any]] = {True: {field: on}, False: {field: off}}
    give = order(lambda state: Control(**controls[state]))
    return switch(name, give, lambda c: bool(getattr(c.session.craft.steering, field) == on), key, flies=True)


def _hold(name: str, console: Console, begins: bool) -> None:  # noqa: FBT001 - the form of a held command
    console.hand.hold(name, held=begins)


def _stop(console: Console) -> None:
    console.order(Stop())
    console.hand.let_go()


def _track(console: Console) -> None:
    console.order(Control(attitude="hold" if console.session.craft.tracking else "target"))


def _arm(console: Console, state: bool) -> None:  # noqa: FBT001 - a switch
    console.hand.armed = state
    if not state:
        console.hand.centre_sticks()
    text, by = "keys, mouse and gamepad fly the chaser", console.flown_by
    if by != "by hand":
        text = f"hand control is armed: {by} flies until a key, the mouse or the gamepad does"
    console.say(text if state else "hand control is off", over=lambda: state and console.flown_by != by)


def _toggle(console: Console) -> None:
    if console.session.craft.mode == "guidance":
        console.order(TakeOver())
    else:
        _reset(console, steered=False)


def _reset(console: Console, *, steered: bool = True) -> None:
    console.order(FollowGuidance(steered))
    console.hand.centre_sticks()


def _attitude(console: Console, mode: str | None = None) -> None:
    now = ATTITUDE_MODES.index(console.session.craft.steering.attitude)
    following = ATTITUDE_MODES[(now + 1) % len(ATTITUDE_MODES)]
    console.order(Control(attitude=next((m for m in ATTITUDE_MODES if m == mode), following)))


def _stick(part: str, console: Console, *shares: float) -> None:
    setattr(console.hand, part, shares)


def _stick_lost(console: Console) -> None:
    pushed = (console.hand.thrust, console.hand.turn) != (NO_DEMAND, NO_DEMAND)
    console.hand.centre_sticks()
    stopped = ": its thrust and rotation commands have stopped" * pushed
    level: Level = "warning" if pushed else "note"
    # ends when the chaser is flown again
    console.say(f"the gamepad was disconnected{stopped}", level, "steer.stick-thrust")


ATTITUDE = word("mode", "what is kept", ATTITUDE_MODES, optional=True)

COMMANDS = (
    switch("steer.arm", _arm, lambda console: bool(console.hand.armed), "ctrl+h", "insert"),
    *(
        Command(
            f"steer.{name}",
            name.replace("-", " ").capitalize(),
            text,
            partial(_hold, name),
            tuple(keys.split()),
            held=True,
            flies=True,
        )
        for name, (keys, text) in texts("held").items()
    ),
    command("steer.stop", _stop, "x", flies=True, state=lambda c: c.session.craft.steering.braking),
    command("steer.track", _track, "t", flies=True, state=lambda console: console.session.craft.tracking),
    command("steer.centre", order(Centre), "c", flies=True),
    command("steer.toggle", _toggle, "g", flies=True, state=lambda c: c.session.craft.mode == "guidance"),
    command("steer.reset", _reset, "ctrl+g", flies=True),
    _control("steer.lvlh", "n", "axes", "lvlh", "camera"),
    _control("steer.pulses", "m", "thrust", "pulse", "continuous"),
    command("steer.attitude", _attitude, "y", ATTITUDE, flies=True),
    command("steer.pulse", order(Pulse), word("direction", "as keys", SWITCHES), flies=True),
    command(
        "steer.stick-thrust", partial(_stick, "thrust"), *_shares("right", "down", "forward"), flies=True
    ),
    command("steer.stick-turn", partial(_stick, "turn"), *_shares("up", "right", "roll"), flies=True),
    command("steer.stick-lost", _stick_lost),
)
