"""Commands of the timeline: seek, fly on, bookmark, and export the flown flight."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.gui.command_table import Argument, command, moment, word
from flyaround.gui.jobs.flight_keeping import FlightKeeping
from flyaround.gui.jobs.program import FOLDER
from flyaround.gui.picture.view_settings import scenario_as_seen
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.flown_files import FlownFiles, free_folder
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.gui.console import Console
    from flyaround.simulator.piloting.session import FlightSession

FLIGHTS = FOLDER / "flights"
SKIP_S = 10.0
FRAMES = 50
"""Default number of frames of a data set."""


def _seek(console: Console, t_s: float) -> None:
    console.session.look_back.seek(t_s)
    console.session.clock.paused = True


def _skip(seconds: float, console: Console) -> None:
    _seek(console, max(console.session.t_s + seconds, 0.0))


def _step_back(console: Console) -> None:
    console.session.clock.paused = True
    console.session.look_back.step(-1)


def _end(console: Console) -> None:
    if console.session.look_back.active:
        _seek(console, console.session.look_back.timeline.end_s)


def _fly_on(console: Console) -> None:
    session = console.session
    if not session.look_back.active:
        # at the end there is nothing to leave
        session.clock.paused = False
        return
    session.look_back.fly_on()
    session.clock.slow_down()
    console.say(
        f"flies on from {mission_time(session.t_s)} at {session.clock.rate:g}x; "
        "Flight > Timeline > Swap future brings the other future back"
    )


def _other_future(console: Console) -> None:
    parts_s = console.session.look_back.swap_future()
    console.session.clock.paused = True
    console.say(f"the other future is back; it branches off at {mission_time(parts_s)}")


def _bookmark(console: Console, note: str = "") -> None:
    mark = console.session.look_back.timeline.bookmark(console.session.t_s, note)
    console.say(f"bookmark at {mission_time(mark.t_s)}{': ' if mark.note else ''}{mark.note}")


def _unbookmark(console: Console, t_s: float | None = None) -> None:
    console.session.look_back.timeline.unbookmark(console.session.t_s if t_s is None else t_s)


def _stop_keeping(console: Console) -> None:
    if console.jobs.keeping:
        console.jobs.keeping.pop(0).cancel()
        console.say("writing was stopped and its files removed: Keep flight starts again")


def _report_kept(console: Console, replay: str) -> None:
    console.say(f"kept {replay}: a scenario for sim, render, capture and hil host", of="timeline.keep")


def keep_flight(
    console: Console,
    folder: str | None = None,
    then: Callable[[Console, str], None] = _report_kept,
    *,
    as_seen: bool = False,
    session: FlightSession | None = None,
) -> None:
    """Begin to write a flown flight; ``as_seen`` gives its replay the operator's camera, exposure and lights."""
    session = session or console.session
    scenario = session.plan.scenario
    where = free_folder(FLIGHTS, scenario.name) if folder is None else Path(folder)
    seen = scenario_as_seen(scenario, console.options.settings) if as_seen else None
    files = FlownFiles(session, where, seen)
    fail = partial(console.say, level="caution", of="timeline.keep")
    console.jobs.keeping.append(FlightKeeping(session, files, console.flights, partial(then, console), fail))
    console.flights.keep(session)


def _keep_all(console: Console) -> None:
    if not console.flights.unsaved:
        raise UserError("every flight that was flown by hand is kept")
    for session in console.flights.unsaved:
        keep_flight(console, session=session)


def _dataset(console: Console, frames: int = FRAMES) -> None:
    keep_flight(console, then=lambda c, replay: c.do("capture.start", frames, replay), as_seen=True)
    # at once: a panel that opens later would catch a click meant for another one
    console.open_panel("capture", shown=True)


def _hil(console: Console) -> None:
    # flown, not looked at: a board waits for pictures
    keep_flight(console, then=lambda console, replay: console.opener.open(replay, flies=True))
    console.open_panel("board-link", shown=True)


COUNT = Argument("frames", "whole", "how many; 50 unless given", least=1, most=10_000, optional=True)
NEAR = moment("time", "near this time; left out: near now", optional=True)

COMMANDS = (
    command("timeline.seek", _seek, moment("time", "since the scenario's start")),
    command("timeline.step-back", _step_back, "comma"),
    command("timeline.back", partial(_skip, -SKIP_S), "page_up"),
    command("timeline.forward", partial(_skip, SKIP_S), "page_down"),
    command("timeline.begin", lambda console: _seek(console, 0.0), "home"),
    command("timeline.end", _end, "end"),
    command("timeline.fly-on", _fly_on, "ctrl+enter"),
    command("timeline.other-future", _other_future),
    command("timeline.bookmark", _bookmark, "ctrl+b", word("note", "a line", optional=True)),
    command("timeline.unbookmark", _unbookmark, NEAR),
    command("timeline.keep", keep_flight, word("folder", "empty or to be made", optional=True)),
    command("timeline.keep-all", _keep_all),
    command("timeline.keep-stop", _stop_keeping),
    command("timeline.dataset", _dataset, COUNT),
    command("timeline.hil", _hil),
)
