"""Commands of the user interface: undo, text size, help, tour, screenshots, films, dropped files, log."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.gui.command_table import command, number, word
from flyaround.gui.jobs.mesh_import import MESHES, MeshImport
from flyaround.gui.jobs.program import output_file
from flyaround.gui.picture.decline_cause import exposure_note
from flyaround.gui.picture.video import Film
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.orders import Rechoose
from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from flyaround.gui.console import Console

LEAST_SCALE, MOST_SCALE, SCALE_STEP = 0.6, 2.5, 0.1  # limits and step of the font scale
TOUR_STEPS = 6
SCALE = number("scale", "as large as at first", LEAST_SCALE, MOST_SCALE, "times")
PANEL = word("panel", "its name; left out: under the mouse", optional=True)


def _font_scale(console: Console, scale: float) -> None:
    console.window.font_scale = round(scale, 3)


def _step_font_scale(step: float, console: Console) -> None:
    _font_scale(console, min(max(console.window.font_scale + step, LEAST_SCALE), MOST_SCALE))


def _help(console: Console, panel: str | None = None) -> None:
    console.help.panel = panel or console.help.hovered or console.help.clicked or "camera"
    console.open_panel("help", shown=True)


def _tour(console: Console) -> None:
    if console.shown.get("tour") or console.help.tour_step == TOUR_STEPS:
        console.help.tour_step = 0
    console.open_panel("tour", shown=True)


def _tour_step(console: Console, step: int) -> None:
    console.help.tour_step = min(max(console.help.tour_step + step, 0), TOUR_STEPS)


def _screenshot(console: Console, path: str | None = None) -> None:
    where = output_file(path, f"window-{console.clock_ms:09d}ms", ".png")
    if where.suffix != ".png":
        raise UserError(f"cannot write '{where.suffix}' pictures ({where}); end its name in .png")
    console.window.screenshot = where


def _film(console: Console, path: str | None = None) -> None:
    if console.jobs.film is not None:
        raise UserError(f"a film is being made already: {console.jobs.film.path}")
    name = f"{console.session.plan.scenario.name}-{console.clock_ms:09d}ms"
    console.jobs.film = Film(output_file(path, name, ".mp4"))
    console.say(f"filming the view into {console.jobs.film.path}{exposure_note(console.feed.newest)}")


def _film_end(console: Console) -> None:
    film, console.jobs.film = console.jobs.film, None
    if film is None:
        raise UserError("no film is being made: Film the view begins one")
    film.close()
    skipped = f", {film.left_out} left out" if film.left_out else ""
    text = film.trouble or f"filmed {film.path}: {film.pictures} pictures{skipped}"
    console.say(text, "caution" if film.trouble else "note", "film.start")


def _open(console: Console, path: str) -> None:
    where = Path(path)
    kind = where.suffix.lower()
    if kind == ".toml":
        console.do("scenario.open", path)
    elif kind in MESHES:
        if console.jobs.mesh is not None:
            raise UserError(f"{console.jobs.mesh.name} is still being imported")
        console.jobs.mesh = MeshImport(where)
        text = f"importing {where.name} as target {console.jobs.mesh.name} ..."
        console.say(text, over=lambda: console.jobs.mesh is None)
    else:
        raise UserError(f"{where.name} is neither a scenario (.toml) nor a mesh ({', '.join(MESHES)})")


def _stop_import(console: Console) -> None:
    if console.jobs.mesh is not None:
        console.jobs.mesh.close()
    console.jobs.mesh = None


def _step_settings(name: str, text: str, console: Console) -> None:
    """Undo or redo the last change of settings, burns or choices of the flight."""
    what = console.history.step(name, console.options, lambda changes: console.order(Rechoose(changes)))
    console.say(text.format(what))


def _enlarge(console: Console, panel: str | None = None) -> None:
    window, panel_name = console.window, panel or console.help.hovered or "lvlh-map"
    if f"panel.{panel_name}" not in console.table:
        raise UserError(f"there is no panel '{panel_name}' to enlarge")
    window.enlarged = "" if window.enlarged else panel_name


def script_header(console: Console) -> tuple[str]:
    """Return the comment that opens a log: the command that plays it."""
    return (f"flyaround sim {console.session.plan.scenario.name} --script FILE",)


def _save_log(console: Console, path: str | None = None) -> None:
    where = output_file(path, "commands", ".script")
    where.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(where, console.log.text(script_header(console)).encode())
    console.say(
        f"saved {where}; flyaround sim {console.session.plan.scenario.name} --script {where} does it again"
    )


COMMANDS = (
    command(
        "settings.undo", partial(_step_settings, "settings.undo", "undone: {} (Ctrl+Y redoes it)"), "ctrl+z"
    ),
    command("settings.redo", partial(_step_settings, "settings.redo", "redone: {}"), "ctrl+y"),
    command("window.text-size", _font_scale, SCALE),
    command("window.larger-text", partial(_step_font_scale, SCALE_STEP), "ctrl+equal"),
    command("window.smaller-text", partial(_step_font_scale, -SCALE_STEP), "ctrl+minus"),
    command("window.enlarge", _enlarge, "ctrl+m", PANEL),
    command("help.panel", _help, "slash", PANEL),
    command("help.tour", _tour),
    command("help.tour-next", lambda console: _tour_step(console, 1)),
    command("help.tour-back", lambda console: _tour_step(console, -1)),
    command("help.tour-end", lambda console: console.open_panel("tour", shown=False)),
    command("window.screenshot", _screenshot, "ctrl+f12", word("path", "of the file, .png", optional=True)),
    command("film.start", _film, word("path", "of the file, .mp4", optional=True)),
    command("film.stop", _film_end),
    command("file.open", _open, word("path", "a .toml, or a mesh")),
    command("file.open-stop", _stop_import),
    command("log.save", _save_log, word("path", "of the file", optional=True)),
)
