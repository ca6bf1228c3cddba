"""Frame rate of several processes that render concurrently, because one process hardly loads a GPU."""

from __future__ import annotations

import multiprocessing
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.bench.scenes import BenchMachine, bench_machine, bench_views
from flyaround.simulator.frame import take_frame
from flyaround.simulator.render.reference_pass import ReferencePass
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.memory import keep_freed_memory
from flyaround.simulator.runtime.threads import share_processors

if TYPE_CHECKING:
    from collections.abc import Callable
    from multiprocessing.queues import Queue
    from multiprocessing.synchronize import Event

THROUGHPUT_SCENES = (
    "tango-earth-10m",
    "tango-earth-10m-1024",
    "tango-space-10m",
    "tango-space-10m+1024",
    "tango-close-3m",
    "tango-close-3m+1024",
    "tango-earth-10m-1024+rgb",
    "tango-earth-10m-1024+blur",
)
SECONDS = 5.0  # duration of each measurement [s]
_DIFFERENT = 30  # number of scenes, rendered in rotation
_WARM_UP = 3  # untimed frames per process
_REFERENCE_LAPS = 5  # timed laps of the reference loop
_START_TIMEOUT_S = 240.0  # time for all processes to start [s]


@dataclass(frozen=True, kw_only=True)
class Throughput:
    """Total rate at which ``processes``, each with a renderer, draw, read back and develop frames [frames/s].

    ``reference_ms`` is the time of a reference pass at the scene's size in a single process, measured just before.
    """

    name: str
    width_px: int
    height_px: int
    processes: int
    frames_per_s: float
    reference_ms: float


def bench_throughput(
    names: tuple[str, ...] = THROUGHPUT_SCENES,
    *,
    most: int,
    device_index: int | None = None,
    seconds: float = SECONDS,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[BenchMachine, tuple[Throughput, ...]]:
    """Measure the frame rate of 1, 2, 4 ... up to ``most`` concurrent processes, without labels.

    Raises
    ------
    RuntimeError
        If a process ends early, or does not start.
    """
    counts = counts_up_to(most)
    results: list[Throughput] = []
    with Renderer(device_index=device_index) as renderer:
        machine = bench_machine(renderer)
    with ReferencePass(device_index=device_index) as reference:
        for name in names:
            camera = bench_views(name, 1)[0].camera
            size = (camera.width_px, camera.height_px)
            for n in counts:
                results.append(
                    Throughput(
                        name=name,
                        width_px=size[0],
                        height_px=size[1],
                        processes=n,
                        reference_ms=float(np.median(reference.laps_ms(size, _REFERENCE_LAPS))),
                        frames_per_s=_rate(name, n, device_index, seconds),
                    )
                )
                progress(len(results), len(names) * len(counts))
    return machine, tuple(results)


def counts_up_to(most: int) -> list[int]:
    """Return 1, 2, 4 and so on, and ``most`` itself."""
    return [2**k for k in range(most.bit_length()) if 2**k < most] + [most]


def _rate(name: str, processes: int, device_index: int | None, seconds: float) -> float:
    context = multiprocessing.get_context("spawn")
    messages: Queue[float] = context.Queue()
    begin = context.Event()
    running = [
        context.Process(
            target=_take_frames, args=(name, processes, device_index, seconds, messages, begin), daemon=True
        )
        for _ in range(processes)
    ]
    try:
        for one in running:
            one.start()
        for _ in running:
            _next(messages, running)
        begin.set()
        rate = sum(_next(messages, running) for _ in running)
        for one in running:
            one.join(timeout=10)
        return rate
    finally:
        for one in running:  # all at once: a waiting process does not end by itself
            one.terminate()
        for one in running:
            one.join()


def _next(messages: Queue[float], running: list[multiprocessing.context.SpawnProcess]) -> float:
    """Return the message of the next process."""
    end = time.monotonic() + _START_TIMEOUT_S
    while messages.empty():
        if any(one.exitcode not in {None, 0} for one in running) or time.monotonic() > end:
            raise RuntimeError("a benchmark process ended early or did not start; see its message")
        time.sleep(0.02)
    return messages.get()


def _take_frames(
    name: str,
    processes: int,
    device_index: int | None,
    seconds: float,
    messages: Queue[float],
    begin: Event,
) -> None:
    """Measure the frame rate of one of ``processes`` concurrent processes."""
    keep_freed_memory()
    share_processors(processes)
    plan, scenes = bench_views(name, _DIFFERENT)
    with Renderer(device_index=device_index) as renderer:
        for scene in scenes[:_WARM_UP]:
            take_frame(renderer, scene, plan.target, labels=False)
        messages.put(0.0)
        if not begin.wait(_START_TIMEOUT_S):  # the starting process has ended
            return
        start, elapsed_s, n_frames = time.perf_counter(), 0.0, 0
        while elapsed_s < seconds:
            take_frame(renderer, scenes[n_frames % len(scenes)], plan.target, labels=False)
            n_frames += 1
            elapsed_s = time.perf_counter() - start
    messages.put(n_frames / elapsed_s)
