"""Commands of captures and films beside the flight."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from flyaround.gui.command_table import Argument, command, moment, number, word
from flyaround.gui.commands.timeline import keep_flight
from flyaround.gui.jobs.capture_job import MOST_FRAMES, MOST_WORKERS, CaptureRequest
from flyaround.gui.jobs.flight_film import FlightFilm
from flyaround.gui.jobs.program import FOLDER, output_file
from flyaround.gui.picture.decline_cause import exposure_note
from flyaround.gui.picture.view_settings import scenario_as_seen
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.readouts import mission_time
from flyaround.simulator.piloting.recorder import REPLAY_NAME
from flyaround.simulator.runtime.files import new_path, write_atomic
from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.scenario.load import built_in_name

if TYPE_CHECKING:
    from flyaround.gui.console import Console

THIS, NEW = "this-flight", "new"  # what to capture, and into which folder, by default
WIDTH_PX, FPS = 1280, 25.0  # of films
FLOWN = "what-i-flew"
"""The flown flight, instead of its scenario from the start."""


def _what(console: Console, what: str) -> str:
    """Return the argument of `flyaround capture`: a name, a file, or this flight's scenario, as it is seen, as one."""
    if what != THIS:
        return what
    scenario = scenario_as_seen(console.session.plan.scenario, console.options.settings)
    if name := built_in_name(scenario):
        return name
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = new_path(FOLDER, f"{scenario.name}-flown", ".toml")
    write_atomic(path, to_toml(msgspec.to_builtins(scenario)).encode())
    return str(path)


def _start(
    console: Console,
    frames: int,
    what: str | None = None,
    folder: str | None = None,
    formats: str | None = None,
    workers: int | None = None,
) -> None:
    what, formats, workers = what or THIS, formats or "native", workers or 1
    name = console.session.plan.scenario.name
    stem = {THIS: name, FLOWN: f"{name}-flown"}.get(what, Path(what).stem)
    place = new_path(FOLDER, f"set-{stem}") if folder in {None, NEW} else Path(str(folder))
    request = CaptureRequest(what=what, frames=frames, folder=place, formats=formats, workers=workers)
    console.jobs.capture.check(request)
    if what == FLOWN:
        rest = str(place), formats, workers
        keep_flight(
            console, None, lambda c, replay: c.do("capture.start", frames, replay, *rest), as_seen=True
        )
        return
    console.jobs.capture.start(replace(request, what=_what(console, what)))
    # a replay is that of this flight, written as it is seen
    note = exposure_note(console.feed.newest) if what == THIS or what.endswith(REPLAY_NAME) else ""
    console.say(f"capturing {frames} frames of {what} into {place}{note}")


def _resume(console: Console) -> None:
    last = console.jobs.capture.request
    if last is None:
        raise UserError("there is no capture to resume: start one")
    console.jobs.capture.start(replace(last, resume=True))
    console.say(f"resuming {last.folder}")


def _film(
    console: Console,
    width: int = WIDTH_PX,
    fps: float = FPS,
    speed: float = 1.0,
    start_s: float = 0.0,
    end_s: float | None = None,
    path: str | None = None,
) -> None:
    if console.jobs.flight_film is not None:
        raise UserError(f"{console.jobs.flight_film.path} is being rendered: stop it, or wait for its end")
    last_s = console.session.look_back.timeline.end_s if end_s is None else end_s
    if start_s >= last_s:
        start, last = mission_time(start_s), mission_time(last_s)
        raise UserError(f"Film the whole flight: start is {start}, allowed: below its end, {last}")
    name = console.session.plan.scenario.name
    where = output_file(path, f"{name}-flight", ".mp4")
    options = {"--width": width, "--fps": fps, "--speed": speed, "--from": start_s, "--to": end_s}
    options |= {"--gpu": console.device_index}
    words = [str(word) for option in options.items() if option[1] is not None for word in option]

    def begin(console: Console, replay: str) -> None:
        where.parent.mkdir(parents=True, exist_ok=True)
        console.jobs.flight_film = FlightFilm(where, (replay, *words))
        note = exposure_note(console.feed.newest) or "; Capture chooses size, speed and part"
        console.say(f"rendering {where}, {width} pixels wide{note}")

    keep_flight(console, None, begin, as_seen=True)


COMMANDS = (
    command(
        "capture.start",
        _start,
        Argument("frames", "whole", "how many", least=1, most=MOST_FRAMES),
        word("what", f"scenario, recipe, file or {FLOWN}; {THIS} unless given", optional=True),
        word("folder", f"new or empty; {NEW}, or left out: one in out/console", optional=True),
        word("formats", "beside the native one, with commas", optional=True),
        Argument("processes", "whole", "processes that draw", least=1, most=MOST_WORKERS, optional=True),
    ),
    command("capture.stop", lambda console: console.jobs.capture.stop()),
    command("capture.resume", _resume),
    command(
        "film.flight",
        _film,
        Argument("width", "whole", f"{WIDTH_PX} unless given", (), 16, 7680, optional=True, unit="px"),
        number("fps", f"pictures per second; {FPS:g} unless given", 1.0, 120.0, "1/s", optional=True),
        number("speed", "of the flight in the film; 1 unless given", 0.001, 1e4, "x", optional=True),
        moment("start", "time of the flight; its start unless given", optional=True),
        moment("end", "time of the flight; its end unless given", optional=True),
        word("path", "of the file, .mp4", optional=True),
    ),
    command("film.flight-stop", lambda c: c.jobs.flight_film and c.jobs.flight_film.stop()),
)
