"""A data set captured beside the flight: `flyaround capture` in its own process, watched through its files."""

from __future__ import annotations

import contextlib
import json
import os
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import msgspec
import numpy as np

from flyaround.gui.jobs.program import ChildProgram
from flyaround.simulator.camera.encoding import Encoding, decode
from flyaround.simulator.errors import UserError, write_error
from flyaround.simulator.imaging.display import screen_values
from flyaround.simulator.runtime.arrays import ByteArray
from flyaround.simulator.runtime.files import probe_writing
from flyaround.simulator.runtime.folder_lock import lock_name

LOOK_EVERY_S = 0.5
THUMBNAILS, THUMBNAIL_PX = 6, 200
MOST_FRAMES, MOST_WORKERS = 1_000_000, 64


@dataclass(frozen=True, kw_only=True)
class CaptureRequest:
    """Options of a capture.

    Parameters
    ----------
    what : str
        Name or file of a scenario or recipe.
    frames : int
        Number of frames.
    folder : Path
        Destination.
    formats : str, optional
        Comma-separated names.
    workers : int, optional
        Number of drawing processes.
    resume : bool, optional
        True to continue an existing set.
    """

    what: str
    frames: int
    folder: Path
    formats: str = "native"
    workers: int = 1
    resume: bool = False

    @property
    def arguments(self) -> tuple[str, ...]:
        """Arguments of `flyaround`."""
        words = ["capture", self.what, "-o", str(self.folder), "-n", str(self.frames)]
        if self.formats != "native":
            words += ["--format", self.formats]
        if self.workers != 1:
            words += ["--workers", str(self.workers)]
        if self.resume:
            words.append("--resume")
        return tuple(words)


@dataclass(frozen=True)
class Thumbnail:
    """A small picture of a written frame: (h, w) or (h, w, 3), RGB."""

    name: str
    image: ByteArray


class CaptureJob:
    """One capture; a finished or failed one stays visible."""

    def __init__(self) -> None:
        self._program: ChildProgram | None = None
        self._thumbs = ThreadPoolExecutor(1, thread_name_prefix="flyaround-thumbnails")
        self._decoding: Future[list[Thumbnail]] | None = None
        self._looked_s = 0.0
        self.request: CaptureRequest | None = None
        self.done = 0
        self.began_s = 0.0
        self.ended_s = 0.0
        self.outcome = ""
        """Outcome of the last capture in a sentence; empty while it runs, or without one."""
        self.thumbnails: list[Thumbnail] = []

    @property
    def running(self) -> bool:
        """True while a capture is running."""
        return self._program is not None

    @property
    def stopping(self) -> bool:
        """True once it has been asked to end."""
        return self._program is not None and self._program.stopped

    @property
    def elapsed_s(self) -> float:
        """Elapsed time [s]."""
        if self.request is None:
            return 0.0
        return (time.monotonic() if self.running else self.ended_s) - self.began_s

    @property
    def left_s(self) -> float | None:
        """Estimated remaining time [s]; None while unknown."""
        if self.request is None or not self.running or self.done < 2:
            return None
        return self.elapsed_s / self.done * max(self.request.frames - self.done, 0)

    def check(self, request: CaptureRequest) -> None:
        """Raise `UserError` if a capture is running, or the folder cannot be written or has files of others."""
        if self.running:
            raise UserError("a capture is under way: stop it, or wait for its end")
        folder = request.folder
        try:
            if (flaw := probe_writing(folder)) is not None:
                raise flaw
            full = folder.exists() and any(p.name != lock_name("capture") for p in folder.iterdir())
        except OSError as error:
            raise write_error(folder, error, "name another folder") from error
        # a data set must not be mixed with other files
        if full and not request.resume:
            raise UserError(f"folder {folder} is not empty; name another folder")

    def start(self, request: CaptureRequest) -> None:
        """Start a capture.

        Raises
        ------
        UserError
            If `check` refuses it.
        OSError
            If the program cannot be started.
        """
        self.check(request)
        self._program = ChildProgram((*request.arguments, "--json"))
        self.request, self.outcome, self.done, self.thumbnails = request, "", 0, []
        self.began_s = time.monotonic()
        self._looked_s = 0.0

    def stop(self) -> None:
        """Ask it to end; written frames stay, and it can be resumed."""
        if self._program is not None:
            self._program.stop()

    def update(self) -> str | None:
        """Check it from time to time; return a sentence at its end."""
        program, request = self._program, self.request
        if self._decoding is not None and self._decoding.done():
            self.thumbnails, self._decoding = self._decoding.result(), None
        if program is None or request is None:
            return None
        running = program.running
        now = time.monotonic()
        if running and now - self._looked_s < LOOK_EVERY_S:
            return None
        self._looked_s = now
        names = pictures_in(request.folder)
        if self._decoding is None and (len(names) != self.done or not running):
            self._decoding = self._thumbs.submit(thumbnails, request.folder, names[-THUMBNAILS:])
        self.done = len(names)
        if running:
            return None
        self.ended_s = now
        self.outcome = _outcome(program, request, self.done)
        self._program = None
        program.close()
        return self.outcome

    def close(self) -> None:
        """End it."""
        if self._program is not None:
            self._program.close()
            self._program = None
        self._thumbs.shutdown(cancel_futures=True)


