"""What listens to a run: each frame as it is handed over, and its row of the ledger once its outcome is known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.frame import Frame


class Recorder(Protocol):
    """Keeps a run in some format; used by one thread, closed once."""

    def frame(self, frame: Frame) -> None:
        """A frame that is handed to the link now."""

    def row(self, frame: Frame, row: FrameRecord) -> None:
        """What became of a frame; the frame has lost its pixels by then."""

    def close(self) -> None:
        """The run is over, however it ended."""
