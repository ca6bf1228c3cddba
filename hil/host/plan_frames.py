"""Frames of a planned flight for a board, rendered ahead of the link in separate processes."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import FrameRequest, open_frames, run_frames

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.scenario.plan import Plan

# Frames that each process may render ahead of the link, so that it stays busy while the board computes.
FRAMES_AHEAD = 2

# Largest number of warm-up frames for each process, evenly spaced over the flight, and their time-out.
WARM_UP_FRAMES, WARM_UP_S = 24, 15.0


def frames_of_plan(
    plan: Plan,
    *,
    device_index: int | None = None,
    workers: int = 1,
    warm_up: bool = False,
) -> Iterator[Frame]:
    """Render the frames of a plan in ``workers`` processes and yield them in order, for `run_host` to send.

    Pixels are raw detector values, grey or colour, in one byte up to 8 bits and in two above. Frames contain the ground
    truth; `run_host` decides whether it is sent.

    Parameters
    ----------
    plan : Plan
        Flight to render.
    device_index : int, optional
        EGL device to render on; None for the driver's choice.
    workers : int, optional
        Number of render processes.
    warm_up : bool, optional
        True to render some frames of the flight in advance and discard them. Shaders are compiled and buffers
        allocated when a view first needs them; in a real-time run this would delay frames.
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
        yield from run_frames(plan, producer)


def _moments(plan: Plan, workers: int) -> Iterator[FrameRequest]:
    """Yield scenes spread over the whole flight, each once per process, until the warm-up time is over."""
    until = time.monotonic() + WARM_UP_S
    for k in np.unique(np.linspace(0, plan.n_frames - 1, WARM_UP_FRAMES).astype(int)):
        if time.monotonic() > until:
            return
        yield from [FrameRequest(scene=plan.scene(int(k)))] * workers
