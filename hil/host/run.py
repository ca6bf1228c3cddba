"""One run of frames through the loop: lockstep or in real time, with a ledger that always adds up."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import msgspec

from flyaround.hil.host.board_command import board_command, board_url
from flyaround.hil.host.ledger.frames_csv import LedgerRow, LedgerWriter, ledger_row
from flyaround.hil.host.ledger.run_terms import FlownRecord, RunTerms, Versions, run_terms, write_terms
from flyaround.hil.host.ledger.summary import (
    SUMMARY_JSON,
    Board,
    ClosedLoopFigures,
    LedgerSummary,
    LedgerTally,
    LinkTotals,
    summarise,
)
from flyaround.hil.host.link_process.host_link import (
    CLOSE_TIMEOUT_S,
    QUICK_TIMEOUT_S,
    HostLink,
    choose_pixel_format,
)
from flyaround.hil.host.link_process.ipc import FrameResult, LinkConfig, Readout
from flyaround.hil.host.recording.recorder import Recorder
from flyaround.hil.host.signals import signals_held
from flyaround.hil.host.truth_policy import check_access, with_truth_endpoint
from flyaround.hil.link.packets.messages import HelloAck, Mode, TruthPolicy
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.labels.truth import truth_document
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.urls import without_secrets
from flyaround.simulator.scenario.faults import LineFault

logger = logging.getLogger(__name__)

# frames handed to the link process and not yet sent: the renderer may run this far ahead
N_SLOTS = 4
# realtime: the first exposure begins this long after its picture is ready
LEAD_NS = 20_000_000
CONNECT_TIMEOUT_S = 60.0

Ended = Literal["completed", "board_lost", "no_board", "interrupted", "failed"]

# what a board is told in the end
GOODBYES: dict[Ended, str] = {
    "completed": "the run is over",
    "board_lost": "the run is over: the board was not back in time",
    "no_board": "the run is over: no board was ready in time",
    "interrupted": "the run was stopped at the host",
    "failed": "the run failed at the host",
}


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """What a run is told before its first frame.

    Parameters
    ----------
    link : how the board and truth loggers connect.
    log_dir : for ``frames.csv`` and ``summary.json``; None keeps no files.
    connect_timeout_s : wait for the first board.
    window : most frames under way at once; the board may ask for fewer.
    deadline_s : a frame not answered within this is a miss; realtime's default is the frame interval.
    latency_s : realtime: the camera hands a picture over so long after the end of its exposure, whatever drawing took.
    target_name, target_sha256 : the target that is flown; a board with another model is refused.
    recorders : told each frame and its outcome; closed with the books.
    closed_loop : asked in the end what a closed loop came to; None where the frames follow a plan.
    decide_every_s : realtime, a closed loop: the next frame is asked for no earlier than so long after this one's
        exposure, with all poses that have come by then in.
    flown : what the record of the run says of it.
    new_line_faults : asked before each frame for faults of the line that begin now, where the link lets them be added.
    """

    link: LinkConfig
    log_dir: Path | None = None
    connect_timeout_s: float = CONNECT_TIMEOUT_S
    window: int = 2
    deadline_s: float | None = None
    latency_s: float = 0.0
    target_name: str = ""
    target_sha256: str = ""
    recorders: tuple[Recorder, ...] = ()
    closed_loop: Callable[[], ClosedLoopFigures | None] | None = None
    decide_every_s: float | None = None
    flown: FlownRecord | None = None
    new_line_faults: Callable[[], Iterable[LineFault]] = tuple


def run_host(
    frames: Iterable[Frame],
    config: RunConfig,
    *,
    on_row: Callable[[LedgerRow], None] | None = None,
    on_listening: Callable[[str, str | None], None] | None = None,
    on_end: Callable[[LedgerSummary], None] | None = None,
) -> LedgerSummary:
    """Send frames to a board and keep the ledger.

    Parameters
    ----------
    frames : as `flyaround.hil.host.plan_frames` has them from the loop, drawn as they are needed.
    config : with ``truth="separate"`` and no ``truth_url``, truth loggers connect one port up. An address that other
        machines reach needs a key.
    on_row : told each row once its outcome is known, in that order.
    on_listening : told the URLs once the ports are open.
    on_end : told the summary once the books are closed, also of a run that is interrupted or fails; Ctrl-C waits
        for it.

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
    run = BoardSink(
        terms, on_row, config.recorders, config.deadline_s, config.latency_s, config.decide_every_s
    )
    with HostLink(terms) as link:
        # ports first, so that a taken one is reported before anything is drawn or written
        run.link = link
        ended: Ended = "failed"
        try:
            if on_listening is not None:
                on_listening(link.url, link.truth_url)
            if config.log_dir is not None:
                run.open_books(config)
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
                    summary = run.end(ended, config)
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
    """All frames, checked against the terms that the first one settled."""
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


def _ms(ns: int | None) -> float | None:
    return None if ns is None else ns * 1e-6


