"""One run of frames through the loop: lockstep or real time, with a ledger that always adds up."""

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

# frames handed to the link process and not yet sent: the renderer may run this far ahead
N_SLOTS = 4

# Ctrl-C and SIGTERM
ENDING = (signal.SIGINT, signal.SIGTERM)


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
        As `flyaround.hil.host.plan_frames` has them from the loop, drawn as they are needed.
    config : RunConfig
        With ``truth="separate"`` and no ``truth_url``, truth loggers connect one port up. An address that other
        machines reach needs a key.
    on_row : callable, optional
        Called with each row once its outcome is known, in that order.
    on_listening : callable, optional
        Called with the URLs once the ports are open.
    on_end : callable, optional
        Called with the summary after the ledger is closed, also if the run is interrupted or fails; Ctrl-C waits for
        it.

    Raises
    ------
    UserError
        If a port is in use, no board comes, or the ledger cannot be written (any more). The ledger of what
        went before is closed properly. Also if a recorder failed, after the run has come to its end.
    KeyboardInterrupt
        Ctrl-C, or SIGTERM where the program raises one of it; likewise.
    """
    check_access(config.link)
    # one anchor for the run: the wall clock may be set meanwhile, intervals stay true
    anchor_ns = time.time_ns() - time.monotonic_ns()
    terms = replace(with_truth_endpoint(config.link), utc_minus_monotonic_ns=anchor_ns)
    with HostLink(terms) as link:
        # ports first, so that a taken one is reported before anything is drawn or written
        run = BoardSink(link, replace(config, link=terms), on_row)
        ended: Ended = "failed"
        try:
            if on_listening is not None:
                on_listening(link.url, link.truth_url)
            run.open_books()
            iterator = iter(frames)
            first = next(iterator, None)
            if first is None:
                raise UserError("there is no frame to send: ask for at least one")
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
            ended = _send_all(run, _on_one_footing(first, iterator), config.new_line_faults)
        except KeyboardInterrupt:
            ended = "interrupted"
            raise
        finally:
            with signals_held():
                try:
                    summary = run.end(ended)
                    if on_end is not None:
                        on_end(summary)
                finally:
                    # those that draw end with the run, not when the last reference to them goes
                    if isinstance(frames, Generator):
                        frames.close()
    if run.recording_failures:
        raise UserError(
            f"{'; '.join(run.recording_failures)}; the run went on to its end, and its ledger is whole"
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


def _on_one_footing(first: Frame, rest: Iterator[Frame]) -> Iterator[Frame]:
    """Yield all frames, checked against the terms of the first."""
    yield first
    before = first
    for frame in rest:
        if frame.number <= before.number:
            raise ValueError(f"frame numbers must increase: {frame.number} after {before.number}")
        if (
            frame.scene.camera != first.scene.camera
            or frame.image.shape != first.image.shape
            or frame.image.dtype != first.image.dtype
            or frame.scene.sensor.bits != first.scene.sensor.bits
        ):
            raise ValueError(f"frame {frame.number} has another camera or image format than the first")
        yield frame
        before = frame


@contextmanager
def signals_held() -> Iterator[None]:
    """Hold SIGINT and SIGTERM back until the block is done, which must take a short and bounded time.

    Who stops a program often sends the signal twice (``timeout``, an impatient Ctrl-C): the second must not break off
    what the first began. Where an exception is on its way already, from inside or from before, they are forgotten: it
    ends the run as well.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread receives signals
        return
    came: list[int] = []
    before = {number: signal.signal(number, lambda number, _frame: came.append(number)) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler or signal.SIG_DFL)
    if came and sys.exc_info()[0] is None:
        signal.raise_signal(signal.Signals(came[0]))
