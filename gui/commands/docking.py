"""Commands of docking: the autopilot, go and no-go at hold points, abort, limits, the axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import STATE, Argument, Command
from flyaround.simulator.piloting.docking_figures import PRESETS

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _approach(console: Console, state: bool | None = None) -> None:  # noqa: FBT001 - a switch
    session = console.session
    on = not session.steering.autopilot if state is None else state
    if not on:
        session.steering.guide(None)
        console.say("the autopilot is off: the chaser drifts")
        return
    session.take_over()
    docking = session.docking
    figures = docking.figures(session.moment.chaser, session.flight)
    docking.hold_points.rearm(figures, docking.corridor_deg)
    session.steering.engage_autopilot()
    console.options.overlays.docking = True
    point = docking.hold_points.next
    where = "the port" if point is None else f"{point.name}, {point.axial_m:g} m before the port"
    console.say(f"the autopilot flies to {where}")


def _go(console: Console) -> None:
    session = console.session
    session.take_over()
    docking, point = session.docking, session.docking.hold_points.next
    figures = docking.figures(session.moment.chaser, session.flight)
    against = docking.hold_points.go(figures, docking.limits, docking.corridor_deg)
    if against:
        where = "" if point is None else f" at {point.name}"
        console.say(f"no go{where}: {'; '.join(against)}", "caution")
    else:
        console.say(f"go at {'' if point is None else point.name}")


def _no_go(console: Console) -> None:
    point = console.session.docking.hold_points.no_go()
    console.say(
        "there is no hold point left" if point is None else f"no-go: the chaser stays at {point.name}"
    )


def _abort(console: Console) -> None:
    console.session.abort()
    console.say("abort: the chaser retreats from the target", "warning")


def _limits(console: Console, preset: str) -> None:
    console.session.docking.limits = PRESETS[preset]
    console.say(f"limits: {PRESETS[preset].title} ({PRESETS[preset].source})")


def _axis_here(console: Console) -> None:
    session = console.session
    session.docking.take_axis_here(session.moment.chaser, session.flight)
    console.say("the docking axis now leads from the chaser through the target's centre of mass")


COMMANDS = (
    Command(
        "docking.approach",
        "Autopilot",
        "fly to the next hold point and, once all are passed, into the port",
        _approach,
        ("b",),
        "B",
        flies=True,
        arguments=(STATE,),
        state=lambda console: console.session.steering.autopilot,
    ),
    Command(
        "docking.go",
        "Go",
        "let the chaser pass the hold point where it waits; refused while a figure is out of its limits",
        _go,
        ("enter",),
        "Enter",
        flies=True,
    ),
    Command("docking.no-go", "No-go", "keep the chaser at the next hold point", _no_go),
    Command(
        "docking.abort",
        "Abort",
        "away from the target in the next step, out of the corridor as it came in; undocks, too",
        _abort,
        ("delete",),
        "Del",
    ),
    Command(
        "docking.limits",
        "Limits",
        "whose limits colour the figures and judge the contact",
        _limits,
        arguments=(Argument("preset", "word", "of which", tuple(PRESETS)),),
    ),
    Command(
        "docking.axis-here",
        "Axis from here",
        "dock along the line from the chaser through the target's centre of mass, which turns with the target",
        _axis_here,
    ),
)
