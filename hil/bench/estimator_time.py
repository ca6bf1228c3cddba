"""What the estimator costs on this machine: rendered frames, one thread, a process of its own as on a board."""

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
N_SINGLE = 26  # of fewer one slow frame is the 95th percentile

# Frames of the tracking bench, half a second apart.
N_TRACKED, EVERY_S = 42, 0.5

# What runs in the process: nothing but what a board has. Peak memory of all of it, Python and OpenCV included.
BOARD = """
import json, sys
import cv2, numpy as np
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.board.hybrid.native.library import describe_library
cv2.setNumThreads(1)
folder, every_s = sys.argv[1], float(sys.argv[2])
model = BoardModel.read(folder + "/model.json")
camera = CameraIntrinsics.from_dict(json.load(open(folder + "/camera.json")))
first, track = make_estimator(model, camera), make_estimator(model, camera, HYBRID_TRACK)
total = lambda result: sum(result.stages_ms.values())
# one picture at a time, as from a link: what is mapped counts as memory
count = lambda name: len(np.load(f"{folder}/{name}.npy", mmap_mode="r"))
picture = lambda name, k: np.array(np.load(f"{folder}/{name}.npy", mmap_mode="r")[k])
single = [total(first.estimate(picture("single", k))) for k in range(count("single"))]
followed = [track.estimate(picture("sequence", k), None, k * every_s) for k in range(count("sequence"))]
tracked = [total(r) for r in followed if "initialised" not in r.counts]
try:  # getrusage would count what the parent held
    status = dict(line.split(":", 1) for line in open("/proc/self/status"))
    peak = int(status["VmHWM"].split()[0]) / 1024
except OSError:
    peak = None
print(json.dumps({"single": single, "tracked": tracked, "peak_mb": peak, "kernels": describe_library()}))
"""


def bench_estimator() -> tuple[PartCost, ...]:
    """Initialisation from single frames along a flight, and tracking from frame to frame."""
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
    """The costs of all frames, one at a time."""
    # threads on matrices this small cost more than they give (docs/hybrid.md)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    answer = subprocess.run(
        [sys.executable, "-c", BOARD, str(folder), str(EVERY_S)],
        env=environment,
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    figures = json.loads(answer.stdout)
    # the first frame pays for what is made once
    costs = [cost("initialisation, one thread", figures["single"][1:])]
    if figures["tracked"]:
        costs.append(cost("tracking, one thread", figures["tracked"]))
    return tuple(replace(c, peak_mb=figures["peak_mb"], kernels=figures["kernels"]) for c in costs)


def _pictures(renderer: Renderer, plan: Plan, n: int) -> NDArray[np.unsignedinteger]:
    frames = run_frames(plan, renderer, labels=False, numbers=range(n))
    return np.stack([frame.image for frame in frames])
