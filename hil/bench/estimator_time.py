"""Time of the estimator on this machine: rendered frames, one thread, a separate process as on a board."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.board_model.write import write_board_model
from flyaround.simulator.bench.parts import PartCost, cost
from flyaround.simulator.loop import run_frames
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import Plan, plan_flight

if TYPE_CHECKING:
    from numpy.typing import NDArray

SCENARIO = "tango-flyaround"
N_SINGLE = 26  # with fewer, a single slow frame would be the 95th percentile

# Number of frames of the tracking bench, and the time between them [s].
N_TRACKED, EVERY_S = 42, 0.5

BOARD = "flyaround.hil.bench.board_process"


def bench_estimator() -> tuple[PartCost, ...]:
    """Measure initialisation on single frames of a flight, and tracking from frame to frame.

    Returns
    -------
    tuple of PartCost
        Times [ms] of initialisation and, if there are any tracked frames, of tracking, each on one thread; peak memory
        [MB] is that of the process for both.
    """
    scattered = plan_flight(load_scenario(SCENARIO), n=N_SINGLE)
    close = plan_flight(load_scenario(SCENARIO), every_s=EVERY_S)
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_board_model(scattered.target, folder / "model.json")
        (folder / "camera.json").write_bytes(msgspec.json.encode(scattered.camera))
        with Renderer() as renderer:
            np.save(folder / "single.npy", _pictures(renderer, scattered, N_SINGLE))
            np.save(folder / "sequence.npy", _pictures(renderer, close, N_TRACKED))
        return _in_a_process(folder)


def _in_a_process(folder: Path) -> tuple[PartCost, ...]:
    """Return the times of all frames, one at a time, in a separate process."""
    # multi-threading slows matrices this small down (docs/hybrid.md)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    answer = subprocess.run(
        [sys.executable, "-P", "-m", BOARD, str(folder), str(EVERY_S)],
        env=environment,
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    figures = json.loads(answer.stdout)
    # the first frame includes one-time setup
    costs = [cost("initialisation, one thread", figures["single"][1:])]
    if figures["tracked"]:
        costs.append(cost("tracking, one thread", figures["tracked"]))
    return tuple(replace(c, peak_mb=figures["peak_mb"], kernels=figures["kernels"]) for c in costs)


def _pictures(renderer: Renderer, plan: Plan, n: int) -> NDArray[np.unsignedinteger]:
    frames = run_frames(plan, renderer, labels=False, numbers=range(n))
    return np.stack([frame.image for frame in frames])
