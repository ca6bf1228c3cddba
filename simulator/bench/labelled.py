"""What labels cost: frames of a bench scene with none and with all of them, in turn."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from simulator.frame import take_frame
from simulator.labels.request import LAYERS, LabelRequest
from simulator.labels.truth import FlowLabel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from simulator.render.renderer import Renderer
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target


def labels_cost(
    renderer: Renderer, target: Target, scenes: Sequence[SceneState], n_frames: int
) -> tuple[float, float]:
    """Milliseconds that truth, mask and all layers add to a frame, and its cost with them over that without; medians.

    Parameters
    ----------
    scenes : at least two; the flow of each leads to the one after it.
    """
    added, ratios = [], []
    for k in range(n_frames + 1):
        scene, following = scenes[k % (len(scenes) - 1)], scenes[k % (len(scenes) - 1) + 1]
        flow = FlowLabel(
            t_s=following.t_s,
            q_camera_from_target_wxyz=following.q_camera_from_target_wxyz,
            t_camera_from_target_m=following.t_camera_from_target_m,
        )
        costs = []
        for request in (False, LabelRequest(layers=LAYERS, flow=flow)):
            start = time.perf_counter()
            take_frame(renderer, scene, target, labels=request)
            costs.append((time.perf_counter() - start) * 1e3)
        if k > 0:  # the first uploads and compiles
            added.append(costs[1] - costs[0])
            ratios.append(costs[1] / costs[0])
    return float(np.median(added)), float(np.median(ratios))
