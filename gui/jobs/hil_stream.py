"""The host's side of a link on the console's flight, in a process of its own: newest moment in, ledger rows out.

In lockstep: the next picture is of the newest moment of the flight once the board has answered. The process draws it
whole, as `flyaround hil host` does, and runs the same link, faults and ledger.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
from collections import deque
from dataclasses import dataclass, replace
from multiprocessing import connection, parent_process
from typing import TYPE_CHECKING, Any, get_args

from flyaround.hil.host.faults.camera_faults import with_camera_faults
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, open_frames
from flyaround.simulator.scenario.faults import CameraFault, Faults, LineFault
from flyaround.simulator.scene.state import SceneState

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.connection import Connection

    from flyaround.hil.host.ledger.frames_csv import LedgerRow
    from flyaround.hil.host.ledger.summary import LedgerSummary

CAMERA_FAULTS: tuple[type, ...] = get_args(CameraFault)


@dataclass(frozen=True)
class StopStream:
    """To the process: end the session, and close the books."""


@dataclass(frozen=True)
class Wanted:
    """From the process: it would draw the newest moment now."""


@dataclass(frozen=True)
class ListeningAt:
    """From the process: boards may connect."""

    url: str


@dataclass(frozen=True)
class Said:
    """From the process: what the link has to say."""

    text: str
    warning: bool


@dataclass(frozen=True)
class Row:
    """From the process: what became of a frame."""

    row: LedgerRow


@dataclass(frozen=True)
class Ended:
    """From the process: the books are closed; or why there are none."""

    summary: LedgerSummary | None
    why: str = ""


def stream(pipe: Connection, config: RunConfig, device_index: int | None) -> None:
    """Be the host until told to stop; what the process runs."""
    threading.Thread(target=_leave_with_parent, name="watch parent", daemon=True).start()
    # who closes the session interrupts it, as Ctrl-C does
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    logging.getLogger("flyaround.hil.host").addHandler(_ToConsole(pipe))
    logging.getLogger("flyaround.hil.host").setLevel(logging.INFO)
    newest = _Newest(pipe)
    config = replace(config, new_line_faults=newest.take_line_faults)
    ends: list[LedgerSummary] = []
    why = ""
    try:
        run_host(
            newest.frames(device_index),
            config,
            on_row=lambda row: pipe.send(Row(row)),
            on_listening=lambda url, _truth: pipe.send(ListeningAt(url)),
            on_end=ends.append,
        )
    except (KeyboardInterrupt, BrokenPipeError):
        pass
    except UserError as error:
        why = str(error)
    except Exception as error:  # noqa: BLE001 - the console is told, whatever it was
        why = f"the session failed ({type(error).__name__}: {error})"
    with contextlib.suppress(OSError, KeyboardInterrupt):
        pipe.send(Ended(ends[0] if ends else None, why))


class _Newest:
    """The newest moment as frames, with the faults that came meanwhile."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._camera_faults: list[CameraFault] = []
        self._line_faults: list[LineFault] = []
        self._changed = False
        self._scene: SceneState | None = None
        self._over = False

    def frames(self, device_index: int | None) -> Iterator[Frame]:
        """A frame for each scene that is handed over, numbered from 0, until told to stop."""
        with open_frames(Frame.image_and_truth, processes=1, device_index=device_index, ahead=1) as producer:
            ready: deque[Frame] = deque()
            faulty: Iterator[Frame] | None = None
            number = 0
            while (scene := self._next()) is not None:
                producer.submit(FrameRequest(scene=replace(scene, frame_index=number)))
                ready.append(producer.result())
                number += 1
                if faulty is None or self._changed:
                    self._changed = False
                    faulty = with_camera_faults(_handed(ready), Faults(camera=tuple(self._camera_faults)))
                yield next(faulty)

    def take_line_faults(self) -> list[LineFault]:
        """Those that came since the last frame."""
        taken, self._line_faults = self._line_faults, []
        return taken

    def _next(self) -> SceneState | None:
        """The newest scene; waits for one that is not drawn yet. None at the end."""
        self._pipe.send(Wanted())
        self._scene = None
        while self._scene is None and not self._over:
            try:
                self._take(self._pipe.recv())
            except EOFError:
                self._over = True
        return None if self._over else self._scene

    def _take(self, message: object) -> None:
        if isinstance(message, SceneState):
            self._scene = message
        elif isinstance(message, StopStream):
            self._over = True
        elif isinstance(message, CAMERA_FAULTS):
            self._camera_faults.append(message)  # type: ignore[arg-type]
            self._changed = True
        else:
            self._line_faults.append(message)  # type: ignore[arg-type]


def _handed(ready: deque[Frame]) -> Iterator[Frame]:
    """Frames as they are put there; asked only when there is one."""
    while True:
        yield ready.popleft()


class _ToConsole(logging.Handler):
    """What the link logs goes to the operator."""

    def __init__(self, pipe: Connection) -> None:
        super().__init__(logging.INFO)
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        """Send it; a console that is gone needs no words."""
        with contextlib.suppress(OSError):
            self._pipe.send(Said(record.getMessage(), record.levelno >= logging.WARNING))


def _leave_with_parent() -> None:
    """End as by Ctrl-C once the console is gone: one that was killed tells nobody."""
    parent: Any = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os.kill(os.getpid(), signal.SIGINT)
