"""Camera behind the endpoint: starts the endpoint process, and renders images when they are due."""

from __future__ import annotations

import contextlib
import multiprocessing
import time
from typing import TYPE_CHECKING

from flyaround.hil.host.camera_endpoint.endpoint import serve_endpoint
from flyaround.hil.host.camera_endpoint.messages import (
    ImageRequest,
    ImageResult,
    Note,
    Opened,
    PictureOutcome,
    Stop,
)
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Callable
    from multiprocessing.connection import Connection

    from flyaround.hil.host.camera_endpoint.camera_ledger import CameraLedger
    from flyaround.hil.host.camera_endpoint.messages import EndpointConfig
    from flyaround.hil.host.camera_endpoint.pictures import Pictures

WARNING = (
    "It cannot authenticate: the protocol has no password, nothing is encrypted, and an address can be forged."
    " Use it on a private network."
)

# Time-out for the endpoint process to start [s], which on a loaded machine takes seconds, and interval at which
# ``stopped`` is polled [s].
START_TIMEOUT_S = 60.0
POLL_S = 0.2

# Time-out for the endpoint process to end, and for its last messages [s].
STOP_TIMEOUT_S = 3.0
_PROCESS_ENDED = "the camera endpoint's process ended unexpectedly; run again with -v"


def run_camera(
    pictures: Pictures,
    config: EndpointConfig,
    *,
    ledger: CameraLedger | None = None,
    on_opened: Callable[[str | None], None] | None = None,
    on_note: Callable[[str], None] | None = None,
    stopped: Callable[[], bool] | None = None,
) -> None:
    """Serve a camera until it is stopped.

    Parameters
    ----------
    pictures : Pictures
        Source of the images.
    config : EndpointConfig
        Settings of the endpoint process.
    ledger : CameraLedger, optional
        Ledger of each image and the board's answer, if ``config`` has an answer port.
    on_opened : callable, optional
        Called with the URL for answers once the camera can be discovered.
    on_note : callable, optional
        Called with a sentence when a controller or board connects, disconnects or is refused.
    stopped : callable, optional
        Polled several times a second; the camera stops when it returns True. By default it runs until Ctrl-C.

    Raises
    ------
    UserError
        If the port is in use or not permitted.
    """
    context = multiprocessing.get_context("spawn")
    pipe, child_pipe = context.Pipe()
    process = context.Process(
        target=serve_endpoint, args=(child_pipe, config), daemon=True, name="flyaround camera endpoint"
    )
    process.start()
    child_pipe.close()
    try:
        if not pipe.poll(START_TIMEOUT_S):
            raise UserError("the camera endpoint's process did not start; run again with -v")
        while stopped is None or not stopped():
            if not pipe.poll(POLL_S):
                continue
            message = pipe.recv()
            if isinstance(message, ImageRequest):
                _draw(pictures, message, pipe, ledger)
            elif isinstance(message, PictureOutcome):
                if ledger is not None:
                    ledger.record_outcome(message.request_id, message.record)
            elif isinstance(message, Note) and on_note is not None:
                on_note(message.sentence)
            elif isinstance(message, Opened) and on_opened is not None:
                on_opened(message.answers_url)
            elif isinstance(message, UserError):
                raise message
    except (EOFError, BrokenPipeError, ConnectionResetError):
        raise UserError(_PROCESS_ENDED) from None
    finally:
        with contextlib.suppress(OSError, EOFError):
            _stop(pipe, ledger)
        pipe.close()
        process.join(STOP_TIMEOUT_S)
        if process.is_alive():
            process.kill()
            process.join()
        process.close()


def _draw(pictures: Pictures, request: ImageRequest, pipe: Connection, ledger: CameraLedger | None) -> None:
    """Pass an image to the endpoint. A render process that dies is restarted."""
    start_s = time.monotonic()
    picture = pictures.take(request)
    while picture is None:
        picture = pictures.take(request)
    if ledger is not None and picture.scene is not None:
        ledger.drawn(request.request_id, picture.scene, 1e3 * (time.monotonic() - start_s))
    pipe.send(ImageResult(request.request_id, picture.image))


def _stop(pipe: Connection, ledger: CameraLedger | None) -> None:
    """Stop the endpoint, and collect its last outcomes."""
    pipe.send(Stop())
    while pipe.poll(STOP_TIMEOUT_S):
        message = pipe.recv()
        if isinstance(message, PictureOutcome) and ledger is not None:
            ledger.record_outcome(message.request_id, message.record)
