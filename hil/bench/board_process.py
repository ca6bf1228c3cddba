"""Estimator process of the bench: ``FOLDER EVERY_S``. Imports only what a board has.

Peak memory is that of the whole process, Python and OpenCV included.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.hybrid.native.library import describe_library
from flyaround.hil.board.method_names import HYBRID_TRACK
from flyaround.hil.board.methods import make_estimator


def measure(folder: Path, every_s: float) -> dict[str, Any]:
    """Return the times [ms] of single and tracked frames, the peak memory [MB], and the kernels in use.

    Parameters
    ----------
    folder : Path
        Folder with ``model.json``, ``camera.json``, ``single.npy`` and ``sequence.npy``.
    every_s : float
        Time between two frames of the sequence.
    """
    cv2.setNumThreads(1)
    model = BoardModel.read(str(folder / "model.json"))
    camera = CameraIntrinsics.from_dict(json.loads((folder / "camera.json").read_bytes()))
    first, track = make_estimator(model, camera), make_estimator(model, camera, HYBRID_TRACK)
    # one image at a time, as from a link: mapped memory would count as used
    single, sequence = (np.load(folder / f"{name}.npy", mmap_mode="r") for name in ("single", "sequence"))
    alone = [first.estimate(np.array(image)) for image in single]
    followed = [track.estimate(np.array(image), None, k * every_s) for k, image in enumerate(sequence)]
    return {
        "single": [sum(result.stages_ms.values()) for result in alone],
        "tracked": [sum(r.stages_ms.values()) for r in followed if "initialised" not in r.counts],
        "peak_mb": _peak_mb(),
        "kernels": describe_library(),
    }


def _peak_mb() -> float | None:
    """Return the peak memory of this process; getrusage would include the parent's."""
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return None
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measure(Path(sys.argv[1]), float(sys.argv[2]))) + "\n")
