"""Terms of one run of frames through the loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from flyaround.hil.host.ledger.run_terms import FlownRecord
    from flyaround.hil.host.ledger.summary import ClosedLoopFigures
    from flyaround.hil.host.link_process.ipc import LinkConfig
    from flyaround.hil.host.recording.recorder import Recorder
    from flyaround.simulator.scenario.faults import LineFault

CONNECT_TIMEOUT_S = 60.0

Ended = Literal["completed", "board_lost", "no_board", "interrupted", "failed"]


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Settings of a run.

    Parameters
    ----------
    link : LinkConfig
        Settings of the link to board and truth loggers.
    log_dir : Path, optional
        For ``frames.csv`` and ``summary.json``; None keeps no files.
    connect_timeout_s : float, optional
        Wait for the first board.
    window : int, optional
        Most frames under way at once; the board may ask for fewer.
    deadline_s : float, optional
        A frame not answered within this is a miss; realtime's default is the frame interval.
    latency_s : float, optional
        Realtime: the camera hands an image over so long after the end of its exposure, whatever drawing took.
    target_name, target_sha256 : str, optional
        The target that is flown; a board with another model is refused.
    recorders : tuple of Recorder, optional
        Record each frame and its outcome; closed with the ledger.
    closed_loop : callable, optional
        Asked in the end what a closed loop came to; None where the frames follow a plan.
    decide_every_s : float, optional
        Realtime, a closed loop: the next frame is requested no earlier than so long after this one's exposure, with
        all poses that have come by then in.
    flown : FlownRecord, optional
        Scenario and command for the record of the run.
    send_sun : bool, optional
        The direction to the Sun in the camera frame goes with each frame, to boards that take it.
    new_line_faults : callable, optional
        Asked before each frame for faults of the line that begin now, where the link lets them be added.
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
    send_sun: bool = False
    new_line_faults: Callable[[], Iterable[LineFault]] = tuple
