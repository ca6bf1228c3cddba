"""Commands of docking: the autopilot, go and no-go at hold points, abort, limits, the axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import command, switch, word
from flyaround.gui.commands.steering import order
from flyaround.gui.questions import drops_future
from flyaround.simulator.piloting.chaser_control import GUARDS
from flyaround.simulator.piloting.docking_figures import PRESETS
from flyaround.simulator.piloting.orders import Abort, Approach, Go, GuardBy, JudgeBy, NoGo, TakeAxisHere
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _approach(console: Console, on: bool) -> None:  # noqa: FBT001 - a switch
    console.order(Approach(on))
    console.options.overlays.docking |= on


def _abort(console: Console) -> None:
    """Abort at once: the present flight, also while an earlier time of it is shown, or a question stands."""
    session, console.asked, console.hand.abort_by_ms = console.session, None, 0
    console.open_panel("quit", shown=False)
    if drops_future(session):
        session.look_back.seek(session.look_back.timeline.end_s)
        text = f"aborted the present flight, at {mission_time(session.t_s)}: an earlier time was shown"
        console.say(text, "caution", over=lambda: not session.craft.steering.aborting)
    console.order(Abort())
    console.hand.let_go()


COMMANDS = (
    switch(
        "docking.approach", _approach, lambda c: bool(c.session.craft.steering.autopilot), "b", flies=True
    ),
    command("docking.go", order(Go), "enter", flies=True),
    command("docking.no-go", order(NoGo)),
    command("docking.abort", _abort, "delete"),
    command("docking.limits", order(JudgeBy), word("preset", "of which", tuple(PRESETS))),
    command("docking.axis-here", order(TakeAxisHere)),
    command("docking.keep-out", order(GuardBy), word("guard", "its corridor, or lifted", GUARDS)),
)
