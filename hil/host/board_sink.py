"""Sink of a run that sends each frame to the board and records its outcome."""

from __future__ import annotations

import contextlib
import logging
import time
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.hil.host.frame_record import FrameRecord, complete
from flyaround.hil.host.ledger.frames_csv import LedgerWriter
from flyaround.hil.host.ledger.run_terms import RunTerms, Versions, run_terms, write_terms
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, LedgerSummary, LedgerTally, summarise
from flyaround.hil.host.link_process.host_link import CLOSE_TIMEOUT_S, QUICK_TIMEOUT_S, HostLink
from flyaround.hil.host.link_process.ipc import Board, FrameJob, Readout
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import truth_document
from flyaround.simulator.runtime.files import write_document
from flyaround.simulator.runtime.urls import without_secrets

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.host.recording.recorder import Recorder
    from flyaround.hil.host.run_config import Ended, RunConfig
    from flyaround.simulator.frame import Frame

logger = logging.getLogger(__name__)

# Real time: delay from the first image being ready to the first exposure [ns].
FIRST_EXPOSURE_DELAY_NS = 20_000_000

# Time for which one call waits for the board's messages [s]: a lost board is noticed after it at the latest.
POLL_S = 0.1

# Reason in the goodbye message, by the end of the run.
GOODBYES: dict[Ended, str] = {
    "completed": "the run is over",
    "board_lost": "the run is over: the board did not reconnect in time",
    "no_board": "the run is over: no board was ready in time",
    "interrupted": "the run was stopped at the host",
    "failed": "the run failed at the host",
}


def _readout(frame: Frame) -> Readout:
    """Return the region of the detector that the image shows, if the scene defines one."""
    detector, (height, width) = frame.scene.sensor.detector, frame.image.shape[:2]
    if detector is None:
        return Readout()
    b = detector.binning
    return Readout((detector.roi_x0_px, detector.roi_y0_px, b * width, b * height), b)


def _truth_record(frame: Frame) -> dict[str, object] | None:
    """Return the truth record of a frame, with the pixels that a time code covers."""
    if frame.truth is None:
        return None
    document: dict[str, object] = truth_document(frame.truth)
    return document if frame.time_code_px is None else document | {"time_code_px": list(frame.time_code_px)}


