"""Export in the layout of the SPEED data set, readable by its public loader.

``speed/images/train/imgNNNNNN.jpg``, ``speed/train.json`` with ``filename q_vbs2tango r_Vo2To_vbs_true``, and
the three other lists that the loader opens, empty. ``q_vbs2tango`` is q_camera_from_target, copied.

References
----------
Kisantal et al. (2020), Satellite Pose Estimation Challenge: Dataset, Competition Design and Results.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2

from simulator.camera.lens.camera_model import Camera
from simulator.dataset.formats.native import frame_paths, read_png
from simulator.labels.truth import read_truth
from simulator.runtime.files import write_atomic, write_json

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

# The public images are JPEG; at 95 the coding error (below 1 DN rms) stays far under the noise (12 DN).
JPEG_QUALITY = 95
FOLDER = "speed"


def export_speed(folder: Path, frames: Iterable[int]) -> int:
    """Write the SPEED form of a native data set beside it.

    Parameters
    ----------
    folder : the data set.
    frames : indices of its whole frames.

    Returns
    -------
    Number of images exported.
    """
    root = folder / FOLDER
    (root / "images" / "train").mkdir(parents=True, exist_ok=True)
    labels: list[dict[str, Any]] = []
    camera: Camera | None = None
    for k in frames:
        paths = frame_paths(folder, k)
        truth = read_truth(paths.truth)
        camera = truth.camera
        name = f"img{k:06d}.jpg"
        image = read_png(paths.image)
        mono = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        ok, data = cv2.imencode(".jpg", mono, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        if not ok:
            raise RuntimeError(f"OpenCV could not encode {name}")
        write_atomic(root / "images" / "train" / name, data.tobytes())
        labels.append(
            {
                "filename": name,
                "q_vbs2tango": list(truth.q_camera_from_target_wxyz),
                "r_Vo2To_vbs_true": list(truth.t_camera_from_target_m),
            }
        )
    write_json(root / "train.json", labels)
    for other in ("test", "real", "real_test"):
        write_json(root / f"{other}.json", [])
    if camera is not None:
        write_json(root / "camera.json", _speed_camera(camera))
    return len(labels)


def _speed_camera(camera: Camera) -> dict[str, Any]:
    return {
        "Nu": camera.width_px,
        "Nv": camera.height_px,
        "fx_px": camera.fx_px,
        "fy_px": camera.fy_px,
        "ccx": camera.cx_px,
        "ccy": camera.cy_px,
        "cameraMatrix": camera.K.tolist(),
        "distCoeffs": list(camera.distortion.coefficients) or [0.0] * 5,
    }
