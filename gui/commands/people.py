"""Commands for people: undo, size of letters, help, tour, pictures of the window, films, files that are dropped."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.gui.command_table import Argument, Command
from flyaround.gui.jobs.mesh_import import MESHES, MeshImport
from flyaround.gui.picture.video import Film, eight_bits
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.gui.console import Console

FOLDER = Path("out") / "console"
LEAST_SCALE, MOST_SCALE, SCALE_STEP = 0.6, 2.5, 0.1
TOUR_STEPS = 7


def _undo(console: Console) -> None:
    console.history.undo(console.options)


def _redo(console: Console) -> None:
    console.history.redo(console.options)


def _font_scale(console: Console, scale: float) -> None:
    console.font_scale = round(scale, 3)


def _larger(console: Console) -> None:
    console.font_scale = round(min(console.font_scale + SCALE_STEP, MOST_SCALE), 3)


def _smaller(console: Console) -> None:
    console.font_scale = round(max(console.font_scale - SCALE_STEP, LEAST_SCALE), 3)


def _help(console: Console, panel: str | None = None) -> None:
    console.help_about = panel or console.hovered or "camera"
    console.open_panel("help", shown=True)


def _tour(console: Console) -> None:
    console.tour_step = 0
    console.open_panel("tour", shown=True)


def _tour_step(console: Console, step: int) -> None:
    console.tour_step = min(max(console.tour_step + step, 0), TOUR_STEPS - 1)


def _tour_back(console: Console) -> None:
    _tour_step(console, -1)


def _tour_end(console: Console) -> None:
    console.open_panel("tour", shown=False)


def _screenshot(console: Console, path: str | None = None) -> None:
    where = FOLDER / f"window-{console.clock_ms:09d}ms.png" if path is None else Path(path)
    if where.suffix != ".png":
        raise UserError(f"cannot write '{where.suffix}' pictures ({where}); end its name in .png")
    console.wants_screenshot = where


def _film(console: Console, path: str | None = None) -> None:
    if console.film is not None:
        raise UserError(f"a film is being made already: {console.film.path}")
    name = f"{console.session.plan.scenario.name}-{console.clock_ms:09d}ms.mp4"
    console.film = Film(FOLDER / name if path is None else Path(path))
    console.say(f"filming the view into {console.film.path}")


def _film_end(console: Console) -> None:
    film, console.film = console.film, None
    if film is None:
        raise UserError("no film is being made: begin one with film.start")
    film.close()
    left = f", {film.left_out} left out" if film.left_out else ""
    if film.trouble is None:
        console.say(f"filmed {film.path}: {film.pictures} pictures{left}")
    else:
        console.say(film.trouble, "caution")


def keep_film(console: Console) -> None:
    """The newest picture into the film; once a turn."""
    film, picture = console.film, console.feed.newest
    if film is None or picture is None:
        return
    if film.trouble is not None:
        console.film = None
        film.close()
        console.say(film.trouble, "caution")
        return
    if picture is not console.filmed:
        console.filmed = picture
        film.add(console.clock_ms, eight_bits(picture.frame.image, picture.frame.scene.sensor.bits))


def _open(console: Console, path: str) -> None:
    where = Path(path)
    kind = where.suffix.lower()
    if kind == ".toml":
        console.do("scenario.open", path)
    elif kind in MESHES:
        if console.mesh is not None:
            raise UserError(f"{console.mesh.name} is still being imported")
        console.mesh = MeshImport(where)
        console.say(f"importing {where.name} as target {console.mesh.name} ...")
    else:
        raise UserError(
            f"{where.name} is neither a scenario (.toml) nor a mesh ({', '.join(MESHES)}); nothing was opened"
        )


def keep_mesh(console: Console) -> None:
    """Fly the present scenario with a mesh that has been imported; once a turn."""
    if console.mesh is None or (ended := console.mesh.update()) is None:
        return
    console.mesh = None
    if ended.mistake:
        console.say(f"{ended.target} was not imported: {ended.mistake}", "caution")
    else:
        console.do("scenario.target", ended.target)


COMMANDS = (
    Command("settings.undo", "Undo", "take the last change of settings back", _undo, ("ctrl+z",)),
    Command("settings.redo", "Redo", "do again what was undone", _redo, ("ctrl+y",)),
    Command(
        "window.text-size",
        "Size of letters",
        "letters and panels, times as large as at first",
        _font_scale,
        arguments=(
            Argument(
                "scale", "number", "as large as at first", least=LEAST_SCALE, most=MOST_SCALE, unit="times"
            ),
        ),
    ),
    Command(
        "window.larger-text", "Larger letters", "letters and panels a tenth larger", _larger, ("ctrl+equal",)
    ),
    Command(
        "window.smaller-text",
        "Smaller letters",
        "letters and panels a tenth smaller",
        _smaller,
        ("ctrl+minus",),
    ),
    Command(
        "help.panel",
        "About this panel",
        "what the panel under the mouse is, and its commands",
        _help,
        ("slash",),
        arguments=(Argument("panel", "word", "its name; left out: under the mouse", optional=True),),
    ),
    Command("help.tour", "Tour", "a few cards that point at what there is", _tour),
    Command("help.tour-next", "Next card", "the tour's next card", lambda console: _tour_step(console, 1)),
    Command("help.tour-back", "Card before", "the tour's card before", _tour_back),
    Command("help.tour-end", "End of the tour", "no more cards", _tour_end),
    Command(
        "window.screenshot",
        "Picture of the window",
        "PNG of the whole window into out/console",
        _screenshot,
        ("ctrl+f12",),
        arguments=(Argument("path", "word", "of the file, .png", optional=True),),
    ),
    Command(
        "film.start",
        "Film the view",
        "the camera's pictures as they come, H.264, into out/console",
        _film,
        arguments=(Argument("path", "word", "of the file, .mp4", optional=True),),
    ),
    Command("film.stop", "End the film", "close the film's file", _film_end),
    Command(
        "file.open",
        "Open file",
        "a scenario flies, a mesh becomes this scenario's target; as files dropped on the window",
        _open,
        arguments=(Argument("path", "word", "a .toml, or a mesh"),),
    ),
)
