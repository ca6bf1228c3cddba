"""Commands of the chaser: thrust and turns as long as a key is held, and what flies when none is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import STATE, Argument, Command
from flyaround.simulator.piloting.chaser_control import ATTITUDE_MODES
from flyaround.simulator.piloting.control_laws import THRUST, TURN

if TYPE_CHECKING:
    from flyaround.gui.console import Console

DIRECTIONS = tuple(name.removeprefix("steer.") for name in (*THRUST, *TURN))


def _shares(*names: str) -> tuple[Argument, ...]:
    return tuple(
        Argument(name, "number", "of what a key gives", least=-1.0, most=1.0, unit="share") for name in names
    )


def _last(_console: Console, _begins: bool) -> None:  # noqa: FBT001 - the form of a held command
    """The session reads what is held itself, at every step."""


def _stop(console: Console) -> None:
    console.session.stop()


def _track(console: Console) -> None:
    console.session.toggle_tracking()


def _centre(console: Console) -> None:
    console.session.centre()


def _arm(console: Console, state: bool | None = None) -> None:  # noqa: FBT001 - a switch
    console.hand_control = not console.hand_control if state is None else state
    console.say("keys fly the chaser" if console.hand_control else "keys do not fly the chaser")


def _toggle(console: Console) -> None:
    console.session.toggle_steering()


def _reset(console: Console) -> None:
    console.session.reset_chaser()


def _lvlh(console: Console, state: bool | None = None) -> None:  # noqa: FBT001 - a switch
    steering = console.session.steering
    on = steering.axes != "lvlh" if state is None else state
    steering.axes = "lvlh" if on else "camera"


def _pulses(console: Console, state: bool | None = None) -> None:  # noqa: FBT001 - a switch
    steering = console.session.steering
    on = steering.thrust != "pulse" if state is None else state
    steering.thrust = "pulse" if on else "continuous"


def _attitude(console: Console, mode: str | None = None) -> None:
    now = ATTITUDE_MODES.index(console.session.steering.attitude)
    following = ATTITUDE_MODES[(now + 1) % len(ATTITUDE_MODES)]
    console.session.set_attitude(next((m for m in ATTITUDE_MODES if m == mode), following))


def _pulse(console: Console, direction: str) -> None:
    console.session.take_over()
    console.session.steering.pulse(f"steer.{direction}")


def _stick_thrust(console: Console, right: float, down: float, forward: float) -> None:
    console.session.steering.stick_thrust = (right, down, forward)


def _stick_turn(console: Console, up: float, right: float, roll: float) -> None:
    console.session.steering.stick_turn = (up, right, roll)


def _stick_lost(console: Console) -> None:
    steering = console.session.steering
    pushed = any(steering.stick_thrust) or any(steering.stick_turn)
    steering.stick_thrust = steering.stick_turn = (0.0, 0.0, 0.0)
    if pushed:
        console.say("the gamepad is gone: what it pushed and turned has stopped", "warning")
    else:
        console.say("the gamepad is gone")


_HELD = (
    ("forward", "w", "W", "thrust forward, along the boresight"),
    ("back", "s", "S", "thrust back"),
    ("left", "a", "A", "thrust left"),
    ("right", "d", "D", "thrust right"),
    ("up", "r", "R", "thrust up in the picture"),
    ("down", "f", "F", "thrust down in the picture"),
    ("pitch-up", "i up_arrow", "I / Up", "pitch up"),
    ("pitch-down", "k down_arrow", "K / Down", "pitch down"),
    ("yaw-left", "j left_arrow", "J / Left", "yaw left"),
    ("yaw-right", "l right_arrow", "L / Right", "yaw right"),
    ("roll-left", "u", "U", "roll left"),
    ("roll-right", "o", "O", "roll right"),
    ("coarse", "left_shift right_shift", "Shift", "five times as strong, while held"),
    ("fine", "left_ctrl right_ctrl", "Ctrl", "a fifth as strong, while held"),
)

COMMANDS = (
    Command(
        "steer.arm",
        "Hand control",
        "let keys fly the chaser; typing in a field and opening a scenario end it, abort (Del) needs none",
        _arm,
        ("ctrl+h", "insert"),
        "Ctrl+H / Insert",
        arguments=(STATE,),
        state=lambda console: console.hand_control,
    ),
    *(
        Command(
            f"steer.{name}",
            name.replace("-", " ").capitalize(),
            text,
            _last,
            tuple(keys.split()),
            shown,
            held=True,
            flies=True,
        )
        for name, keys, shown, text in _HELD
    ),
    Command("steer.stop", "Stop", "brake to rest beside the target (LVLH)", _stop, ("x",), "X", flies=True),
    Command(
        "steer.track",
        "Track",
        "the attitude follows the target; turn keys move its place in the picture",
        _track,
        ("t",),
        "T",
        flies=True,
        state=lambda console: console.session.tracking,
    ),
    Command(
        "steer.centre",
        "Centre",
        "bring the target to the middle and track it",
        _centre,
        ("c",),
        "C",
        flies=True,
    ),
    Command(
        "steer.toggle",
        "Steer by hand",
        "scenario's guidance / steering by hand",
        _toggle,
        ("g",),
        "G",
        flies=True,
        state=lambda console: console.session.mode == "steer",
    ),
    Command(
        "steer.reset", "Reset", "back onto the scenario's trajectory", _reset, ("home",), "Home", flies=True
    ),
    Command(
        "steer.lvlh",
        "LVLH axes",
        "W and S along the flight, A and D across it, R and F up and down; off: along the camera's axes",
        _lvlh,
        ("n",),
        "N",
        flies=True,
        arguments=(STATE,),
        state=lambda console: console.session.steering.axes == "lvlh",
    ),
    Command(
        "steer.pulses",
        "Pulses",
        "a press of a key gives 1 cm/s or 0.2 deg; off: as long as it is held",
        _pulses,
        ("m",),
        "M",
        flies=True,
        arguments=(STATE,),
        state=lambda console: console.session.steering.thrust == "pulse",
    ),
    Command(
        "steer.attitude",
        "Attitude",
        "rate: keep the rate; hold: keep the attitude (in LVLH axes: beside the target); target: keep it in view; "
        "dock: as when docked; left out: the next of them",
        _attitude,
        ("y",),
        "Y",
        flies=True,
        arguments=(Argument("mode", "word", "what is kept", ATTITUDE_MODES, optional=True),),
    ),
    Command(
        "steer.pulse",
        "One pulse",
        "1 cm/s, or 0.2 deg",
        _pulse,
        arguments=(Argument("direction", "word", "as of the keys", DIRECTIONS),),
    ),
    Command(
        "steer.stick-thrust",
        "Stick: thrust",
        "shares of a key's thrust, as a stick or the mouse gives them, until the next",
        _stick_thrust,
        arguments=_shares("right", "down", "forward"),
    ),
    Command(
        "steer.stick-turn",
        "Stick: turn",
        "shares of a key's turn rate, as a stick or the mouse gives them, until the next",
        _stick_turn,
        arguments=_shares("up", "right", "roll"),
    ),
    Command("steer.stick-lost", "Stick: gone", "what the stick pushed and turned stops", _stick_lost),
)