def _readout(frame: Frame) -> Readout:
    """What part of the detector the image is, as far as the scene says."""
    detector, (height, width) = frame.scene.sensor.detector, frame.image.shape[:2]
    if detector is None:
        return Readout()
    b = detector.binning
    return Readout((detector.roi_x0_px, detector.roi_y0_px, b * width, b * height), b)


def _told_truth(frame: Frame) -> dict[str, object] | None:
    """The truth record of a frame, with the pixels that a time code covers."""
    if frame.truth is None:
        return None
    document: dict[str, object] = truth_document(frame.truth)
    return document if frame.time_code_px is None else document | {"time_code_px": list(frame.time_code_px)}


class BoardSink:
    """Sends each frame to the board, in lockstep or when it is due, and keeps the books of what became of them."""

    link: HostLink

    def __init__(
        self,
        config: LinkConfig,
        on_row: Callable[[LedgerRow], None] | None,
        recorders: tuple[Recorder, ...] = (),
        deadline_s: float | None = None,
        latency_s: float = 0.0,
        decide_every_s: float | None = None,
    ) -> None:
        self.config = config
        self._decide_every_s = decide_every_s
        self._deadline_ms = None if deadline_s is None else 1e3 * deadline_s
        self._latency_s = latency_s
        self._last_t_s: float | None = None
        self._recorders = list(recorders)
        self.writer: LedgerWriter | None = None
        self.tally = LedgerTally()
        self.is_lost = False
        self._on_row = on_row
        self._open: dict[int, Frame] = {}  # handed over, outcome not yet known
        self._started_utc = datetime.now(UTC).isoformat(timespec="seconds")
        self._origin_ns: int | None = None
        self.recording_failures: list[str] = []
        self._terms: RunTerms | None = None
        self._log_dir: Path | None = None

    def write(self, frame: Frame) -> None:
        """Send one frame; afterwards ``is_lost`` says whether the board stayed away for too long."""
        if self.config.mode == "lockstep":
            self._in_lockstep(frame)
        else:
            self._when_due(frame)

    def _in_lockstep(self, frame: Frame) -> None:
        """Frame out, outcome in."""
        if not self.link.wait_for_board(self.config.timeout_s):
            self.is_lost = True
            return
        while not self.link.has_room:
            self.link.pump(0.1)
        self._submit(frame, None)
        self.wait_for_outcomes()

    def _when_due(self, frame: Frame) -> None:
        """Frame out at the scenario's pace, the camera's latency after its exposure, whatever drawing and board do."""
        scene = frame.scene
        t_ns = round((scene.t_s + 0.5 * scene.exposure_s + self._latency_s) * 1e9)
        if self._origin_ns is None:
            # the first exposure begins now, not in the past
            start_ns = round((scene.t_s - 0.5 * scene.exposure_s) * 1e9)
            self._origin_ns = time.monotonic_ns() + LEAD_NS - start_ns
        if self._deadline_ms is None and self._last_t_s is not None:
            self._deadline_ms = 1e3 * (scene.t_s - self._last_t_s)
        self._last_t_s = scene.t_s
        self._collect(0.0)
        while not self.link.has_room:
            self._collect(0.1)
        self._submit(frame, self._origin_ns + t_ns)
        if self._decide_every_s is not None:
            # less the lead, in which the next one is drawn
            decide_ns = self._origin_ns + round((scene.t_s + self._decide_every_s) * 1e9) - LEAD_NS
            while (left_ns := decide_ns - time.monotonic_ns()) > 0:
                self._collect(1e-9 * left_ns)
        gone_s = time.monotonic() - self.link.down_since_s
        if self.link.board is None and gone_s > self.config.timeout_s:
            self.wait_for_outcomes()
            self.is_lost = True

    def open_books(self, config: RunConfig) -> None:
        """Begin the ledger, and write down what a run that is killed can no longer say."""
        assert config.log_dir is not None  # noqa: S101 - asked for where there is one
        self.writer = LedgerWriter(config.log_dir)
        self._log_dir = config.log_dir
        self._terms = run_terms(
            config.flown,
            started_utc=self._started_utc,
            mode=self.config.mode,
            truth=self.config.truth,
            url=without_secrets(self.link.url),
            timeout_s=self.config.timeout_s,
            deadline_ms=None if config.deadline_s is None else 1e3 * config.deadline_s,
            latency_ms=1e3 * config.latency_s if self.config.mode == "realtime" else None,
            faults=self.config.faults,
        )
        try:
            write_terms(config.log_dir, self._terms)
        except BaseException:
            # a ledger without its terms would stand in the way of the next try
            self.writer.discard()
            self.writer = None
            raise

    def record_board(self, gl_renderer: str) -> None:
        """Add the board that came, and the driver that drew, to the terms."""
        if self._log_dir is not None and self._terms is not None:
            versions, board = Versions.here(gl_renderer), self._board()
            write_terms(self._log_dir, msgspec.structs.replace(self._terms, versions=versions, board=board))

    def _board(self) -> Board | None:
        board = self.link.last_board
        if board is None:
            return None
        return Board(
            name=board.board,
            model=board.model_name,
            model_sha256=board.model_sha256,
            method=board.method,
            encoding=board.encoding,
            window=board.window,
        )

    def _tell(self, what: Callable[[Recorder], None]) -> None:
        """Tell the recorders; one that fails (a full disk) is left, and the run and its ledger go on to their end."""
        for recorder in tuple(self._recorders):
            try:
                what(recorder)
            except (OSError, RuntimeError) as error:
                self._recorders.remove(recorder)
                self.recording_failures.append(str(error))
                logger.warning("%s stops: %s", type(recorder).__name__, error)
                with contextlib.suppress(OSError, RuntimeError):  # said already
                    recorder.close()

    def end(self, ended: Ended, config: RunConfig) -> LedgerSummary:
        """Goodbye to the board, and the books closed; in a bounded time where the run was broken off.

        Raises
        ------
        UserError
            If rows or the summary of a run that went well cannot be written; of another, its own failure says more.
        """
        well = ended in {"completed", "board_lost"}
        self.link.close(GOODBYES[ended], CLOSE_TIMEOUT_S if well else QUICK_TIMEOUT_S)
        try:
            return self._close_books(ended, config)
        except UserError as error:
            if well:
                raise
            logger.info("%s", error)
            return self._summary(ended, config)
        finally:
            if self.writer is not None:
                self.writer.close()
            self._tell(lambda recorder: recorder.close())

    def _close_books(self, ended: Ended, config: RunConfig) -> LedgerSummary:
        """Frames without an outcome are dropped, the summary is written."""
        self._take_results()
        for frame_id in list(self._open):
            self._add(FrameResult(frame_id, f"dropped:{ended}", "the run ended before its outcome was known"))
        summary = self._summary(ended, config)
        if self.writer is not None and config.log_dir is not None:
            text = msgspec.json.format(msgspec.json.encode(summary), indent=1)
            write_atomic(config.log_dir / SUMMARY_JSON, text + b"\n")
        return summary

    def _summary(self, ended: Ended, config: RunConfig) -> LedgerSummary:
        deadline_ms = None if config.deadline_s is None else 1e3 * config.deadline_s
        if self.config.mode == "realtime" and deadline_ms is None:
            deadline_ms = self.tally.interval_ms()
        counts = self.link.counts
        return summarise(
            self.tally,
            started_utc=self._started_utc,
            ended=ended,
            board_gone=self.link.down_reason if ended in {"board_lost", "no_board"} else "",
            mode=self.config.mode,
            truth=self.config.truth,
            url=without_secrets(self.link.url),
            timeout_s=self.config.timeout_s,
            deadline_ms=deadline_ms,
            latency_ms=1e3 * self._latency_s if self.config.mode == "realtime" else None,
            closed_loop=None if config.closed_loop is None else config.closed_loop(),
            board=self._board(),
            link=LinkTotals(
                packets_sent=counts.packets_sent,
                packets_received=counts.packets_received,
                packets_corrupt=counts.packets_corrupt,
                protocol_mistakes=counts.protocol_mistakes,
                mistakes=counts.mistakes,
                sequence_gaps=counts.sequence_gaps,
                sessions=counts.sessions,
                late_poses=counts.late_poses,
                clock_round_trip_ms=_ms(counts.clock_round_trip_ns),
                clock_round_trip_ms_p50=_ms(counts.clock_round_trip_ns_p50),
                clock_round_trip_ms_p99=_ms(counts.clock_round_trip_ns_p99),
                clock_round_trip_ms_max=_ms(counts.clock_round_trip_ns_max),
                clock_offset_bound_ms=_ms(counts.clock_offset_bound_ns),
                clock_drift_ppm=counts.clock_drift_ppm,
                clock_drift_ppm_sigma=counts.clock_drift_ppm_sigma,
            ),
        )

    def _submit(self, frame: Frame, due_ns: int | None) -> None:
        self._open[frame.number] = frame.without_image()
        scene = frame.scene
        self.link.submit(
            frame.image,
            frame_id=frame.number,
            epoch_utc=scene.epoch_utc,
            t_s=scene.t_s,
            exposure_s=scene.exposure_s,
            bits=scene.sensor.bits,
            due_ns=due_ns,
            truth=None if self.config.truth == "off" else _told_truth(frame),
            latency_s=self._latency_s,
            camera_frame=frame.camera_frame,
            readout=_readout(frame),
        )
        self._tell(lambda recorder: recorder.frame(frame))

    def wait_for_outcomes(self) -> None:
        """Wait until every frame that was handed over has its outcome; the link process sees to that."""
        while self._open:
            self._collect(0.5)

    def _collect(self, timeout_s: float) -> None:
        self.link.pump(timeout_s)
        self._take_results()

    def _take_results(self) -> None:
        for result in self.link.results():
            self._add(result)

    def _add(self, result: FrameResult) -> None:
        frame = self._open.pop(result.frame_id)
        row = ledger_row(frame, result, self.config.utc_minus_monotonic_ns, self._deadline_ms)
        self.tally.add(row)
        self._tell(lambda recorder: recorder.row(frame, row))
        if self.writer is not None:
            self.writer.add(row)
        if self._on_row is not None:
            self._on_row(row)
