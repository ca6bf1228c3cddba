"""Frames for a board: a plan drawn in processes of their own, a frame ahead of the link."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from hil.host.run import HostFrame
from simulator.dataset.draw import draw_labelled
from simulator.errors import UserError
from simulator.labels.truth import truth_to_json
from simulator.runtime.process_pool import RenderProcesses

if TYPE_CHECKING:
    from collections.abc import Iterator

    from simulator.loop import Plan
    from simulator.scene.state import SceneState

# Frames of each process drawn ahead of the one on the wire: one keeps it busy while the board thinks.
AHEAD = 2

# Frames of the flight, evenly in time, that each process draws before the first is due, and the time for them.
WARM_UP_FRAMES, WARM_UP_S = 24, 15.0


def check_streamable(plan: Plan) -> None:
    """Refuse a plan whose pictures the link cannot carry, before anybody listens.

    Raises
    ------
    UserError
        If the pictures are in colour: the link has one channel of 8 to 16 bits.
    """
    if plan.bands != "mono":
        raise UserError(
            f"scenario {plan.scenario_name} gives {plan.bands} pictures, but the link to a board carries one channel:"
            ' write bands = "mono" under [output] of a copy of the scenario'
        )


def stream_frames(
    plan: Plan, *, device_index: int | None = None, workers: int = 1, warm_up: bool = False
) -> Iterator[HostFrame]:
    """Draw the plan's frames in ``workers`` other processes and yield them in order, as the host sends them.

    Pixels are the detector's own numbers, in one byte up to 8 bits and in two above. Truth travels inside the host
    only; ``run_host`` decides what leaves it.

    Parameters
    ----------
    warm_up : draw some of the flight's moments for nothing first. Programs are compiled, and buffers made for the
        target's sizes, when a view first asks for them: half a second and megabytes at a time that a run in real time
        would meet in its midst.

    Raises
    ------
    UserError
        If the plan's pictures are in colour.
    """
    check_streamable(plan)
    camera: dict[str, Any] = msgspec.to_builtins(plan.camera)
    with RenderProcesses(
        draw_labelled, workers, device_index=device_index, capacity=AHEAD, first=plan.scene(0)
    ) as processes:
        no_options: dict[str, object] = {}
        if warm_up:
            for _ in processes.map((scene, no_options) for scene in _moments(plan, workers)):
                pass
        scenes = (plan.scene(k) for k in range(plan.n_frames))
        for k, frame in enumerate(processes.map((scene, no_options) for scene in scenes)):
            if frame.truth is None:
                raise RuntimeError("a streamed frame needs its truth")
            yield HostFrame(
                frame_id=k,
                epoch_utc=frame.scene.epoch_utc,
                t_s=frame.scene.t_s,
                exposure_s=frame.scene.exposure_s,
                image=frame.image,
                bits=frame.scene.sensor.bits,
                camera=camera,
                truth=msgspec.json.decode(truth_to_json(frame.truth)),
                render_ms=frame.stage_ms["render"] + frame.stage_ms["sensor"],
            )


def _moments(plan: Plan, workers: int) -> Iterator[SceneState]:
    """Scenes over the whole flight, each as often as there are processes, while there is time."""
    until = time.monotonic() + WARM_UP_S
    for k in np.unique(np.linspace(0, plan.n_frames - 1, WARM_UP_FRAMES).astype(int)):
        if time.monotonic() > until:
            return
        yield from [plan.scene(int(k))] * workers
