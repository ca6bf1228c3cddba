"""One flight through the host: frames of a plan, of a folder, or of a closed loop."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.corner_code import CodePlace, CornerCode, draw_code
from flyaround.hil.host.closed_loop_run import BoardLoop, write_steps
from flyaround.hil.host.faults.camera_faults import (
    with_camera_faults,
    with_camera_numbers,
    with_exposure_faults,
)
from flyaround.hil.host.ledger.run_terms import Provenance
from flyaround.hil.host.picture_frames import frames_of_folder
from flyaround.hil.host.plan_frames import frames_of_plan
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.host.ledger.summary import LedgerSummary
    from flyaround.hil.host.recording.recorder import Recorder
    from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
    from flyaround.hil.navigation.measurement import PoseNoise
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.scenario.plan import Plan


@dataclass(frozen=True, kw_only=True)
class FlightOptions:
    """Options of a flight, except those of its link.

    Parameters
    ----------
    closed_loop : ClosedLoopConfig, optional
        Settings of a closed loop; by default the flight follows the plan.
    pose_link : PoseLink, optional
        Delay of poses of a closed loop in lockstep; by default that of `PoseLink` plus the line's faults.
    pose_noise : PoseNoise, optional
        Assumed errors of the board's poses in a closed loop; by default those of ``hybrid``.
    source : Path, optional
        Folder whose images are sent instead of rendered ones.
    source_text : bytes, optional
        Contents of the scenario file, for the record of the run.
    command : tuple of str, optional
        Words of the command line, for the record of the run.
    time_code : bool, optional
        True to draw a time code into a corner.
    workers : int, optional
        Number of render processes.
    device_index : int, optional
        EGL device to render on.
    """

    closed_loop: ClosedLoopConfig | None = None
    pose_link: PoseLink | None = None
    pose_noise: PoseNoise | None = None
    source: Path | None = None
    source_text: bytes = b""
    command: tuple[str, ...] = ()
    time_code: bool = False
    workers: int = 1
    device_index: int | None = None


class FlightRun:
    """Flight that is ready to be sent.

    Parameters
    ----------
    plan : Plan
        Plan of the flight.
    config : RunConfig
        Settings of the run; the target and a closed loop are added to them.
    options : FlightOptions
        Source of the images, closed loop and rendering.

    Raises
    ------
    UserError
        If a closed loop is requested for a flight without path or thrusters.
    """

    def __init__(self, plan: Plan, config: RunConfig, options: FlightOptions) -> None:
        self._options = options
        self._faults, self._realtime = config.link.faults, config.link.mode == "realtime"
        self._plan = with_exposure_faults(plan, self._faults)
        self._loop: BoardLoop | None = None
        if options.closed_loop is not None:
            self._loop = BoardLoop.from_plan(
                self._plan,
                options.closed_loop,
                realtime=self._realtime,
                link=options.pose_link or PoseLink.in_lockstep(self._faults),
                noise=options.pose_noise,
            )
        self.n_frames = plan.n_frames if self._loop is None else self._loop.loop.max_pictures
        deadline_s = interval_s(plan) if self._realtime and self._loop is None else None
        self._config = replace(
            config,
            deadline_s=deadline_s if config.deadline_s is None else config.deadline_s,
            provenance=Provenance.from_plan(plan, options.source_text, options.command),
            target_name=plan.target.name,
            target_sha256=plan.target.sha256,
            closed_loop=None if self._loop is None else self._loop.figures,
            decide_every_s=None if self._loop is None else self._loop.loop.between_pictures_s,
        )

    def run(
        self,
        *,
        recorders: tuple[Recorder, ...] = (),
        on_row: Callable[[FrameRecord], None] | None = None,
        on_listening: Callable[[str, str | None], None] | None = None,
        on_end: Callable[[LedgerSummary], None] | None = None,
    ) -> LedgerSummary:
        """Send the flight with `run_host`, and return the summary of its ledger.

        The decisions of a closed loop are written next to the ledger.

        Parameters
        ----------
        recorders : tuple of Recorder, optional
            Additional recorders of each frame and its outcome.
        on_row : callable, optional
            Called with each row of the ledger once its outcome is known.
        on_listening : callable, optional
            Called with the URLs for boards and for truth loggers once the ports are open.
        on_end : callable, optional
            Called with the summary after the ledger is closed.

        Returns
        -------
        LedgerSummary
            Counts, latencies [ms] and errors of the run.
        """
        options, loop, log_dir = self._options, self._loop, self._config.log_dir
        if loop is not None:
            frames = loop.frames(device_index=options.device_index, realtime=self._realtime)
        elif options.source is not None:
            frames = frames_of_folder(self._plan, options.source)
        else:
            frames = frames_of_plan(
                self._plan,
                device_index=options.device_index,
                workers=options.workers,
                warm_up=self._realtime,
            )
        if options.time_code:
            frames = with_time_code(frames, faults=self._faults)

        def handle_row(row: FrameRecord) -> None:
            if loop is not None:
                loop.poses.take(row)
            if on_row is not None:
                on_row(row)

        try:
            return run_host(
                with_camera_faults(frames, self._faults),
                replace(self._config, recorders=recorders),
                on_row=handle_row,
                on_listening=on_listening,
                on_end=on_end,
            )
        finally:
            if loop is not None and log_dir is not None and log_dir.is_dir():
                write_steps(log_dir, loop.loop.steps)


def interval_s(plan: Plan) -> float | None:
    """Return the median interval between the frames of a plan.

    Returns
    -------
    float or None
        Interval [s]; None for a single frame.
    """
    return float(np.median(np.diff(plan.times_s))) if plan.n_frames > 1 else None


def with_time_code(
    frames: Iterable[Frame], place: CodePlace | None = None, faults: Faults = NO_FAULTS
) -> Iterator[Frame]:
    """Yield frames with a `flyaround.hil.corner_code` in a corner: the camera's frame number and mid-exposure.

    Parameters
    ----------
    frames : iterable of Frame
        Frames in order.
    place : CodePlace, optional
        Position of the code, by default the upper left corner; ``time_code_px`` of each frame is its box.
    faults : Faults, optional
        Camera faults, of which `RepeatedNumber` keeps its counter at the last number.

    Raises
    ------
    UserError
        If the code does not fit into the image.
    """
    place = CodePlace() if place is None else place
    for frame in with_camera_numbers(frames, faults):
        height, width = frame.image.shape[:2]
        if not place.fits(height, width):
            left, top, right, bottom = place.box_px
            raise UserError(
                f"a time code takes {right - left} x {bottom - top} px but the picture has {width} x {height}: "
                "leave --time-code out, or enlarge roi_px"
            )
        counter = frame.number if frame.camera_frame is None else frame.camera_frame
        code = CornerCode(counter, nanoseconds_utc(frame.scene.epoch_utc))
        image = draw_code(frame.image, code, place, 2**frame.scene.sensor.bits - 1)
        yield replace(frame, image=image, time_code_px=place.box_px)