class BoardSink:
    """Sink that sends each frame to the board, in lockstep or when due, and records the outcomes."""

    def __init__(
        self, link: HostLink, config: RunConfig, on_row: Callable[[FrameRecord], None] | None
    ) -> None:
        self.link, self.config, self._on_row = link, config, on_row
        self._realtime = config.link.mode == "realtime"
        self._deadline_ms = None if config.deadline_s is None else 1e3 * config.deadline_s
        self._last_t_s: float | None = None
        self._recorders = list(config.recorders)
        self._writer: LedgerWriter | None = None
        self._tally = LedgerTally()
        self.is_lost = False
        self._open: dict[int, Frame] = {}  # handed over, outcome still unknown
        self._started_utc = datetime.now(UTC).isoformat(timespec="seconds")
        self._origin_ns: int | None = None
        self.recording_failures: list[str] = []
        self._terms: RunTerms | None = None

    def write(self, frame: Frame) -> None:
        """Send one frame; afterwards ``is_lost`` is True if the board did not reconnect in time."""
        if self._realtime:
            self._send_when_due(frame)
        else:
            self._send_in_lockstep(frame)

    def _send_in_lockstep(self, frame: Frame) -> None:
        """Send a frame and wait for its outcome."""
        if not self.link.wait_for_board(self.config.link.timeout_s):
            self.is_lost = True
            return
        while not self.link.has_room:
            self.link.pump(POLL_S)
        self._submit(frame, None)
        self.wait_for_outcomes()

    def _send_when_due(self, frame: Frame) -> None:
        """Send a frame at the scenario's pace, a constant latency after its exposure.

        The schedule does not depend on the speed of renderer or board.
        """
        scene = frame.scene
        t_ns = round((scene.t_s + 0.5 * scene.exposure_s + self.config.latency_s) * 1e9)
        if self._origin_ns is None:
            # the first exposure begins now, not in the past
            start_ns = round((scene.t_s - 0.5 * scene.exposure_s) * 1e9)
            self._origin_ns = time.monotonic_ns() + FIRST_EXPOSURE_DELAY_NS - start_ns
        if self._deadline_ms is None and self._last_t_s is not None:
            self._deadline_ms = 1e3 * (scene.t_s - self._last_t_s)
        self._last_t_s = scene.t_s
        self._collect(0.0)
        while not self.link.has_room:
            self._collect(POLL_S)
        self._submit(frame, self._origin_ns + t_ns)
        if self.config.decide_every_s is not None:
            # reserve the lead time for rendering the next frame
            decide_ns = (
                self._origin_ns
                + round((scene.t_s + self.config.decide_every_s) * 1e9)
                - FIRST_EXPOSURE_DELAY_NS
            )
            while (left_ns := decide_ns - time.monotonic_ns()) > 0:
                self._collect(1e-9 * left_ns)
        down_s = time.monotonic() - self.link.down_since_s
        if self.link.board is None and down_s > self.config.link.timeout_s:
            self.wait_for_outcomes()
            self.is_lost = True

    def open_ledger(self) -> None:
        """Open the ledger, if any, and write the run's terms, which a killed run could not write later."""
        config = self.config
        if config.log_dir is None:
            return
        self._writer = LedgerWriter(config.log_dir)
        self._terms = run_terms(
            config.provenance,
            deadline_ms=self._deadline_ms,
            faults=config.link.faults,
            **self._run_settings(),
        )
        try:
            write_terms(config.log_dir, self._terms)
        except BaseException:
            # a ledger without terms would block the next attempt
            self._writer.discard()
            self._writer = None
            raise

    def _run_settings(self) -> dict[str, Any]:
        """Return the run's settings for terms and summary."""
        link = self.config.link
        return {
            "started_utc": self._started_utc,
            "mode": link.mode,
            "truth": link.truth,
            "url": without_secrets(self.link.url),
            "timeout_s": link.timeout_s,
            "latency_ms": 1e3 * self.config.latency_s if self._realtime else None,
        }

    def record_board(self, gl_renderer: str) -> None:
        """Add the board and the graphics driver to the terms."""
        if self.config.send_sun and self.link.board is not None and not self.link.board.takes_fields:
            logger.warning("this board accepts no optional fields: the Sun direction is not sent")
        if self.config.log_dir is not None and self._terms is not None:
            versions, board = Versions.here(gl_renderer), self._board()
            sun_sent = self.config.send_sun and self.link.board is not None and self.link.board.takes_fields
            terms = msgspec.structs.replace(self._terms, versions=versions, board=board, sun_sent=sun_sent)
            write_terms(self.config.log_dir, terms)

    def _board(self) -> Board | None:
        return None if self.link.last_board is None else self.link.last_board.board

    def _notify(self, call: Callable[[Recorder], None]) -> None:
        """Call each recorder. One that fails, such as on a full disk, is dropped; the run and its ledger continue."""
        for recorder in tuple(self._recorders):
            try:
                call(recorder)
            except (OSError, RuntimeError) as error:
                self._recorders.remove(recorder)
                self.recording_failures.append(str(error))
                logger.warning("%s stops: %s", type(recorder).__name__, error)
                with contextlib.suppress(OSError, RuntimeError):  # reported already
                    recorder.close()

    def end(self, ended: Ended) -> LedgerSummary:
        """Say goodbye to the board and close the ledger, within a bounded time if the run was interrupted.

        Raises
        ------
        UserError
            If the ledger or summary of a successful run cannot be written; after a failure, its error is raised.
        """
        is_regular = ended in {"completed", "board_lost"}
        self.link.close(GOODBYES[ended], CLOSE_TIMEOUT_S if is_regular else QUICK_TIMEOUT_S)
        try:
            return self._close_ledger(ended)
        except UserError as error:
            if is_regular:
                raise
            logger.info("%s", error)
            return self._summary(ended)
        finally:
            if self._writer is not None:
                self._writer.close()
            self._notify(lambda recorder: recorder.close())

    def _close_ledger(self, ended: Ended) -> LedgerSummary:
        """Drop frames without an outcome, and write the summary."""
        self._take_results()
        for frame in list(self._open.values()):
            record = FrameRecord.from_frame(frame)
            self._add(record.with_outcome(f"dropped:{ended}", "the run ended before its outcome was known"))
        summary = self._summary(ended)
        if self._writer is not None and self.config.log_dir is not None:
            write_document(self.config.log_dir / SUMMARY_JSON, summary)
        return summary

    def _summary(self, ended: Ended) -> LedgerSummary:
        deadline_ms = None if self.config.deadline_s is None else 1e3 * self.config.deadline_s
        if self._realtime and deadline_ms is None:
            deadline_ms = self._tally.interval_ms()
        return summarise(
            self._tally,
            ended=ended,
            board_gone=self.link.down_reason if ended in {"board_lost", "no_board"} else "",
            deadline_ms=deadline_ms,
            closed_loop=None if self.config.closed_loop is None else self.config.closed_loop(),
            board=self._board(),
            link=self.link.counts,
            **self._run_settings(),
        )

    def _submit(self, frame: Frame, due_ns: int | None) -> None:
        self._open[frame.number] = frame.without_image()
        job = FrameJob(
            record=FrameRecord.from_frame(frame).with_times(due_ns=due_ns, latency_s=self.config.latency_s),
            bits=frame.scene.sensor.bits,
            truth=None if self.config.link.truth == "off" else _truth_record(frame),
            camera_frame=frame.number if frame.camera_frame is None else frame.camera_frame,
            readout=_readout(frame),
            sun_camera=frame.scene.sun_direction_camera if self.config.send_sun else None,
        )
        self.link.submit(frame.image, job)
        self._notify(lambda recorder: recorder.frame(frame))

    def wait_for_outcomes(self) -> None:
        """Wait until every submitted frame has an outcome, which the link process guarantees."""
        while self._open:
            self._collect(0.5)

    def _collect(self, timeout_s: float) -> None:
        self.link.pump(timeout_s)
        self._take_results()

    def _take_results(self) -> None:
        for result in self.link.results():
            self._add(result)

    def _add(self, record: FrameRecord) -> None:
        frame = self._open.pop(record.frame_id)
        truth = frame.truth
        row = complete(
            record,
            None if truth is None else (truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m),
            self.config.link.utc_minus_monotonic_ns,
            self._deadline_ms,
        )
        self._tally.add(row)
        self._notify(lambda recorder: recorder.row(frame, row))
        if self._writer is not None:
            self._writer.add(row)
        if self._on_row is not None:
            self._on_row(row)