def pictures_in(folder: Path) -> list[str]:
    """Return the names of the written pictures in order; those of all data sets, for a recipe of several."""
    names, others = [], {"images", "second", "quarantine"}
    try:
        places = ["images", *(f"{p.name}/images" for p in folder.iterdir() if p.name not in others)]
    except OSError:
        return []
    for place in places:
        with contextlib.suppress(OSError), os.scandir(folder / place) as entries:
            # layers have a second suffix: 000000.mask.png
            pictures = (e.name for e in entries if e.name.endswith(".png") and e.name.count(".") < 2)
            names += [f"{place}/{name}" for name in pictures]
    return sorted(names)


def thumbnails(folder: Path, names: list[str]) -> list[Thumbnail]:
    """Return small pictures of these files, without unreadable ones."""
    pictures = []
    for name in names:
        try:
            data = np.fromfile(folder / name, np.uint8)
            image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
        except (OSError, cv2.error):
            continue
        if image is None:
            continue
        scale = THUMBNAIL_PX / max(image.shape[1], 1)
        size = (THUMBNAIL_PX, max(1, round(image.shape[0] * scale)))
        small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        if small.ndim == 3:
            small = cv2.cvtColor(small, cv2.COLOR_BGR2RGB)
        # 10 or 12 bits are stored in 16: scale by the largest value
        full = 255 if small.dtype == np.uint8 else max(int(small.max()), 255)
        light = decode(small / full, _encoding(folder / name))
        pictures.append(Thumbnail(name, np.rint(255 * screen_values(light)).astype(np.uint8)))
    return pictures


class _Camera(msgspec.Struct):
    encoding: Encoding = "linear"


class _Record(msgspec.Struct):
    camera: _Camera


def _encoding(image: Path) -> Encoding:
    """Return the transfer function that the record beside an image names; linear if there is none."""
    try:
        return msgspec.json.decode(image.with_suffix(".json").read_bytes(), type=_Record).camera.encoding
    except (OSError, msgspec.MsgspecError):
        return "linear"


def _outcome(program: ChildProgram, request: CaptureRequest, done: int) -> str:
    if program.exit_code == 0:
        return f"captured: {_summary(program.output(), done)} in {request.folder}"
    again = f"flyaround {' '.join(request.arguments)}{'' if request.resume else ' --resume'} goes on"
    if program.stopped:
        return f"the capture was stopped after {done} of {request.frames} frames; {again}"
    # an option of the command line is no advice for a window
    why = program.last_error_line().replace(" with -o", "") or f"exit code {program.exit_code}"
    return f"the capture failed after {done} frames: {why}"


def _summary(text: str, done: int) -> str:
    """Return the number of written frames, and of quarantined ones."""
    try:
        report = json.loads(text)
        reports = report.get("members", {"": report}).values()
        n_written = sum(int(r["written"]) + int(r["kept"]) for r in reports)
        aside = sum(len(r["quarantined"]) for r in reports)
    except (ValueError, KeyError, TypeError, AttributeError):
        return f"{done} frames"
    return f"{n_written} frames" + (f", {aside} more put aside" if aside else "")
