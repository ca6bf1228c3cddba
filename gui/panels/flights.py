"""Panel of the kept flights, newest first, with name, date, scenario and length."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.commands.timeline import FLIGHTS
from flyaround.gui.widgets import Panel
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.readouts import duration_text
from flyaround.simulator.piloting.recorder import REPLAY_NAME
from flyaround.simulator.scenario.load import load_scenario

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.gui.console import Console

MOST = 60  # flights that are listed


class FlightsPanel(Panel):
    """Flights left in this sitting, and those of *Keep flight* and ``--record``.

    A replay can be sought through, steered, captured, and sent to a board.
    """

    name, title, place, shown = "flights", "Kept flights", "left", False

    _rows: tuple[tuple[str, str, str], ...] = ()
    _known: tuple[str, ...] = ()

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui = self._w, self._w.imgui
        if imgui.is_window_appearing() or self._known != tuple(console.flights.files):
            self._known = tuple(console.flights.files)
            self._rows = tuple(flight_row(path) for path in kept_flights(self._known))
        if console.flights.former:
            w.section("Left since the console was opened")
        # the one left last comes first
        for k, (session, _) in enumerate(reversed(console.flights.former), 1):
            if imgui.selectable(f"{session.plan.scenario.name}##left{k}", False)[0]:
                console.do("scenario.back", k)
            w.command_tip(console, "scenario.back", k)
            lost = console.flights.lost_text(session)
            length = duration_text(max(session.look_back.timeline.end_s, session.t_s))
            w.text(f"{length}, {lost or 'nothing to keep'}", style.WARN if lost else style.QUIET)
        w.section("On disk")
        if not self._rows:
            w.text("None yet: File > Keep the flight > Keep flight writes the flight so far.", style.QUIET)
        for path, text, problem in self._rows:
            name = Path(path).parent.name
            if imgui.selectable(f"{w.elided(name, w.width)}##{path}", path == console.source)[0]:
                console.do("scenario.open", path)
            w.tip(f"{path}\nscenario.open {path}")
            w.text(problem or text, style.WARN if problem else style.QUIET)


def kept_flights(known: Iterable[str]) -> list[str]:
    """Return the replays in the folder of kept flights, and the known ones elsewhere that exist, newest first."""
    found = {str(path.absolute()) for path in FLIGHTS.glob(f"*/{REPLAY_NAME}")}
    paths = [path for path in {*found, *known} if Path(path).is_file()]
    return sorted(paths, key=lambda path: -Path(path).stat().st_mtime)[:MOST]


def flight_row(path: str) -> tuple[str, str, str]:
    """Return a replay's path, its date, scenario and length, and the reason if it cannot be flown."""
    try:
        scenario = load_scenario(path)
        when = datetime.fromtimestamp(Path(path).stat().st_mtime).astimezone()
    except (UserError, OSError) as error:
        return path, "", str(error)
    name, length = scenario.name.removesuffix("-replay"), duration_text(scenario.duration_s)
    return path, f"{when:%Y-%m-%d %H:%M}   {name}   {length}", ""
