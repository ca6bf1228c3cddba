"""Timing of the host's camera: images in a loop, at constant latency, to a board that answers immediately.

Frame number and time are encoded in a corner of each image (`flyaround.hil.corner_code`); the board decodes them, so
that pixels and ledger are compared in every frame.
"""

from __future__ import annotations

import multiprocessing
import os
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.hil.board.agent import run_board
from flyaround.hil.corner_code import CodePlace, CornerCode, draw_code, read_code
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.host.ledger.summary import LedgerSummary

    Pictures = Sequence[NDArray[np.uint8]]

PLACE = CodePlace()
EXPOSURE_S = 0.01  # exposure time of the images


class CodeReader:
    """Estimator of a board that only decodes the corner code and reports it as its reason."""

    accepted, confidence = True, 1.0
    q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)
    t_camera_from_target_m = (0.0, 0.0, 10.0)

    def __init__(self, _camera: dict[str, Any]) -> None:
        self.stages_ms: dict[str, float] = {}
        self.reason = ""

    def estimate(self, image: NDArray[np.uint8]) -> CodeReader:
        """Decode the corner of an image."""
        code = read_code(image, PLACE)
        self.reason = "no code" if code is None else f"{code.frame_id} {code.time_ns}"
        return self


@dataclass(frozen=True, kw_only=True)
class LatencyResult:
    """Result of a latency measurement.

    Parameters
    ----------
    summary : LedgerSummary
        Summary of the run.
    rows : sequence of FrameRecord
        Rows of its ledger.
    handover_error_ms : array
        Absolute value of (handed over - end of exposure - latency) of each frame.
    on_board_ms : array
        Time from end of exposure plus latency until the board has the whole frame, by the clock offset.
    codes_agree : int
        Number of frames whose decoded code equals the ledger's number and time.
    """

    summary: LedgerSummary
    rows: Sequence[FrameRecord]
    handover_error_ms: NDArray[np.float64]
    on_board_ms: NDArray[np.float64]
    codes_agree: int


def drawn_pictures(n: int, width_px: int, height_px: int, seed: int = 1) -> Pictures:
    """Return images of noise with a moving brighter square, as incompressible as a sensor's images."""
    rng = np.random.default_rng(seed)
    base = rng.normal(60, 8, (height_px + n, width_px)).clip(0, 255).astype(np.uint8)
    return [np.ascontiguousarray(base[k : k + height_px]) for k in range(n)]


def looped_frames(pictures: Pictures, n_frames: int, rate_hz: float) -> Iterator[Frame]:
    """Yield frames of the images in a loop, with number and time in a corner."""
    scene = plan_recipe("eval-black", 1).scene(0)
    height, width = pictures[0].shape
    camera = replace(scene.camera, width_px=width, height_px=height)
    start_ns = nanoseconds_utc(scene.epoch_utc)
    for k in range(n_frames):
        # whole microseconds, like a frame's epoch
        time_us = (start_ns + round(1e9 * k / rate_hz)) // 1000
        epoch = datetime.fromtimestamp(time_us // 1_000_000, UTC).replace(microsecond=time_us % 1_000_000)
        moved = replace(
            scene,
            camera=camera,
            frame_index=k,
            t_s=k / rate_hz,
            exposure_s=EXPOSURE_S,
            epoch_utc=f"{epoch:%Y-%m-%dT%H:%M:%S.%f}Z",
        )
        code = CornerCode(k, 1000 * time_us)
        image = draw_code(pictures[k % len(pictures)], code, PLACE, 255)
        yield Frame(moved, image, NO_RADIANCE, time_code_px=PLACE.box_px)


def _board(url: str) -> None:
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    run_board(url, make_estimator=CodeReader, method="code reader")


def measure_latency(
    pictures: Pictures,
    *,
    seconds: float,
    rate_hz: float = 30.0,
    latency_s: float = 0.05,
    log_dir: Path | None = None,
) -> LatencyResult:
    """Run host, link and board, each in a separate process, over loopback TCP."""
    rows: list[FrameRecord] = []
    boards: list[Any] = []

    def start_board(url: str, _truth_url: str | None) -> None:
        boards.append(multiprocessing.get_context("spawn").Process(target=_board, args=(url,), daemon=True))
        boards[0].start()

    n_frames = max(2, round(seconds * rate_hz))
    link = LinkConfig(
        url="tcp://127.0.0.1:0", mode="realtime", truth="off", timeout_s=10.0, compression="raw"
    )
    config = RunConfig(link=link, latency_s=latency_s, deadline_s=1 / rate_hz, log_dir=log_dir)
    summary = run_host(
        looped_frames(pictures, n_frames, rate_hz), config, on_row=rows.append, on_listening=start_board
    )
    boards[0].join(10.0)
    rows.sort(key=lambda row: row.frame_id)
    agree = sum(row.reason == f"{row.frame_id} {nanoseconds_utc(row.epoch_utc)}" for row in rows)
    # the send starts ``send_lag`` after the frame was due, and the board has the whole frame ``uplink`` later
    on_board = [
        row.send_lag_ms + row.uplink_ms
        for row in rows
        if row.send_lag_ms is not None and row.uplink_ms is not None
    ]
    errors = [abs(row.handover_error_ms) for row in rows if row.handover_error_ms is not None]
    return LatencyResult(
        summary=summary,
        rows=rows,
        handover_error_ms=np.array(errors),
        on_board_ms=np.array(on_board),
        codes_agree=agree,
    )
