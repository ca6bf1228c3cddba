"""Settings of a run: link, ledger, time-outs and what is recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from flyaround.simulator.runtime.untrusted_files import refuse_not_finite

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from flyaround.hil.host.ledger.run_terms import Provenance
    from flyaround.hil.host.ledger.summary import ClosedLoopFigures
    from flyaround.hil.host.link_process.ipc import LinkConfig
    from flyaround.hil.host.recording.recorder import Recorder
    from flyaround.simulator.scenario.faults import LineFault

# Default time-out for the first board [s], enough to start one by hand.
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
        Folder for ``frames.csv`` and ``summary.json``; None writes no files.
    connect_timeout_s : float, optional
        Time-out for the first board.
    window : int, optional
        Largest number of frames in flight; the board may request fewer.
    deadline_s : float, optional
        Time after which an answer misses the deadline; in real time the frame interval by default.
    latency_s : float, optional
        Real time: constant delay from the end of the exposure to the hand-over of the image.
    target_name : str, optional
        Name of the target.
    target_sha256 : str, optional
        Hash of the target; a board with another model is refused.
    recorders : tuple of Recorder, optional
        Recorders of each frame and its outcome, closed with the ledger.
    closed_loop : callable, optional
        Returns the result of a closed loop at the end; None if the frames follow a plan.
    decide_every_s : float, optional
        Real-time closed loop: earliest request of the next frame after an exposure, so that all poses received by then
        are used.
    provenance : Provenance, optional
        Scenario and command line, for the record of the run.
    send_sun : bool, optional
        Send the direction to the Sun in the camera frame with each frame, to boards that accept it.
    new_line_faults : callable, optional
        Called before each frame; returns faults of the line that begin then, if the link supports adding them.

    Raises
    ------
    UserError
        If a time is not finite.
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
    provenance: Provenance | None = None
    send_sun: bool = False
    new_line_faults: Callable[[], Iterable[LineFault]] = tuple

    def __post_init__(self) -> None:
        refuse_not_finite(vars(self), "the run")
