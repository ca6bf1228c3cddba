"""One run of frames through the loop: lockstep or in real time, with a ledger that always adds up."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from hil.host.exchange import FrameResult, LinkConfig
from hil.host.ledger import LedgerRow, LedgerWriter, pose_errors
from hil.host.server import HostLink
from hil.host.summary import SUMMARY_JSON, Board, LedgerSummary, LinkTotals, summarise
from hil.link.errors import LinkError
from hil.link.messages import HelloAck, Mode, TruthPolicy
from hil.link.transport import parse_url
from simulator.errors import UserError
from simulator.files import write_atomic

logger = logging.getLogger(__name__)

# frames handed to the link process and not yet sent: the renderer may run this far ahead
N_SLOTS = 4
# realtime: the first frame is due this long after it is ready
LEAD_NS = 20_000_000
CONNECT_TIMEOUT_S = 60.0

Ended = Literal["completed", "board_lost", "no_board", "interrupted", "failed"]


@dataclass(frozen=True)
class HostFrame:
    """A frame ready to be sent.

    Parameters
    ----------
    frame_id : strictly increasing over a run.
    epoch_utc, t_s : mid-exposure.
    image : (H, W) uint8 (or uint16).
    camera : the camera JSON object; the same for all frames of a run.
    truth : JSON-able; stays at the host, or goes where ``truth`` of the link says.
    render_ms : what drawing it cost.
    """

    frame_id: int
    epoch_utc: str
    t_s: float
    exposure_s: float
    image: np.typing.NDArray[np.uint8]
    camera: dict[str, Any]
    truth: dict[str, Any]
    render_ms: float


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """What a run is told before its first frame.

    Parameters
    ----------
    link : how the board and truth loggers connect.
    log_dir : for ``frames.csv`` and ``summary.json``; None keeps no files.
    connect_timeout_s : wait for the first board.
    window : most frames under way at once; the board may ask for fewer.
    deadline_s : a pose later than this counts as a miss; realtime's default is the frame interval.
    target_name, target_sha256 : the target that is flown; a board with another model is refused.
    """

    link: LinkConfig
    log_dir: Path | None = None
    connect_timeout_s: float = CONNECT_TIMEOUT_S
    window: int = 2
    deadline_s: float | None = None
    target_name: str = ""
    target_sha256: str = ""


def default_truth_url(url: str) -> str:
    """Same host, next port (port 0 stays 0); the loopback for serial lines.

    Raises
    ------
    UserError
        If the URL is bad.
    """
    try:
        scheme, host, port = parse_url(url)
    except LinkError as error:
        raise UserError(str(error)) from error
    if scheme != "tcp":
        return "tcp://127.0.0.1:5601"
    host = f"[{host}]" if ":" in host else host
    return f"tcp://{host}:{port + 1 if port else 0}"


def run_host(
    frames: Iterable[HostFrame],
    config: RunConfig,
    *,
    on_row: Callable[[LedgerRow], None] | None = None,
    on_listening: Callable[[str, str | None], None] | None = None,
) -> LedgerSummary:
    """Send frames to a board and keep the ledger.

    Parameters
    ----------
    frames : drawn as they are needed.
    config : with ``truth="separate"`` and no ``truth_url``, truth loggers connect one port up.
    on_row : told each row once its outcome is known, in that order.
    on_listening : told the URLs once the ports are open.

    Raises
    ------
    UserError
        If a port is in use, no board comes, or the log folder cannot be written. The ledger of what
        went before is closed properly.
    """
    terms = _with_truth_endpoint(config.link)
    run = _Run(terms, on_row)
    with HostLink(terms) as link:
        # ports first, so that a taken one is reported before anything is drawn or written
        run.link = link
        if on_listening is not None:
            on_listening(link.url, link.truth_url)
        if config.log_dir is not None:
            run.writer = LedgerWriter(config.log_dir)
        ended: Ended = "failed"
        try:
            iterator = iter(frames)
            first = next(iterator, None)
            if first is None:
                raise UserError("there is no frame to send: ask for at least one")
            ack = HelloAck(
                camera=first.camera,
                width_px=first.image.shape[1],
                height_px=first.image.shape[0],
                bits=8 * first.image.dtype.itemsize,
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
                raise UserError(
                    f"no board connected to {link.url} within {config.connect_timeout_s:g} s{refused}:"
                    f" start one with `flyaround hil board {link.url}`"
                )
            every = _chained(first, iterator)
            ended = run.lockstep(every) if terms.mode == "lockstep" else run.realtime(every)
        except KeyboardInterrupt:
            ended = "interrupted"
            raise
        finally:
            link.close()
            deadline_ms = None if config.deadline_s is None else 1e3 * config.deadline_s
            if terms.mode == "realtime" and deadline_ms is None:
                deadline_ms = run.interval_ms()
            summary = run.close(ended, deadline_ms, config.log_dir)
    return summary


def _with_truth_endpoint(link: LinkConfig) -> LinkConfig:
    """The link with a truth endpoint when truth travels separately, and with none otherwise."""
    if link.truth != "separate":
        return replace(link, truth_url=None)
    return replace(link, truth_url=link.truth_url or default_truth_url(link.url))


def _chained(first: HostFrame, rest: Iterator[HostFrame]) -> Iterator[HostFrame]:
    """All frames, checked against the terms that the first one settled."""
    yield first
    before = first
    for frame in rest:
        if frame.frame_id <= before.frame_id:
            raise ValueError(f"frame ids must increase: {frame.frame_id} after {before.frame_id}")
        if (
            frame.camera != first.camera
            or frame.image.shape != first.image.shape
            or frame.image.dtype != first.image.dtype
        ):
            raise ValueError(f"frame {frame.frame_id} has another camera or image format than the first")
        yield frame
        before = frame


class _Run:
    """The state of one run on the run's side."""

    link: HostLink

    def __init__(self, config: LinkConfig, on_row: Callable[[LedgerRow], None] | None) -> None:
        self.config = config
        self.writer: LedgerWriter | None = None
        self.rows: list[LedgerRow] = []
        self._on_row = on_row
        self._open: dict[int, HostFrame] = {}  # handed over, outcome not yet known
        self._started_utc = datetime.now(UTC).isoformat(timespec="seconds")

    def lockstep(self, frames: Iterator[HostFrame]) -> Ended:
        """Frame out, outcome in, next."""
        for frame in frames:
            if not self.link.wait_for_board(self.config.timeout_s):
                return "board_lost"
            while not self.link.has_room:
                self.link.pump(0.1)
            self._submit(frame, None)
            self._finish_all()
        return "completed"

    def realtime(self, frames: Iterator[HostFrame]) -> Ended:
        """Frames at the scenario's pace, whatever the board does."""
        origin_ns: int | None = None
        for frame in frames:
            if origin_ns is None:
                origin_ns = time.monotonic_ns() + LEAD_NS - round(frame.t_s * 1e9)
            self._collect(0.0)
            while not self.link.has_room:
                self._collect(0.1)
            self._submit(frame, origin_ns + round(frame.t_s * 1e9))
            gone_s = time.monotonic() - self.link.down_since_s
            if self.link.board is None and gone_s > self.config.timeout_s:
                self._finish_all()
                return "board_lost"
        self._finish_all()
        return "completed"

    def interval_ms(self) -> float | None:
        """Median time from frame to frame."""
        times = sorted(row.t_s for row in self.rows)
        return 1e3 * float(np.median(np.diff(times))) if len(times) > 1 else None

    def close(self, ended: Ended, deadline_ms: float | None, log_dir: Path | None) -> LedgerSummary:
        """Books closed: frames without an outcome are dropped, the summary is written."""
        self._take_results()
        for frame_id in list(self._open):
            self._add(FrameResult(frame_id, f"dropped:{ended}", "the run ended before its outcome was known"))
        board, counts = self.link.last_board, self.link.counts
        trip = counts.clock_round_trip_ns
        summary = summarise(
            self.rows,
            started_utc=self._started_utc,
            ended=ended,
            mode=self.config.mode,
            truth=self.config.truth,
            url=self.link.url,
            timeout_s=self.config.timeout_s,
            deadline_ms=deadline_ms,
            board=None
            if board is None
            else Board(
                name=board.board,
                model=board.model_name,
                method=board.method,
                encoding=board.encoding,
                window=board.window,
            ),
            link=LinkTotals(
                packets_sent=counts.packets_sent,
                packets_received=counts.packets_received,
                packets_corrupt=counts.packets_corrupt,
                protocol_mistakes=counts.protocol_mistakes,
                sequence_gaps=counts.sequence_gaps,
                sessions=counts.sessions,
                late_poses=counts.late_poses,
                clock_round_trip_ms=None if trip is None else trip * 1e-6,
            ),
        )
        if self.writer is not None and log_dir is not None:
            self.writer.close()
            text = msgspec.json.format(msgspec.json.encode(summary), indent=1)
            write_atomic(log_dir / SUMMARY_JSON, text + b"\n")
        return summary

    def _submit(self, frame: HostFrame, due_ns: int | None) -> None:
        self._open[frame.frame_id] = replace(frame, image=np.empty((0, 0), np.uint8))
        self.link.submit(
            frame.image,
            frame_id=frame.frame_id,
            epoch_utc=frame.epoch_utc,
            t_s=frame.t_s,
            exposure_s=frame.exposure_s,
            bits=8 * frame.image.dtype.itemsize,
            due_ns=due_ns,
            truth=None if self.config.truth == "off" else frame.truth,
        )

    def _finish_all(self) -> None:
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
        row = ledger_row(self._open.pop(result.frame_id), result)
        self.rows.append(row)
        if self.writer is not None:
            self.writer.add(row)
        if self._on_row is not None:
            self._on_row(row)


