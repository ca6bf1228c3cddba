"""By what the frames of a capture are drawn: this process, several, or a Ray cluster."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.dataset.ray_frames import RayCluster, RayFrames
from flyaround.simulator.dataset.writer import CheckAndEncode
from flyaround.simulator.loop import open_frames

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.writer import CheckedFrame
    from flyaround.simulator.loop import FrameProducer
    from flyaround.simulator.scenario.plan import FramePlan


@dataclass(frozen=True)
class SetDrawing:
    """What draws.

    Parameters
    ----------
    workers : processes here. device_index : EGL device of theirs. cluster : draws instead.
    """

    workers: int = 1
    device_index: int | None = None
    cluster: RayCluster | None = None

    def open(self, plan: FramePlan, card: DatasetCard) -> AbstractContextManager[FrameProducer[CheckedFrame]]:
        """What takes a plan's frames, checks and encodes them."""
        first = plan.scene(0)
        if self.cluster is not None:
            stage = CheckAndEncode(card, plan.target)
            return RayFrames(stage, self.cluster, first=first, target=plan.target, n_frames=plan.n_frames)
        return open_frames(
            # other processes here are told the target's name alone
            CheckAndEncode(card, plan.target if self.workers == 1 else None),
            # one draws here; more have each a renderer of their own
            processes=self.workers if self.workers > 1 else 0,
            device_index=self.device_index,
            first=first,
            target=plan.target,
        )
