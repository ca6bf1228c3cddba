"""Labelled frames for a capture: drawn in this process, or by several processes with a renderer each."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Protocol

from simulator.labels.frame import Frame, take_frame
from simulator.labels.request import LabelRequest
from simulator.render.process import RenderProcess
from simulator.render.renderer import Renderer
from simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from simulator.render.context import GlInfo
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target

    Job = tuple[SceneState, LabelRequest]

# Mask and truth record, no further layer.
TRUTH_ALONE = LabelRequest()


class Drawer(Protocol):
    """Draws labelled frames in the order asked for."""

    @property
    def info(self) -> GlInfo:
        """What draws."""

    def frames(self, jobs: Iterable[Job], target: Target) -> Iterator[Frame]:
        """One frame per job, in order."""


class _Here:
    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self.info = renderer.info

    def frames(self, jobs: Iterable[Job], target: Target) -> Iterator[Frame]:
        for scene, request in jobs:
            yield take_frame(self._renderer, scene, target, labels=request)


class _Workers:
    def __init__(self, processes: list[RenderProcess[Frame]]) -> None:
        self._processes = processes

    @property
    def info(self) -> GlInfo:
        return self._processes[0].info

    def frames(self, jobs: Iterable[Job], target: Target) -> Iterator[Frame]:  # noqa: ARG002 - each loads its own
        """Job k goes to process k modulo their number, so results come back in order."""
        n = len(self._processes)
        asked = given = 0
        for scene, request in jobs:
            process = self._processes[asked % n]
            if not process.has_room:
                yield self._processes[given % n].result()
                given += 1
            process.submit(scene, request=request)
            asked += 1
        while given < asked:
            yield self._processes[given % n].result()
            given += 1


def draw_labelled(renderer: Renderer, scene: SceneState, request: LabelRequest = TRUTH_ALONE) -> Frame:
    """What a drawing process does for each job."""
    return take_frame(renderer, scene, load_target(scene.target.name), labels=request)


@contextmanager
def open_drawer(workers: int, device_index: int | None) -> Iterator[Drawer]:
    """A drawer in this process for one worker, else one in each of ``workers`` processes.

    The bytes are the same: a frame depends on its scene alone.
    """
    with ExitStack() as stack:
        if workers == 1:
            yield _Here(stack.enter_context(Renderer(device_index=device_index)))
        else:
            yield _Workers(
                [
                    stack.enter_context(RenderProcess(draw_labelled, device_index=device_index))
                    for _ in range(workers)
                ]
            )
