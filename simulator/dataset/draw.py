"""One labelled frame as a process of its own draws it, for a stream."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from simulator.frame import Frame, take_frame
from simulator.labels.request import LabelRequest
from simulator.targets.library import target_in_use

if TYPE_CHECKING:
    from simulator.render.renderer import Renderer
    from simulator.scene.state import SceneState

# Mask and truth record, no further layer.
TRUTH_ALONE = LabelRequest()


def draw_labelled(renderer: Renderer, scene: SceneState) -> Frame:
    """What a drawing process does for each job; the radiance and the mask stay there, a stream has no use for them."""
    target = target_in_use(scene.target.name, scene.target.sha256)
    frame = take_frame(renderer, scene, target, labels=TRUTH_ALONE)
    return replace(frame.without_radiance(), mask=None)
