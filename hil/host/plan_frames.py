"""Frames of a plan for a board, rendered in separate processes one frame ahead of the link."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, open_frames, run_frames

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from flyaround.simulator.loop import Sink
    from flyaround.simulator.scenario.plan import Plan

# Frames of each process drawn ahead of the one on the wire: one keeps it busy while the board thinks.
FRAMES_AHEAD = 2

# Frames of the flight, evenly in time, that each process draws before the first is due, and the time for them.
WARM_UP_FRAMES, WARM_UP_S = 24, 15.0


def frames_of_plan(
    plan: Plan,
    *,
    device_index: int | None = None,
    workers: int = 1,
    warm_up: bool = False,
    sinks: Iterable[Sink[Frame]] = (),
) -> Iterator[Frame]:
    """Render the plan's frames in ``workers`` other processes and yield them in order, as `run_host` sends them.

    Pixels are the detector's own numbers, grey or in colour, in one byte up to 8 bits and in two above. Truth
    travels inside the host only; ``run_host`` decides what leaves it.

    Parameters
    ----------
    warm_up : draw some of the flight's moments for nothing first. Programs are compiled, and buffers made for the
        target's sizes, when a view first asks for them: half a second and megabytes at a time that a run in real time
        would meet in its midst.
    sinks : given each frame before the board is.
    """
    with open_frames(
        Frame.image_and_truth,
        processes=workers,
        device_index=device_index,
        first=plan.scene(0),
        ahead=FRAMES_AHEAD,
    ) as producer:
        if warm_up:
            for _ in producer.frames(_moments(plan, workers)):
                pass
        yield from run_frames(plan, producer, sinks)


def _moments(plan: Plan, workers: int) -> Iterator[FrameRequest]:
    """Yield scenes over the whole flight, each as often as there are processes, while time remains."""
    until = time.monotonic() + WARM_UP_S
    for k in np.unique(np.linspace(0, plan.n_frames - 1, WARM_UP_FRAMES).astype(int)):
        if time.monotonic() > until:
            return
        yield from [FrameRequest(scene=plan.scene(int(k)))] * workers
