"""Estimator process of the bench: ``FOLDER EVERY_S``. Imports only what a board has.

Peak memory is that of the whole process with Python, OpenCV and one image at a time.
"""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.hybrid.native.library import describe_library
from flyaround.hil.board.method_names import HYBRID_TRACK
from flyaround.hil.board.methods import make_estimator

if TYPE_CHECKING:
    from collections.abc import Iterator

Array = np.ndarray


def measure(folder: Path, every_s: float) -> dict[str, Any]:
    """Return times [ms] of single and tracked frames, accepted or not, peak memory [MB], and the kernels in use.

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
    single_results = [first.estimate(image) for image in images(folder / "single.npy")]
    track_results = [
        track.estimate(image, None, k * every_s) for k, image in enumerate(images(folder / "sequence.npy"))
    ]
    return {
        "single": [sum(result.stages_ms.values()) for result in single_results],
        "tracked": [sum(r.stages_ms.values()) for r in track_results if "initialised" not in r.counts],
        "peak_mb": peak_mb(),
        "kernels": describe_library(),
    }


def images(path: Path) -> Iterator[Array]:
    """Yield the images of an ``.npy`` file one at a time, as from a link: mapped pages would count as memory."""
    stack = np.load(path, mmap_mode="r")
    shape, dtype, start = stack.shape, stack.dtype, stack.offset
    del stack
    with path.open("rb") as file:
        file.seek(start)
        for _ in range(shape[0]):
            yield np.fromfile(file, dtype, math.prod(shape[1:])).reshape(shape[1:])


def peak_mb(status: Path = Path("/proc/self/status")) -> float | None:
    """Return the peak memory of this process [10^6 bytes], None if unknown; getrusage includes the parent's."""
    try:
        peak = re.search(r"VmHWM:\s+(\d+) kB", status.read_text(encoding="ascii"))
    except OSError:
        return None
    # the kernel's kB has 1024 bytes
    return None if peak is None else int(peak[1]) * 1024e-6


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measure(Path(sys.argv[1]), float(sys.argv[2]))) + "\n")
