"""Listener of a run: each frame as it is handed over, and its ledger row once its outcome is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.frame import Frame


class Recorder(Protocol):
    """Recorder of a run in some format; used by one thread, closed once."""

    def frame(self, frame: Frame) -> None:
        """Record a frame that is handed to the link now."""

    def row(self, frame: Frame, row: FrameRecord) -> None:
        """Record the outcome of a frame, which has lost its pixels by then."""

    def close(self) -> None:
        """Close after the run, however it ended."""
