"""Several renderers in processes of their own that take scenes in turn: more frames a second than one alone draws."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Generic, Self, TypeVar

from simulator.runtime.process import RenderProcess

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from simulator.render.gl.context import GlInfo
    from simulator.scene.state import SceneState

T = TypeVar("T")


class RenderProcesses(Generic[T]):
    """Runs ``work(renderer, scene, **options)`` in ``count`` processes. Use as a context manager.

    A frame depends on its scene alone, so the results are those of one process. Errors are those of `RenderProcess`.

    Parameters
    ----------
    work, device_index, first : as of `RenderProcess`.
    count : processes. On a GPU each needs a processor; a software driver shares the processors out among them, and
        two processors are better used by two processes of one thread than by one of two.
    capacity : jobs of each process that may be under way or waiting to be collected.
    """

    def __init__(
        self,
        work: Callable[..., T],
        count: int,
        *,
        device_index: int | None = None,
        capacity: int = 2,
        first: SceneState | None = None,
    ) -> None:
        if count < 1:
            raise ValueError(f"at least one process must draw, got {count}")
        with ExitStack() as stack:
            self._processes = [
                stack.enter_context(
                    RenderProcess(
                        work, device_index=device_index, capacity=capacity, first=first, drawing=count
                    )
                )
                for _ in range(count)
            ]
            self._open = stack.pop_all()

    @property
    def info(self) -> GlInfo:
        """What draws; waits until the first renderer is up."""
        return self._processes[0].info

    def map(self, jobs: Iterable[tuple[SceneState, Mapping[str, object]]]) -> Iterator[T]:
        """Results of many jobs (scene, options) in order; the n-th is done by process n modulo their number.

        Raises
        ------
        RuntimeError
            If results of a map that was broken off are still to come: they would be taken for this one's.
        """
        if any(process.in_flight for process in self._processes):
            raise RuntimeError("frames of a map that was broken off are under way; open other processes")
        count = len(self._processes)
        asked = given = 0
        for scene, options in jobs:
            process = self._processes[asked % count]
            if not process.has_room:
                yield self._processes[given % count].result()
                given += 1
            process.submit(scene, **options)
            asked += 1
        while given < asked:
            yield self._processes[given % count].result()
            given += 1

    def close(self) -> None:
        """End the processes."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
