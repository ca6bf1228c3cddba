"""Panel of a data-set capture beside the flight: options, progress and the last pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flyaround.gui import style
from flyaround.gui.commands.capture import FLOWN, FPS, NEW, THIS, WIDTH_PX
from flyaround.gui.texts import NOTES, left_text
from flyaround.gui.widgets import Panel
from flyaround.simulator.dataset.formats.registry import writable
from flyaround.simulator.piloting.readouts import duration_text, mission_seconds, mission_time
from flyaround.simulator.scenario.load import list_recipes, list_scenarios

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.jobs.capture_job import CaptureJob
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.session import FlightSession

TITLES = {FLOWN: "what I flew", THIS: "this flight's scenario"}
START = mission_time(0.0, whole=True)[2:]
THUMB = 120.0  # least width of a small picture


class CapturePanel(Panel):
    """Options, progress and last pictures of a capture."""

    name, title, place, shown = "capture", "Capture", "left", False

    _what = _folder = ""
    _names: tuple[str, ...] = ()
    _frames, _workers = "20", "1"
    _formats: frozenset[str] = frozenset()
    _flight: FlightSession | None = None

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._film = [str(WIDTH_PX), f"{FPS:g}", "10", START, ""]

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        if console.jobs.capture.running:
            self._under_way(console)
        elif console.jobs.keeping:
            self._w.text("The flight is being written.", style.QUIET)
        else:
            self._form(console)
        if not console.jobs.keeping:
            self._film_form(console)
        self._thumbnails(console.jobs.capture)

    def _form(self, console: Console) -> None:
        w, imgui, job = self._w, self._w.imgui, console.jobs.capture
        self._names = self._names or (FLOWN, THIS, *list_scenarios(), *list_recipes())
        self._what = self._what or (FLOWN if console.session in console.flights.unsaved else THIS)
        w.field("What", "", 0.7)
        self._what = w.choice(
            console, "capture.start", self._what, self._names, argument="what", shown=TITLES
        )
        if self._what in TITLES:
            w.text(NOTES["capture"], style.QUIET)
        w.field("Frames", "", 0.7)
        frames, *_, workers = console.table["capture.start"].arguments
        self._frames = w.typed("frames", self._frames, frames, "Capture")
        w.field("Folder", "", 0.7)
        _, self._folder = imgui.input_text_with_hint("##folder", "a new one in out/console", self._folder)
        self._w.command_tip(console, "capture.start", argument="folder")
        w.field("Processes", "", 0.7)
        self._workers = w.typed("workers", self._workers, workers, "Capture")
        w.text("Further formats of the same set", style.QUIET)
        formats = writable()[1:]
        for name, _ in zip(formats, w.grid(len(formats), 110), strict=True):
            if imgui.checkbox(name, name in self._formats)[0]:
                self._formats ^= {name}
            w.command_tip(console, "capture.start", argument="formats")
        formats_text = ",".join(sorted(self._formats)) or "native"
        arguments = (self._frames, self._what, self._folder or NEW, formats_text, self._workers)
        w.button(console, "capture.start", *arguments, width=w.width)
        if job.outcome:
            colour = style.GOOD if job.outcome.startswith("captured") else style.WARN
            w.text(job.outcome, colour, "how the last capture ended")
            if not job.outcome.startswith("captured"):
                w.button(console, "capture.resume", width=w.width)

    def _film_form(self, console: Console) -> None:
        """Draw size, rate, speed and part of a film of the flight, and its length."""
        w, command = self._w, console.table["film.flight"]
        w.section("Film of this flight")
        end_s = max(console.session.look_back.timeline.end_s, console.session.t_s)
        if console.session is not self._flight:
            self._flight, self._film[3:] = console.session, [START, ""]
        flown = mission_time(end_s, whole=True)[2:]
        for k, argument in enumerate(command.arguments[:5]):
            label = argument.name if argument.kind == "time" else argument.label
            w.field(label.capitalize(), argument.description, 0.5)
            follows = flown if argument.name == "end" else ""
            self._film[k] = w.typed(f"film{k}", self._film[k], argument, "Film", follows)
        shown = [*self._film[:-1], self._film[-1] or flown]
        right = not any(a.flaw(text, "") for a, text in zip(command.arguments, shown, strict=False))
        if right:
            fps, speed, start, end = map(mission_seconds, shown[1:])
            length_s = max(end - start, 0.0) / speed
            w.text(f"{duration_text(length_s)}, {length_s * fps:.0f} pictures", style.QUIET, "of the film")
        look: dict[str, Any] = {"enabled": right and not console.jobs.flight_film, "width": w.width}
        if right and (start, end) != (0.0, int(end_s)):
            look["label"] = f"Film {shown[3]} to {shown[4]}"
        w.button(console, command.name, *shown, **look)

    def _under_way(self, console: Console) -> None:
        w, imgui, job = self._w, self._w.imgui, console.jobs.capture
        if (request := job.request) is None:
            return
        w.text(request.what, tip="scenario, recipe or file that is captured")
        w.text(f"into {request.folder}", style.QUIET, "folder of the data set")
        share = min(job.done / max(request.frames, 1), 1.0)
        imgui.progress_bar(share, w.vec(-1, 0), f"{job.done} of {request.frames}")
        w.tip("frames written, of those requested")
        text = "stopping ..." if job.stopping else duration_text(job.elapsed_s) + left_text(job.left_s)
        w.text(text, style.QUIET, "time elapsed, and time left at the rate so far")
        w.button(console, "capture.stop", width=w.width, label="End it at once" if job.stopping else None)

    def _thumbnails(self, job: CaptureJob) -> None:
        w, imgui = self._w, self._w.imgui
        if not job.thumbnails:
            return
        w.section("Last pictures")
        for k, width in enumerate(w.grid(len(job.thumbnails), THUMB)):
            thumb = job.thumbnails[-1 - k]
            texture = w.window.show_picture(f"thumbnail/{k}", thumb, thumb.image)
            imgui.image(texture, w.vec(width, width * thumb.image.shape[0] / thumb.image.shape[1]))
            w.tip(thumb.name)
