"""Ledger of a camera's images: the answer of a board to each, with the rendered state."""

from __future__ import annotations

import time
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from flyaround.hil.host.frame_record import FrameRecord, complete
from flyaround.hil.host.ledger.frames_csv import LedgerWriter
from flyaround.hil.host.ledger.run_terms import Provenance, run_terms, write_terms
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, LedgerTally, summarise
from flyaround.simulator.runtime.files import write_document

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.hil.host.ledger.summary import LedgerSummary
    from flyaround.hil.host.link_process.ipc import LinkConfig
    from flyaround.simulator.scene.state import SceneState


class CameraLedger:
    """Ledger rows of the images sent while the camera ran.

    Parameters
    ----------
    folder : Path or None
        Output folder; None writes no files.
    link : LinkConfig
        Link settings of the answer port.
    provenance : Provenance, optional
        Scenario and command line, for the record of the run.

    Raises
    ------
    UserError
        If the folder holds a ledger, or cannot be written, now or later.
    """

    def __init__(self, folder: Path | None, link: LinkConfig, provenance: Provenance | None = None) -> None:
        self._folder, self._link = folder, link
        self._started_utc = datetime.now(UTC).isoformat(timespec="seconds")
        self._utc_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._open: dict[int, tuple[SceneState, float]] = {}
        self._tally = LedgerTally()
        self._writer: LedgerWriter | None = None
        if folder is not None:
            self._writer = LedgerWriter(folder)
            terms = run_terms(
                provenance,
                started_utc=self._started_utc,
                mode="realtime",
                truth="off",
                url=link.url,
                timeout_s=link.timeout_s,
                faults=link.faults,
            )
            write_terms(folder, terms)

    def drawn(self, request_id: int, scene: SceneState, render_ms: float) -> None:
        """Register an image that was passed to the endpoint."""
        self._open[request_id] = scene, render_ms

    def record_outcome(self, request_id: int, record: FrameRecord | None) -> None:
        """Record the outcome of an image; None if it was not sent."""
        scene, render_ms = self._open.pop(request_id)
        if record is None:
            return
        truth = scene.q_camera_from_target_wxyz, scene.t_camera_from_target_m
        row = replace(
            complete(record, truth, self._utc_minus_monotonic_ns),
            epoch_utc=scene.epoch_utc,
            t_s=scene.t_s,
            exposure_s=scene.exposure_s,
            render_ms=render_ms,
        )
        self._tally.add(row)
        if self._writer is not None:
            self._writer.add(row)

    def close(self) -> LedgerSummary:
        """Close the ledger, and write its summary if there is a folder.

        Returns
        -------
        LedgerSummary
            Counts and latencies [ms] of the images that were sent.
        """
        summary = summarise(
            self._tally,
            started_utc=self._started_utc,
            ended="completed",
            mode="realtime",
            truth="off",
            url=self._link.url,
            timeout_s=self._link.timeout_s,
        )
        if self._writer is not None and self._folder is not None:
            self._writer.close()
            write_document(self._folder / SUMMARY_JSON, summary)
        return summary
