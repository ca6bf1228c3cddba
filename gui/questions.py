"""Questions before a command drops a flight, or leaves one that is in no file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.piloting.readouts import duration_text, mission_time

if TYPE_CHECKING:
    from flyaround.gui.command_table import Command, Value
    from flyaround.simulator.piloting.orders import Changes
    from flyaround.simulator.piloting.session import FlightSession

FLOWN = frozenset({"steer", "guidance", "burn", "docking"})
"""Groups of commands that make a flight the operator's own."""
NO_FLYING = frozenset({"steer.arm", "steer.stick-lost", "docking.keep-out"})
"""Commands of those groups that do not act on the chaser."""
NEW_FLIGHT = frozenset({"scenario.open", "scenario.target", "scenario.fly", "light.fly"})
"""Commands that begin another flight."""
SWAP_BACK = "Flight > Timeline > Swap future brings back the part dropped last."
GO_BACK = "File > Previous flight returns to it until you quit."
LIFTS = "Lift the keep-out sphere? Nothing then keeps the chaser from hitting the target."
KEEPS_OUT = "A click on KEEP-OUT LIFTED, in the bottom line, brings it back."


@dataclass(frozen=True)
class Question:
    """A question that a command waits for.

    Parameters
    ----------
    command : Command
        The command.
    values : tuple of Value
        Its arguments.
    text : str
        The question, which names what is lost.
    way_back : str
        How it can be brought back.
    answer : str
        Label of the button that runs the command.
    first : str, optional
        Command that is run before it.
    keeps : bool, optional
        True if the flight that is left can be written first.
    """

    command: Command
    values: tuple[Value, ...]
    text: str
    way_back: str
    answer: str
    first: str = ""
    keeps: bool = False


def acts_on_chaser(name: str) -> bool:
    """Return True for the name of a command that flies the chaser."""
    return name.partition(".")[0] in FLOWN and name not in NO_FLYING


def flight_text(session: FlightSession) -> str:
    """Return a flight's scenario and length."""
    end_s = max(session.look_back.timeline.end_s, session.t_s)
    return f"the flight of {session.plan.scenario.name}, {duration_text(end_s)},"


def drops_future(session: FlightSession) -> bool:
    """Return True if flying on from the time shown drops a part of the flight; what is shown of a file stays there."""
    return session.look_back.active and not session.look_back.replays


def question_before(
    session: FlightSession,
    command: Command,
    values: tuple[Value, ...],
    edited: str,
    lost: str,
    changes: Changes,
) -> Question | None:
    """Return the question before a command that drops or leaves a flight; None if nothing is lost.

    Parameters
    ----------
    session : FlightSession
        The present flight.
    command : Command
        The command.
    values : tuple of Value
        Its arguments.
    edited : str
        Name of the scenario whose text is edited.
    lost : str
        How much of the flight is in no file, as a predicate; empty if nothing is lost.
    changes : Changes
        Choices of the flight that the command, an undo or redo, changes.
    """
    name = command.name
    if name in NEW_FLIGHT and (lost or session.look_back.recorder is not None):
        what = {"scenario.fly": edited}.get(name, str(values[0]) if values else "these lights")
        ends = f"It {lost}" if lost else "Its recording ends"
        text = f"Leave {flight_text(session)} for {what}? {ends}."
        return Question(
            command, values, text, GO_BACK, f"Fly {what.replace('these', 'with these')}", keeps=bool(lost)
        )
    if name == "time.restart" and lost:
        text = f"Restart? T{flight_text(session)[1:]} {lost}."
        return Question(command, values, text, SWAP_BACK, "Restart")
    guard = changes["guard"][1] if "guard" in changes else values[0] if name == "docking.keep-out" else ""
    lifts = guard == "lifted" and session.craft.steering.sphere is not None
    # an abort acts on the present, and a stick that is let go on nothing
    flies = acts_on_chaser(name) and name != "docking.abort"
    flies &= any(values) or not name.startswith("steer.stick-")
    flies |= (
        bool(changes.keys() - {"guard"})
        or name.startswith("time.next-")
        or (name == "timeline.fly-on" and bool(lost))
    )
    if not flies or not drops_future(session):
        return Question(command, values, LIFTS, KEEPS_OUT, "Lift it") if lifts else None
    flown = duration_text(session.look_back.timeline.end_s - session.t_s)
    text = f"Fly on from {mission_time(session.t_s, whole=True)}? The {flown} flown after it are dropped."
    first = "" if name == "timeline.fly-on" else "timeline.fly-on"
    text = f"{text} {LIFTS}" if lifts else text
    return Question(command, values, text, SWAP_BACK, "Fly on", first)
