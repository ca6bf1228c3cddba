"""The host's side of a link on the console's flight, in its own process: scenes and faults in, events out.

The pipe carries scenes, faults and, at the end, `Close` to the process, and each `Event` from it.

In lockstep, the next picture is of the flight's newest moment once the board has answered. The process draws complete
frames like `flyaround hil host`, with the same link, faults and ledger.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from multiprocessing import connection, parent_process
from multiprocessing.connection import Connection
from typing import Any, get_args

from flyaround.gui.picture.decline_cause import IN_SCENARIO, decline_cause
from flyaround.hil.host.faults.camera_faults import with_camera_faults
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.link_process.ipc import Close, Listening
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, open_frames
from flyaround.simulator.scenario.faults import CameraFault, Faults, LineFault
from flyaround.simulator.scene.state import SceneState

CAMERA_FAULTS: tuple[type, ...] = get_args(CameraFault)


@dataclass(frozen=True)
class SceneRequest:
    """Request for the newest scene of the flight."""


@dataclass(frozen=True)
class SessionNote:
    """A sentence for the operator."""

    text: str
    warning: bool = False


@dataclass(frozen=True)
class DeclineCause:
    """Why a board may decline a picture, and what to do; sent before the picture is."""

    frame_id: int
    text: str


Event = SceneRequest | DeclineCause | Listening | SessionNote | FrameRecord | LedgerSummary | UserError
"""Messages from the process; those of the host's modules are sent unchanged."""


def stream(pipe: Connection, config: RunConfig, device_index: int | None) -> None:
    """Run the host until told to stop; the entry point of the process."""
    threading.Thread(target=_leave_with_parent, name="watch parent", daemon=True).start()
    # closing the session interrupts it, like Ctrl-C
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    logging.getLogger("flyaround.hil.host").addHandler(_ToConsole(pipe))
    logging.getLogger("flyaround.hil.host").setLevel(logging.INFO)
    newest = _NewestScene(pipe)
    config = replace(config, new_line_faults=newest.take_line_faults)
    ends: list[LedgerSummary | UserError] = []
    try:
        run_host(
            newest.frames(device_index),
            config,
            on_row=pipe.send,
            on_listening=lambda *urls: pipe.send(Listening(*urls)),
            on_end=ends.append,
        )
    except (KeyboardInterrupt, BrokenPipeError):
        pass
    except UserError as error:
        ends.append(UserError(str(error)))
    except Exception as error:  # noqa: BLE001 - every failure is reported to the console
        ends.append(UserError(f"the session failed ({type(error).__name__}: {error})"))
    with contextlib.suppress(OSError, KeyboardInterrupt):
        for end in ends:
            pipe.send(end)


class _NewestScene:
    """The newest scene as frames, with the faults that arrived meanwhile."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._camera_faults: list[CameraFault] = []
        self._line_faults: list[LineFault] = []
        self._changed = False

    def frames(self, device_index: int | None) -> Iterator[Frame]:
        """Yield a frame for each scene that arrives, numbered from 0, until told to stop."""
        with open_frames(Frame.image_and_truth, processes=1, device_index=device_index, ahead=1) as producer:
            ready: deque[Frame] = deque()
            drained = iter(ready.popleft, None)
            faulty: Iterator[Frame] | None = None
            number = 0
            while (scene := self._next()) is not None:
                producer.submit(FrameRequest(scene=replace(scene, frame_index=number)))
                ready.append(producer.result())
                number += 1
                if faulty is None or self._changed:
                    self._changed = False
                    faulty = with_camera_faults(drained, Faults(camera=tuple(self._camera_faults)))
                frame = next(faulty)
                # of the picture that is sent, with its faults
                if cause := decline_cause(frame, scene.target.drawn(), IN_SCENARIO):
                    self._pipe.send(DeclineCause(frame.number, cause))
                yield frame

    def take_line_faults(self) -> list[LineFault]:
        """Return the line faults since the last frame."""
        faults, self._line_faults = self._line_faults, []
        return faults

    def _next(self) -> SceneState | None:
        """Wait for a new scene, keeping faults that arrive before it; return None at the end."""
        self._pipe.send(SceneRequest())
        with contextlib.suppress(EOFError):
            while not isinstance(message := self._pipe.recv(), SceneState | Close):
                if isinstance(message, CAMERA_FAULTS):
                    self._camera_faults.append(message)  # type: ignore[arg-type]
                    self._changed = True
                else:
                    self._line_faults.append(message)
            return message if isinstance(message, SceneState) else None
        return None


class _ToConsole(logging.Handler):
    """A logging handler that sends records to the operator."""

    def __init__(self, pipe: Connection) -> None:
        super().__init__(logging.INFO)
        self._pipe = pipe

    def emit(self, record: logging.LogRecord) -> None:
        """Send the record, if the console still exists."""
        with contextlib.suppress(OSError):
            self._pipe.send(SessionNote(record.getMessage(), record.levelno >= logging.WARNING))


def _leave_with_parent() -> None:
    """End as by Ctrl-C once the console has ended, which a killed one cannot announce."""
    parent: Any = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os.kill(os.getpid(), signal.SIGINT)
