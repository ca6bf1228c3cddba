"""Commands of the clock."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from flyaround.gui.command_table import Command, command, word
from flyaround.simulator.piloting.clock import RATES
from flyaround.simulator.piloting.jumps import EVENTS
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.simulator.piloting.jumps import Event


def _pause(console: Console) -> None:
    console.session.clock.toggle_pause()


def _restart(console: Console) -> None:
    console.session.restart()
    console.hand.centre_sticks()
    console.say("back at the start; Flight > Timeline > Swap future brings back what was flown")


def _jump(event: Event, console: Console) -> None:
    when = console.session.jump_to_event(event)
    console.say(f"on the way to {mission_time(when)}, when {EVENTS[event]}")


def _jump_to_hold_point(console: Console) -> None:
    console.session.jump_to_hold_point()
    console.say(f"on the way to {console.session.jump_text}")


RATE = word("rate", "one of the rates", tuple(f"{r:g}" for r in RATES))
COMMANDS = (
    command("time.pause", _pause, "space", state=lambda console: console.session.clock.paused),
    command("time.step", lambda console: console.session.step_frame(), "period"),
    command("time.faster", lambda c: c.session.clock.shift_rate(1), "equal", "keypad_add", "right_bracket"),
    command(
        "time.slower", lambda c: c.session.clock.shift_rate(-1), "minus", "keypad_subtract", "left_bracket"
    ),
    command("time.rate", lambda c, rate: c.session.clock.set_rate(float(rate)), RATE),
    command("time.restart", _restart, "backspace", flies=True),
    *(
        Command(
            f"time.next-{event}",
            f"Jump to the next {event}",
            f"jump to when {EVENTS[event]}, then 1x; a rate ends it",
            partial(_jump, event),
        )
        for event in EVENTS
    ),
    command("time.next-hold-point", _jump_to_hold_point),
    command("time.jump-end", lambda console: console.session.clock.end_jump()),
)
