"""One run of frames through the loop, in lockstep or real time, with a ledger that accounts for every frame."""

from __future__ import annotations

import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import msgspec

from flyaround.hil.host.board_command import board_command, board_url
from flyaround.hil.host.board_sink import BoardSink
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.link_process.host_link import HostLink, choose_pixel_format
from flyaround.hil.host.run_config import Ended, RunConfig
from flyaround.hil.host.truth_policy import check_access, with_truth_endpoint
from flyaround.hil.link.packets.messages import HelloAck, Mode, TruthPolicy
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.scenario.faults import LineFault

__all__ = ["RunConfig", "run_host"]

# Number of frames that the renderer may run ahead of the link process, for a steady flow.
N_SLOTS = 4

# Signals that end a run: Ctrl-C and SIGTERM
END_SIGNALS = (signal.SIGINT, signal.SIGTERM)


def run_host(
    frames: Iterable[Frame],
    config: RunConfig,
    *,
    on_row: Callable[[FrameRecord], None] | None = None,
    on_listening: Callable[[str, str | None], None] | None = None,
    on_end: Callable[[LedgerSummary], None] | None = None,
) -> LedgerSummary:
    """Send frames to a board and keep the ledger.

    Parameters
    ----------
    frames : iterable of Frame
        Frames in order, such as those of `flyaround.hil.host.plan_frames`, rendered on demand.
    config : RunConfig
        Settings of the run. With ``truth="separate"`` and no ``truth_url``, truth loggers connect to the next port. An
        address that other machines can reach needs a key.
    on_row : callable, optional
        Called with each row once its outcome is known, in order of the outcomes.
    on_listening : callable, optional
        Called with the URLs once the ports are open.
    on_end : callable, optional
        Called with the summary after the ledger is closed, even if the run is interrupted or fails; Ctrl-C waits for
        it.

    Returns
    -------
    LedgerSummary
        Counts, latencies [ms] and errors of the run.

    Raises
    ------
    UserError
        If a port is in use, no board connects, or the ledger cannot be written; the ledger is closed properly
        nevertheless. Also if a recorder failed, once the run is complete.
    KeyboardInterrupt
        On Ctrl-C, or on SIGTERM if the program converts it; the ledger is closed properly.
    """
    check_access(config.link)
    # one anchor for the run: the wall clock may be changed, intervals must not
    anchor_ns = time.time_ns() - time.monotonic_ns()
    terms = replace(with_truth_endpoint(config.link), utc_minus_monotonic_ns=anchor_ns)
    with HostLink(terms) as link:
        # open the ports first, so that one in use is reported before anything is rendered or written
        run = BoardSink(link, replace(config, link=terms), on_row)
        ended: Ended = "failed"
        try:
            if on_listening is not None:
                on_listening(link.url, link.truth_url)
            run.open_ledger()
            iterator = iter(frames)
            first = next(iterator, None)
            if first is None:
                raise UserError("there is no frame to send: request at least one")
            ack = HelloAck(
                camera=msgspec.to_builtins(first.scene.camera),
                width_px=first.image.shape[1],
                height_px=first.image.shape[0],
                bits=first.scene.sensor.bits,
                pixel_format=choose_pixel_format(
                    first.scene.sensor.bits, first.image.shape[2:], config.link.pixel_format
                ),
                mode=Mode[terms.mode.upper()],
                truth=TruthPolicy[terms.truth.upper()],
                window=config.window,
                target_name=config.target_name,
                target_sha256=config.target_sha256,
            )
            link.open(ack, N_SLOTS, first.image.nbytes)
            if not link.wait_for_board(config.connect_timeout_s):
                ended = "no_board"
                refused = f" (last: {link.down_reason})" if link.down_reason else ""
                command = board_command(link.url, config.target_name, keyed=config.link.key is not None)
                raise UserError(
                    f"no board connected to {board_url(link.url)} within {config.connect_timeout_s:g} s{refused}:"
                    f" start one with `{command}`"
                )
            run.record_board("" if first.truth is None else first.truth.software.gl_renderer)
            ended = _send_all(run, _checked_frames(first, iterator), config.new_line_faults)
        except KeyboardInterrupt:
            ended = "interrupted"
            raise
        finally:
            with deferred_signals():
                try:
                    summary = run.end(ended)
                    if on_end is not None:
                        on_end(summary)
                finally:
                    # stop the render processes with the run, not with the last reference to the generator
                    if isinstance(frames, Generator):
                        frames.close()
    if run.recording_failures:
        raise UserError(
            f"{'; '.join(run.recording_failures)}; the run continued to its end, and its ledger is complete"
        )
    return summary


def _send_all(
    board: BoardSink, frames: Iterator[Frame], new_line_faults: Callable[[], Iterable[LineFault]]
) -> Ended:
    for frame in frames:
        for fault in new_line_faults():
            board.link.add_line_fault(fault)
        board.write(frame)
        if board.is_lost:
            return "board_lost"
    board.wait_for_outcomes()
    return "completed"


def _checked_frames(first: Frame, remaining: Iterator[Frame]) -> Iterator[Frame]:
    """Yield all frames, checked for consistency with the first one."""
    yield first
    previous = first
    for frame in remaining:
        if frame.number <= previous.number:
            raise ValueError(f"frame numbers must increase: {frame.number} after {previous.number}")
        if (
            frame.scene.camera != first.scene.camera
            or frame.image.shape != first.image.shape
            or frame.image.dtype != first.image.dtype
            or frame.scene.sensor.bits != first.scene.sensor.bits
        ):
            raise ValueError(f"frame {frame.number} has another camera or image format than the first")
        yield frame
        previous = frame


@contextmanager
def deferred_signals() -> Iterator[None]:
    """Defer SIGINT and SIGTERM until the end of the block, which must take a short and bounded time.

    Users and programs such as ``timeout`` often send the signal twice, and the second must not interrupt the handling
    of the first. If an exception is raised in the block, or was in progress before it, deferred signals are discarded,
    because the exception ends the run anyway.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread receives signals
        return
    received: list[int] = []
    handlers = {
        number: signal.signal(number, lambda number, _frame: received.append(number))
        for number in END_SIGNALS
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler or signal.SIG_DFL)
    if received and sys.exc_info()[0] is None:
        signal.raise_signal(signal.Signals(received[0]))
