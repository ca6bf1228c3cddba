"""Frames for a capture: drawn, checked and encoded in this process, or in several with a renderer each."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from simulator.dataset.check.verify import check_frame
from simulator.dataset.clipping import Clipping, measure_clipping
from simulator.dataset.formats.native import EncodedFrame, encode_frame
from simulator.frame import Frame, take_frame
from simulator.labels.request import LabelRequest
from simulator.render.earth.map_textures import begin_maps_of
from simulator.render.renderer import Renderer
from simulator.runtime.process_pool import RenderProcesses
from simulator.targets.library import target_in_use

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from simulator.dataset.card import DatasetCard
    from simulator.render.gl.context import GlInfo
    from simulator.scene.state import SceneState
    from simulator.targets.model import Target

    Job = tuple[int, SceneState, LabelRequest]


@dataclass(frozen=True, eq=False)
class CheckedFrame:
    """A frame ready to be written: its files, whether it is feasible, and what is wrong with its labels, or nothing."""

    files: EncodedFrame
    feasible: bool
    reason: str
    clipping: Clipping


class Drawer(Protocol):
    """Draws, checks and encodes frames in the order asked for."""

    @property
    def info(self) -> GlInfo:
        """What draws."""

    def frames(self, jobs: Iterable[Job], target: Target, card: DatasetCard) -> Iterator[CheckedFrame]:
        """One frame per job (number, scene, labels), in order."""


class _Here:
    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self.info = renderer.info

    def frames(self, jobs: Iterable[Job], target: Target, card: DatasetCard) -> Iterator[CheckedFrame]:
        for k, scene, request in jobs:
            yield _checked(k, take_frame(self._renderer, scene, target, labels=request), card, target)


class _Workers:
    def __init__(self, processes: RenderProcesses[CheckedFrame]) -> None:
        self._processes = processes

    @property
    def info(self) -> GlInfo:
        return self._processes.info

    def frames(
        self,
        jobs: Iterable[Job],
        target: Target,  # noqa: ARG002 - each loads its own
        card: DatasetCard,
    ) -> Iterator[CheckedFrame]:
        yield from self._processes.map(
            (scene, {"request": request, "k": k, "card": card}) for k, scene, request in jobs
        )


def _checked(k: int, frame: Frame, card: DatasetCard, target: Target) -> CheckedFrame:
    if frame.truth is None or frame.mask is None:
        raise RuntimeError("a captured frame needs labels")
    wrong = check_frame(k, frame.truth, frame.image, frame.mask, card, target, frame.layers)
    return CheckedFrame(encode_frame(frame), frame.truth.feasible, "; ".join(wrong), measure_clipping(frame))


def _draw_checked(
    renderer: Renderer, scene: SceneState, *, request: LabelRequest, k: int, card: DatasetCard
) -> CheckedFrame:
    target = target_in_use(scene.target.name, scene.target.sha256)
    return _checked(k, take_frame(renderer, scene, target, labels=request), card, target)


@contextmanager
def open_drawer(workers: int, device_index: int | None, first: SceneState | None = None) -> Iterator[Drawer]:
    """A drawer in this process for one worker, else one in each of ``workers`` processes.

    The bytes are the same: a frame depends on its scene alone.

    Parameters
    ----------
    first : the first scene to come, for a quicker first frame.
    """
    with ExitStack() as stack:
        if workers == 1:
            yield _Here(stack.enter_context(Renderer(device_index=device_index, begun=begin_maps_of(first))))
        else:
            processes = RenderProcesses(_draw_checked, workers, device_index=device_index, first=first)
            yield _Workers(stack.enter_context(processes))
