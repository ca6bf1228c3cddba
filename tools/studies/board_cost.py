"""Measure time and memory of the estimator over a data set, in a process with a board's packages only.

    python -m tools.studies.board_cost SET --target tango

Printed are processor times on one thread, of accepted frames, of the others and of each stage, and the peak memory of
the process including Python, NumPy, OpenCV and one image [10^6 bytes] (Linux).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from flyaround.hil.board_model.write import write_board_model
from flyaround.hil.evaluate.greyscale import grey
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png
from flyaround.simulator.targets.library import load_target

BOARD = """
import json, sys, time
from pathlib import Path
import cv2
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.bench.board_process import images, peak_mb
import flyaround.hil.board.estimation.record as record
cv2.setNumThreads(1)
# stages by processor time: other work on the machine counts nothing
record.time.perf_counter = time.process_time
memory = lambda key: int(dict(line.split(":", 1) for line in open("/proc/self/status"))[key].split()[0]) * 1024e-6
folder = sys.argv[1]
bare = memory("VmRSS")
model = BoardModel.read(folder + "/model.json")
camera = CameraIntrinsics.from_dict(json.load(open(folder + "/camera.json")))
estimator = make_estimator(model, camera)
ready = memory("VmRSS")
rows = []
for image in images(Path(folder) / "frames.npy"):
    began = time.process_time()
    result = estimator.estimate(image)
    took = time.process_time() - began
    rows.append({"ms": 1000 * took, "accepted": bool(result.accepted), "stages": dict(result.stages_ms)})
print(json.dumps({"rows": rows, "bare": bare, "ready": ready, "peak": peak_mb()}))
"""


def main() -> None:
    """Run the board process over a data set and print its time and memory."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("dataset", type=Path)
    parser.add_argument(
        "--target", default=None, help="model of the estimator (default: the data set's target)"
    )
    parser.add_argument("-n", type=int, default=30, help="frames")
    options = parser.parse_args()
    card = read_card(options.dataset)
    complete = [k for k in range(card.n_frames) if is_frame_complete(options.dataset, k)][: options.n]
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_board_model(load_target(options.target or card.target.name), folder / "model.json")
        (folder / "camera.json").write_bytes(msgspec.json.encode(card.camera))
        pictures = [grey(read_png(frame_paths(options.dataset, k).image)) for k in complete]
        np.save(folder / "frames.npy", np.stack(pictures))
        answer = subprocess.run(
            [sys.executable, "-c", BOARD, name],
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
            check=True,
            text=True,
        )
    figures = json.loads(answer.stdout)
    rows = figures["rows"][1:]  # the first frame includes one-time setup
    for label, some in (
        ("all", rows),
        ("accepted", [r for r in rows if r["accepted"]]),
        ("declined", [r for r in rows if not r["accepted"]]),
    ):
        times = [r["ms"] for r in some]
        if times:
            half, most = np.quantile(times, [0.5, 0.95])
            print(
                f"{label}: {len(times)} frames, {half:.0f} ms in the median, {most:.0f} at the 95th percentile"
            )
    stages = {name: 0.0 for r in rows for name in r["stages"]}
    for name in stages:
        stages[name] = float(np.mean([r["stages"].get(name, 0.0) for r in rows if r["accepted"]] or [0.0]))
    for name, ms in sorted(stages.items(), key=lambda s: -s[1]):
        if ms >= 1:
            print(f"  {name}: {ms:.0f} ms per accepted frame")
    print(
        f"memory: {figures['bare']:.0f} MB after imports, {figures['ready']:.0f} prepared, {figures['peak']:.0f} peak"
    )


if __name__ == "__main__":
    main()
