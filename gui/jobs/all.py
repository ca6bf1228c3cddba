"""All background jobs, updated once per turn of the loop."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from flyaround.gui.jobs.capture_job import CaptureJob
from flyaround.gui.jobs.estimates import Estimates
from flyaround.gui.jobs.estimator_process import method_title
from flyaround.gui.jobs.hil_session import HilSession
from flyaround.gui.picture.screen import screen_picture

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.gui.jobs.flight_film import FlightFilm
    from flyaround.gui.jobs.flight_keeping import FlightKeeping
    from flyaround.gui.jobs.mesh_import import MeshImport
    from flyaround.gui.picture.feed import Picture
    from flyaround.gui.picture.video import Film
    from flyaround.simulator.piloting.session import FlightSession


@dataclass(eq=False)
class Jobs:
    """The estimator, the session with a board, the capture, the film, the mesh import and flights being written.

    Parameters
    ----------
    say : callable
        Function that reports a text with a level.
    do : callable
        Function that runs a command.
    estimates : Estimates, optional
        The estimator on the pictures of the camera.
    hil : HilSession, optional
        The session with a board.
    capture : CaptureJob, optional
        The capture of a data set.
    film : Film or None, optional
        The film being recorded.
    flight_film : FlightFilm or None, optional
        The film of a whole flight that is being rendered.
    mesh : MeshImport or None, optional
        The import of a mesh.
    keeping : list of FlightKeeping, optional
        Flights being written.
    """

    say: Callable[..., None]
    do: Callable[..., None]
    estimates: Estimates = field(default_factory=Estimates)
    hil: HilSession = field(default_factory=HilSession)
    capture: CaptureJob = field(default_factory=CaptureJob)
    film: Film | None = None
    flight_film: FlightFilm | None = None
    mesh: MeshImport | None = None
    keeping: list[FlightKeeping] = field(default_factory=list)
    _filmed: Picture | None = None
    _cause: str = ""

    def update(self, session: FlightSession, picture: Picture | None, t_ms: int) -> None:
        """Pass each job the newest state of the flight, and report its news.

        Parameters
        ----------
        session : FlightSession
            The flight that is shown.
        picture : Picture or None
            Newest picture of the chaser's camera.
        t_ms : int
            Real time.
        """
        self._update_estimates(picture)
        for note in self.hil.update(session):
            self.say(note.text, "caution" if note.warning else "note", "hil.start")
        if (outcome := self.capture.update()) is not None:
            expected = outcome.startswith(("captured", "the capture was stopped"))
            self.say(outcome, "note" if expected else "caution", "capture.start")
        if (film := self.film) is not None and picture is not None:
            if film.trouble is not None:
                self.film = None
                film.close()
                self.say(film.trouble, "caution", "film.start")
            elif picture is not self._filmed:
                self._filmed = picture
                film.add(t_ms, screen_picture(picture.frame))
        if self.flight_film is not None and (why := self.flight_film.update()) is not None:
            path, stopped, self.flight_film = self.flight_film.path, self.flight_film.stopped, None
            text = f"the film {path} is not kept: {why}" if why else f"filmed {path}"
            self.say(text, "caution" if why and not stopped else "note", "film.flight")
        if self.mesh is not None and (mistake := self.mesh.update()) is not None:
            # fly the present scenario with the imported mesh
            target, self.mesh = self.mesh.name, None
            if mistake:
                self.say(f"{target} was not imported: {mistake}", "caution", "file.open")
            else:
                self.do("scenario.target", target)
        # one after the other, so that each has its line of progress
        if self.keeping and not (keep := self.keeping[0])():
            self.keeping.remove(keep)

    def _update_estimates(self, picture: Picture | None) -> None:
        estimates = self.estimates
        if estimates.update(picture) and (e := estimates.newest) is not None:
            accepted = sum(one.answer.accepted and one.E_R_deg is not None for one in estimates.history)
            if accepted == 1 and e.answer.accepted and e.E_R_deg is not None:
                self.say(
                    f"{method_title(e.method)}: first accepted pose, {e.E_R_deg:.2f}° and "
                    f"{1e3 * (e.E_T_m or 0.0):.0f} mm off at {e.range_m:.1f} m"
                )
            # once for each kind of cause, which stands before the colon
            kind = e.cause.partition(":")[0]
            if kind not in {"", self._cause}:
                text = f"{method_title(e.method)} declines its pictures: {e.cause}"
                self.say(text, over=lambda: self._cause != kind)
            self._cause = kind
        for trouble in estimates.take_troubles():
            self.say(trouble, "caution", "estimator.run")

    def close(self) -> None:
        """End all jobs at the same time; of a flight that is being written nothing is left."""
        for keep in self.keeping:
            keep.cancel()
        jobs = (self.estimates, self.hil, self.capture, self.film, self.flight_film, self.mesh)
        with ThreadPoolExecutor(len(jobs)) as pool:
            # each waits for a process of its own
            list(pool.map(lambda job: job is not None and job.close(), jobs))


@dataclass(frozen=True)
class RunningJob:
    """One job's text, progress and end button in the strip.

    Parameters
    ----------
    text : str
        Description and progress.
    share : float or None
        Completed share; None if unknown.
    end : str
        Command that ends it.
    silent : bool, optional
        True while it has given nothing yet, so that only its duration shows that it is at work.
    """

    text: str
    share: float | None
    end: str
    silent: bool = False


def running_jobs(jobs: Jobs, opening: str = "", flight: FlightSession | None = None) -> list[RunningJob]:
    """Return the running jobs, among them ``opening`` a scenario, and a jump of the flight."""
    rows = [RunningJob(f"opening {opening}", None, "scenario.open-stop", silent=True)] if opening else []
    if flight is not None and flight.clock.jump:
        rows.append(RunningJob(f"jump to {flight.jump_text}", flight.jump_share, "time.jump-end"))
    if jobs.estimates.on:
        text = f"{method_title(jobs.estimates.method)} {jobs.estimates.doing}"
        rows.append(RunningJob(text, None, "estimator.run"))
    capture = jobs.capture
    if capture.running and capture.request is not None:
        text = f"capture {capture.done} of {capture.request.frames}"
        share = min(capture.done / max(capture.request.frames, 1), 1.0)
        rows.append(RunningJob(text, share, "capture.stop", silent=capture.done == 0))
    if jobs.film is not None:
        rows.append(RunningJob(f"film {jobs.film.pictures} pictures", None, "film.stop"))
    if (film := jobs.flight_film) is not None:
        text = f"film of the flight, {film.share:.0%}"
        rows.append(RunningJob(text, film.share, "film.flight-stop", silent=not film.share))
    if jobs.hil.on:
        text = f"board: {jobs.hil.state}, {jobs.hil.sent} sent"
        rows.append(RunningJob(text, None, "hil.stop", silent=jobs.hil.sent == 0))
    if jobs.mesh is not None:
        rows.append(RunningJob(f"importing {jobs.mesh.name}", None, "file.open-stop", silent=True))
    for keep in jobs.keeping[:1]:
        text = f"writing the flight, {keep.files.share:.0%}"
        rows.append(RunningJob(text, keep.files.share, "timeline.keep-stop"))
    return rows
