"""Commands of docking: the autopilot, go and no-go at hold points, abort, limits, the axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import Command, switch, word
from flyaround.gui.commands.steering import order
from flyaround.simulator.piloting.docking_figures import PRESETS
from flyaround.simulator.piloting.orders import Abort, Approach, Go, JudgeBy, NoGo, TakeAxisHere

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _approach(console: Console, on: bool) -> None:  # noqa: FBT001 - a switch
    console.order(Approach(on))
    console.options.overlays.docking |= on


def _abort(console: Console) -> None:
    console.order(Abort())
    console.hand.let_go()


COMMANDS = (
    switch(
        "docking.approach",
        "Autopilot",
        "fly to the next hold point and, once all are passed, into the port",
        _approach,
        lambda console: bool(console.session.craft.steering.autopilot),
        ("b",),
        flies=True,
    ),
    Command(
        "docking.go",
        "Go",
        "let the chaser pass the hold point where it waits; refused while a figure is out of its limits",
        order(Go),
        ("enter",),
        flies=True,
    ),
    Command("docking.no-go", "No-go", "keep the chaser at the next hold point", order(NoGo)),
    Command(
        "docking.abort",
        "Abort",
        "away from the target in the next step, out of the corridor as it came in; undocks, too",
        _abort,
        ("delete",),
    ),
    Command(
        "docking.limits",
        "Limits",
        "whose limits colour the figures and judge the contact",
        order(JudgeBy),
        arguments=(word("preset", "of which", tuple(PRESETS)),),
    ),
    Command(
        "docking.axis-here",
        "Axis from here",
        "dock along the line from the chaser through the target's centre of mass, which turns with the target",
        order(TakeAxisHere),
    ),
)
