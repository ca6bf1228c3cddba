"""Cost of a frame that does not depend on its pixels: the processor time that a GPU waits for.

Frames are drawn by the passes that a GPU uses. A software driver transforms vertices on the calling thread, inside the
draw calls; a GPU does not, so the time of these calls is stated separately.
"""

from __future__ import annotations

import cProfile
import pstats
import time
from dataclasses import dataclass, replace
from statistics import median
from typing import TYPE_CHECKING

from flyaround.simulator.frame import take_frame
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.frame import Frame

SCENE = "tango-earth-10m"
WIDTH_PX = 64  # so small that pixels cost nothing
FIRST, FRAMES = 5, 25  # the first frames fill caches


@dataclass(frozen=True, kw_only=True)
class FixedCost:
    """Cost of a small frame.

    Parameters
    ----------
    labels : bool
        Whether the frame has labels.
    thread_ms : float
        Median processor time of the calling thread [ms].
    least_thread_ms : float
        Minimum processor time of the calling thread [ms].
    draw_calls_ms : float
        Mean processor time of the calling thread inside the driver's draw calls [ms].
    python_calls : int
        Calls of Python functions per frame.
    all_calls : int
        Calls of Python and built-in functions per frame.
    """

    labels: bool
    thread_ms: float
    least_thread_ms: float
    draw_calls_ms: float
    python_calls: int
    all_calls: int


def bench_fixed_cost(device_index: int | None = None) -> tuple[FixedCost, FixedCost]:
    """Measure frames of 64 x 40 pixels along a flight, without labels and with them."""
    plan = plan_flight(load_scenario(SCENE), n=FIRST + FRAMES)
    camera = plan.camera.resized(WIDTH_PX)
    scenes = [replace(plan.scene(k), camera=camera) for k in range(FIRST + FRAMES)]
    with Renderer(device_index=device_index, software_path=False) as renderer:

        def frames(*, labels: bool) -> Iterator[Frame]:
            for scene in scenes:
                yield take_frame(renderer, scene, plan.target, labels=labels)

        return _measure(frames(labels=False), labels=False), _measure(frames(labels=True), labels=True)


def _measure(frames: Iterator[Frame], *, labels: bool) -> FixedCost:
    """Time the first half after the warm-up, and count the calls of the rest: counting slows calls down."""
    for _ in range(FIRST):
        next(frames)
    spent_ms = []
    for _ in range(FRAMES // 2):
        start_s = time.thread_time()
        next(frames)
        spent_ms.append(1e3 * (time.thread_time() - start_s))
    with cProfile.Profile(time.thread_time) as profile:
        counted = sum(1 for _ in frames)
    stats = pstats.Stats(profile)
    calls = {name: row[1] for name, row in stats.stats.items()}  # type: ignore[attr-defined]
    python = sum(n for (file, _, _), n in calls.items() if file != "~")
    drawing_s = sum(row[2] for (_, _, name), row in stats.stats.items() if "mgl.VertexArray" in name)  # type: ignore[attr-defined]
    return FixedCost(
        labels=labels,
        thread_ms=median(spent_ms),
        least_thread_ms=min(spent_ms),
        draw_calls_ms=1e3 * drawing_s / counted,
        python_calls=round(python / counted),
        all_calls=round(sum(calls.values()) / counted),
    )
