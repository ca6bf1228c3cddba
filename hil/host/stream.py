"""Frames for a board: a plan drawn in a process of its own, one frame ahead of the link."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from hil.host.run import HostFrame
from simulator.dataset.draw import draw_labelled
from simulator.labels.truth import truth_to_json
from simulator.render.process import RenderProcess

if TYPE_CHECKING:
    from collections.abc import Iterator

    from simulator.loop import Plan

# Frames drawn ahead of the one on the wire: one keeps the renderer busy while the board thinks.
AHEAD = 2


def stream_frames(plan: Plan, *, device_index: int | None = None) -> Iterator[HostFrame]:
    """Draw the plan's frames in order in another process and yield them as the host sends them.

    Truth travels inside the host only; ``run_host`` decides what leaves it.
    """
    camera: dict[str, Any] = msgspec.to_builtins(plan.camera)
    with RenderProcess(
        draw_labelled, device_index=device_index, capacity=AHEAD, first=plan.scene(0)
    ) as process:
        scenes = (plan.scene(k) for k in range(plan.n_frames))
        for k, frame in enumerate(process.map(scenes)):
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
