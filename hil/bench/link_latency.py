"""Latency of the link: noise frames to a local board that answers immediately."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from flyaround.hil.board.agent import run_board
from flyaround.hil.host.frame_record import ACCEPTED
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.simulator.bench.parts import PartCost, cost
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.recipes.plan import plan_recipe

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.hil.host.link_process.ipc import Compression

# Sizes of the frames, width and height: a small camera, and SPEED's.
SIZES_PX = ((1024, 1024), (1920, 1200))

WARM_UP = 5  # frames before those that are timed


class _Answer:
    """Estimator that takes no time and is its own result."""

    accepted = True
    reason = ""
    q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)
    t_camera_from_target_m = (0.0, 0.0, 10.0)
    confidence = 1.0

    def __init__(self, _camera: dict[str, Any]) -> None:
        self.stages_ms: dict[str, float] = {}

    def estimate(self, _image: object) -> Self:
        return self


def _frames(width_px: int, height_px: int, n_frames: int) -> Iterator[Frame]:
    # resembles the noise of a sensor; compresses to two thirds, while uniform noise would not compress at all
    image = np.random.default_rng(1).normal(60, 8, (height_px, width_px)).clip(0, 255).astype(np.uint8)
    scene = plan_recipe("eval-black", 1).scene(0)
    camera = replace(scene.camera, width_px=width_px, height_px=height_px)
    for k in range(n_frames):
        yield Frame(replace(scene, camera=camera, frame_index=k, t_s=0.1 * k), image, NO_RADIANCE)


def link_latency_ms(
    width_px: int,
    height_px: int,
    *,
    n_frames: int,
    compression: Compression = "raw",
    key: bytes | None = None,
) -> list[float]:
    """Return the end-to-end latency of each frame over the loopback, in lockstep with an instant estimator [ms].

    Raises
    ------
    RuntimeError
        If a frame is not accepted.
    """
    boards: list[threading.Thread] = []

    def start_board(url: str, _truth_url: str | None) -> None:
        options = {"make_estimator": _Answer, "key": key}
        boards.append(threading.Thread(target=run_board, args=(url,), kwargs=options, daemon=True))
        boards[0].start()

    rows: list[FrameRecord] = []
    link = LinkConfig(
        url="tcp://127.0.0.1:0",
        mode="lockstep",
        truth="off",
        timeout_s=10.0,
        compression=compression,
        key=key,
    )
    run_host(
        _frames(width_px, height_px, n_frames),
        RunConfig(link=link),
        on_listening=start_board,
        on_row=rows.append,
    )
    boards[0].join(5.0)
    unanswered = [row for row in rows if row.outcome != ACCEPTED]
    if unanswered or len(rows) < n_frames:
        reason = unanswered[0].reason if unanswered else "the run ended early"
        raise RuntimeError(
            f"{n_frames - len(rows) + len(unanswered)} of {n_frames} frames have no pose: {reason}"
        )
    return [row.e2e_ms for row in rows if row.e2e_ms is not None]


def bench_link(n_frames: int = 60) -> tuple[PartCost, ...]:
    """Measure the link's latency by image size, compression and key.

    Returns
    -------
    tuple of PartCost
        Times from frame to pose [ms], without warm-up frames, of raw, zstd and sealed raw images of each of
        ``SIZES_PX``.
    """
    lines: tuple[tuple[Compression, bytes | None], ...] = (("raw", None), ("zstd", None), ("raw", bytes(32)))
    costs = []
    for width, height in SIZES_PX:
        for compression, key in lines:
            laps_ms = link_latency_ms(
                width, height, n_frames=n_frames + WARM_UP, compression=compression, key=key
            )
            name = f"link tcp {width}x{height} {compression}" + (" sealed" if key else "")
            costs.append(cost(name, laps_ms[WARM_UP:]))
    return tuple(costs)
