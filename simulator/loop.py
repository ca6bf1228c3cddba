"""The frame loop: scenes become frames, in this process or in drawing processes, and every sink receives each frame.

Frames come from a plan (`run_frames`), or one at a time from the newest state (`FrameProducer.submit`), because a
closed loop and the console decide on each frame from the previous ones.
"""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections import deque
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Protocol, Self, TypeVar, overload

from flyaround.simulator.frame import Frame, take_frame
from flyaround.simulator.labels.request import LabelRequest
from flyaround.simulator.runtime.progress import publish_progress
from flyaround.simulator.runtime.threads import share_processors
from flyaround.simulator.runtime.worker_pool import WorkerPool

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.render.gl.context import GlInfo
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.progress import ProgressLine
    from flyaround.simulator.scenario.plan import FramePlan
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

    FrameLabels = bool | LabelRequest | Callable[[int], LabelRequest]

Result = TypeVar("Result")
Result_contra = TypeVar("Result_contra", contravariant=True)


class Sink(Protocol[Result_contra]):
    """An object that receives frames: a window, a data set, a link to a board."""

    def write(self, frame: Result_contra) -> None:
        """Write one frame, or the result of the stage for it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FrameRequest:
    """A request for one frame.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    labels : bool or LabelRequest, optional
        True for truth and mask, or a request for further layers.
    timed : bool, optional
        True to wait for the driver after every pass to time it; None leaves the renderer's setting.
    """

    scene: SceneState
    labels: bool | LabelRequest = True
    timed: bool | None = None


class FrameProducer(ABC, Generic[Result]):
    """Producer of frames of scenes, in the order of the requests. Use as a context manager.

    A frame depends on its request alone: the bytes are the same wherever it is drawn.
    """

    @property
    @abstractmethod
    def info(self) -> GlInfo:
        """The renderer's driver; waits until it is ready."""

    @property
    @abstractmethod
    def has_room(self) -> bool:
        """True if `submit` would accept a request."""

    @property
    @abstractmethod
    def in_flight(self) -> int:
        """Number of frames requested and not yet collected."""

    @property
    def pids(self) -> tuple[int | None, ...]:
        """Process identifiers of the drawing processes; empty if this process draws."""
        return ()

    @abstractmethod
    def submit(self, request: FrameRequest) -> bool:
        """Request one frame.

        Returns
        -------
        bool
            False if too many are in flight; the frame is not requested then.
        """

    @abstractmethod
    def ready(self) -> bool:
        """Return True if `result` would return or raise without waiting for another process.

        Returns
        -------
        bool
            False if no frame is in flight.

        Raises
        ------
        JobsLostError
            If the renderer died and was restarted: all frames in progress are lost.
        """

    @abstractmethod
    def result(self) -> Result:
        """Wait for the oldest frame in flight and return it.

        Returns
        -------
        Result
            Result of the stage; each request is returned once, in the order of the requests.

        Raises
        ------
        UserError
            If the renderer raises one.
        JobsLostError
            If the renderer died and was restarted: all frames in progress are lost.
        RuntimeError
            If no frame is in flight, or something else went wrong.
        """

    def finished(self) -> Iterator[Result]:
        """Yield the frames that are ready now."""
        while self.ready():
            yield self.result()

    def frames(self, requests: Iterable[FrameRequest]) -> Iterator[Result]:
        """Yield one frame per request, in order, drawing some ahead.

        Raises
        ------
        RuntimeError
            If frames of an earlier, interrupted call are in flight: they would be confused with this one's.
        """
        if self.in_flight > 0:
            raise RuntimeError("frames of an interrupted run are in flight; open another producer")
        for request in requests:
            if not self.has_room:
                yield self.result()
            self.submit(request)
        while self.in_flight > 0:
            yield self.result()

    @abstractmethod
    def close(self) -> None:
        """Stop drawing; frames in flight are discarded."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _LocalProducer(FrameProducer[Result]):
    """Frame producer in this process; each frame is rendered when it is collected.

    Parameters
    ----------
    renderer : Renderer
        Renderer to draw with; it stays open when this closes.
    stage : callable
        Function applied to each frame.
    target : Target, optional
        Replaces the target that a scene names.
    """

    def __init__(
        self, renderer: Renderer, stage: Callable[[Frame], Result], target: Target | None = None
    ) -> None:
        self._renderer, self._stage, self._target = renderer, stage, target
        self._pending: deque[FrameRequest] = deque()

    @property
    def info(self) -> GlInfo:
        return self._renderer.info

    @property
    def has_room(self) -> bool:
        return not self._pending

    @property
    def in_flight(self) -> int:
        return len(self._pending)

    def submit(self, request: FrameRequest) -> bool:
        if not self.has_room:
            return False
        self._pending.append(request)
        return True

    def ready(self) -> bool:
        return bool(self._pending)

    def result(self) -> Result:
        if not self._pending:
            raise RuntimeError("no frame is in flight")
        return draw_request(self._renderer, self._pending.popleft(), self._stage, self._target)

    def frames(self, requests: Iterable[FrameRequest]) -> Iterator[Result]:
        # drawing ahead gains nothing in the same process
        for request in requests:
            yield draw_request(self._renderer, request, self._stage, self._target)

    def close(self) -> None:
        self._pending.clear()


@dataclass(frozen=True, kw_only=True)
class OpenRenderer:
    """A callable that opens a renderer in a drawing process.

    Parameters
    ----------
    device_index : int, optional
        EGL device.
    first : SceneState, optional
        First scene to be drawn; its maps are read while the renderer starts.
    processes : int, optional
        Number of drawing processes, this one included. On a GPU each needs a processor; a software driver shares the
        processors among them, and one thread in each of two processes is faster than two threads in one.
    niceness : int, optional
        Increment of the process's niceness, as in `os.nice`.
    progress : ProgressLine, optional
        Line that reports preparations.
    """

    device_index: int | None = None
    first: SceneState | None = None
    processes: int = 1
    niceness: int = 0
    progress: ProgressLine | None = None

    def __call__(self) -> Renderer:
        """Return the renderer. The process takes its share of the processors before the context is created."""
        share_processors(self.processes)
        if self.niceness and hasattr(os, "nice"):
            os.nice(self.niceness)
        if self.progress is not None:
            publish_progress(self.progress)
        from flyaround.simulator.render.earth.map_textures import prefetch_maps  # noqa: PLC0415 - callers need not load OpenGL

        prefetched = prefetch_maps(self.first)
        from flyaround.simulator.render.renderer import Renderer  # noqa: PLC0415 - the same; maps are read meanwhile

        return Renderer(device_index=self.device_index, prefetched=prefetched)


class _PoolProducer(WorkerPool[Result], FrameProducer[Result]):
    """Frame producer in worker processes, ahead of the caller; the parameters are those of `open_frames`."""

    def __init__(self, stage: Callable[[Frame], Result], opener: OpenRenderer, **options: Any) -> None:  # noqa: ANN401 - the pool's own
        super().__init__(
            draw_request, opener.processes, open_resource=opener, name="drawing process", **options
        )
        self._stage = stage

    def submit(self, request: FrameRequest) -> bool:  # type: ignore[override] # a job is a request
        return super().submit(request, self._stage)


def draw_request(
    renderer: Renderer,
    request: FrameRequest,
    stage: Callable[[Frame], Result],
    target: Target | None = None,
) -> Result:
    """Draw the frame of a request and apply the stage: the work of a drawing process.

    Returns
    -------
    Result
        Result of ``stage``, for the craft that ``target`` or else the scene names.
    """
    if request.timed is not None:
        renderer.timed = request.timed
    scene = request.scene
    return stage(take_frame(renderer, scene, target or scene.target.drawn(), labels=request.labels))


@contextmanager
def open_frames(
    stage: Callable[[Frame], Result],
    *,
    processes: int = 0,
    device_index: int | None = None,
    first: SceneState | None = None,
    prefetched: Mapping[Bands, EarthMaps] | None = None,
    ahead: int = 2,
    restarts: bool = False,
    answer_within_s: float | None = None,
    niceness: int = 0,
    progress: ProgressLine | None = None,
    target: Target | None = None,
) -> Iterator[FrameProducer[Result]]:
    """Open a frame producer in this process, or in ``processes`` of their own.

    Parameters
    ----------
    stage : callable
        Function applied to each frame where it is drawn: encoding, or `Frame.without_radiance` to send less. With other
        processes, a module-level function or a picklable object.
    processes : int, optional
        Number of processes; 0 draws in this process.
    device_index : int, optional
        EGL device to render on; None for the driver's choice.
    first : SceneState, optional
        First scene to be drawn; its maps are read while the renderer starts.
    prefetched : mapping, optional
        Maps of ``first`` that are being read already.
    ahead : int, optional
        Frames that each process may have in flight.
    restarts : bool, optional
        True to restart processes that die.
    answer_within_s : float, optional
        Restart processes idle for this long while a frame is due; None waits for ever.
    niceness : int, optional
        Increment of the processes' niceness, as in `os.nice`, so that a window stays responsive.
    progress : ProgressLine, optional
        Line that reports preparations.
    target : Target, optional
        Replaces the target that scenes name, in this process.
    """
    if processes:
        opener = OpenRenderer(
            device_index=device_index,
            first=first,
            processes=processes,
            niceness=niceness,
            progress=progress,
        )
        with _PoolProducer(
            stage, opener, capacity=ahead, restarts=restarts, answer_within_s=answer_within_s
        ) as pool:
            yield pool
        return
    from flyaround.simulator.render.earth.map_textures import prefetch_maps  # noqa: PLC0415 - processes that draw elsewhere need not load OpenGL
    from flyaround.simulator.render.renderer import Renderer  # noqa: PLC0415 - the same

    maps = prefetch_maps(first) if prefetched is None else prefetched
    with (
        Renderer(device_index=device_index, prefetched=maps) as renderer,
        _LocalProducer(renderer, stage, target) as local,
    ):
        yield local


def whole_frame(frame: Frame) -> Frame:
    """Return the frame unchanged: the default stage.

    Returns
    -------
    Frame
        The same object.
    """
    return frame


@overload
def run_frames(
    plan: FramePlan,
    renderer: Renderer,
    sinks: Iterable[Sink[Frame]] = ...,
    *,
    labels: FrameLabels = ...,
    numbers: Iterable[int] | None = ...,
) -> Iterator[Frame]: ...


@overload
def run_frames(
    plan: FramePlan,
    renderer: FrameProducer[Result],
    sinks: Iterable[Sink[Result]] = ...,
    *,
    labels: FrameLabels = ...,
    numbers: Iterable[int] | None = ...,
) -> Iterator[Result]: ...


def run_frames(
    plan: FramePlan,
    renderer: Renderer | FrameProducer[Any],
    sinks: Iterable[Sink[Any]] = (),
    *,
    labels: FrameLabels = True,
    numbers: Iterable[int] | None = None,
) -> Iterator[Any]:
    """Draw frames of a plan, write each to every sink, and yield it.

    Parameters
    ----------
    plan : FramePlan
        Frames to draw.
    renderer : Renderer or FrameProducer
        Renderer to draw with here, or a producer from `open_frames`.
    sinks : iterable of Sink, optional
        Sinks that receive each frame.
    labels : FrameLabels, optional
        Labels as in `take_frame`, or a function that returns them for a frame's number.
    numbers : iterable of int, optional
        Numbers of the frames to draw, in order; by default the whole plan.
    """
    producer = (
        renderer
        if isinstance(renderer, FrameProducer)
        else _LocalProducer(renderer, whole_frame, plan.target)
    )
    frame_numbers = range(plan.n_frames) if numbers is None else numbers
    requests = (
        FrameRequest(scene=plan.scene(k), labels=labels(k) if callable(labels) else labels)
        for k in frame_numbers
    )
    sink_list = tuple(sinks)
    for frame in producer.frames(requests):
        for sink in sink_list:
            sink.write(frame)
        yield frame
