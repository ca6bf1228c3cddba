"""Recorder protocol: receives each frame at hand-over, and its ledger row once its outcome is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.frame import Frame


class Recorder(Protocol):
    """Recorder of a run in some format; used by one thread, closed once."""

    def frame(self, frame: Frame) -> None:
        """Record a frame at the moment of its hand-over to the link."""

    def row(self, frame: Frame, row: FrameRecord) -> None:
        """Record the outcome of a frame, whose pixels have been released by then."""

    def close(self) -> None:
        """Close after the run, even if it failed."""