def _ms(start_ns: int | None, end_ns: int | None) -> float | None:
    return None if start_ns is None or end_ns is None else (end_ns - start_ns) * 1e-6


def ledger_row(frame: HostFrame, result: FrameResult) -> LedgerRow:
    """A frame and its outcome as a row."""
    truth_q = frame.truth.get("q_camera_from_target_wxyz")
    truth_t = frame.truth.get("t_camera_from_target_m")
    row = LedgerRow(
        frame_id=frame.frame_id,
        epoch_utc=frame.epoch_utc,
        t_s=frame.t_s,
        exposure_s=frame.exposure_s,
        outcome=result.outcome,
        reason=result.reason,
        render_ms=frame.render_ms,
        send_lag_ms=_ms(result.due_ns, result.send_start_ns),
        send_ms=_ms(result.send_start_ns, result.send_end_ns),
        e2e_ms=_ms(result.send_start_ns, result.received_ns),
        truth_q_wxyz=None if truth_q is None else tuple(truth_q),
        truth_t_m=None if truth_t is None else tuple(truth_t),
    )
    pose = result.pose
    if pose is None:
        return row
    q, t, offset = pose.q_camera_from_target_wxyz, pose.t_camera_from_target_m, result.clock_offset_ns
    errors: tuple[float | None, float | None] = (None, None)
    if q is not None and t is not None and row.truth_q_wxyz is not None and row.truth_t_m is not None:
        errors = pose_errors(q, t, row.truth_q_wxyz, row.truth_t_m)
    return replace(
        row,
        board_wait_ms=_ms(pose.receive_ns, pose.start_ns),
        board_total_ms=_ms(pose.receive_ns, pose.end_ns),
        uplink_ms=None if offset is None else _ms(result.send_start_ns, pose.receive_ns - offset),
        downlink_ms=None if offset is None else _ms(pose.end_ns - offset, result.received_ns),
        stages_ms=dict(pose.stages_ms),
        confidence=pose.confidence,
        q_wxyz=q,
        t_m=t,
        E_T_m=errors[0],
        E_R_deg=errors[1],
    )
