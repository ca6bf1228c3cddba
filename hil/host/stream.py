"""Frames for a board: a plan drawn in processes of their own, a frame ahead of the link."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from hil.host.run import HostFrame
from simulator.dataset.draw import draw_labelled
from simulator.labels.truth import truth_to_json
from simulator.render.processes import RenderProcesses

if TYPE_CHECKING:
    from collections.abc import Iterator

    from simulator.loop import Plan

# Frames of each process drawn ahead of the one on the wire: one keeps it busy while the board thinks.
AHEAD = 2


def stream_frames(plan: Plan, *, device_index: int | None = None, workers: int = 1) -> Iterator[HostFrame]:
    """Draw the plan's frames in ``workers`` other processes and yield them in order, as the host sends them.

    Truth travels inside the host only; ``run_host`` decides what leaves it.
    """
    camera: dict[str, Any] = msgspec.to_builtins(plan.camera)
    with RenderProcesses(
        draw_labelled, workers, device_index=device_index, capacity=AHEAD, first=plan.scene(0)
    ) as processes:
        scenes = (plan.scene(k) for k in range(plan.n_frames))
        no_options: dict[str, object] = {}
        for k, frame in enumerate(processes.map((scene, no_options) for scene in scenes)):
            if frame.truth is None:
                raise RuntimeError("a streamed frame needs its truth")
            yield HostFrame(
                frame_id=k,
                epoch_utc=frame.scene.epoch_utc,
                t_s=frame.scene.t_s,
                exposure_s=frame.scene.exposure_s,
                image=np.asarray(frame.image, np.uint8),
                camera=camera,
                truth=msgspec.json.decode(truth_to_json(frame.truth)),
                render_ms=frame.stage_ms["render"] + frame.stage_ms["sensor"],
            )
