"""Writers of SPEED and SPEED+: a JSON list of file names, quaternions and positions next to the images.

SPEED: ``images/SPLIT/imgNNNNNN.jpg``, ``SPLIT.json`` with ``filename q_vbs2tango r_Vo2To_vbs_true``, and the other
lists that its public loader opens, empty. SPEED+: ``synthetic/images/imgNNNNNN.jpg``, ``synthetic/SPLIT.json`` with
``q_vbs2tango_true``. Both have ``camera.json``. The quaternion is q_camera_from_target, copied.

References
----------
Kisantal et al. (2020), Satellite Pose Estimation Challenge: Dataset, Competition Design and Results. Park et al.
(2022), SPEED+: Next-Generation Dataset for Spacecraft Pose Estimation across Domain Gap.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import cv2
import msgspec
import numpy as np

from flyaround.simulator.camera.lens.files_native import CameraFile
from flyaround.simulator.camera.lens.formats.registry import camera_text
from flyaround.simulator.dataset.formats.base import (
    DatasetFormat,
    FormatOutput,
    FormatWriter,
    fisheye_problem,
)
from flyaround.simulator.dataset.formats.speed_reader import POSITION, QUATERNION, read_speed, read_speedplus

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame

# The public images are JPEG. At quality 95 the coding error, 2 DN rms, is far below their noise of 12 DN.
JPEG_QUALITY = 95
_LISTS = {"speed": ("train", "test", "real", "real_test"), "speedplus": ("train", "validation")}


def json_bytes(value: Any) -> bytes:  # noqa: ANN401 - any JSON value
    """Return indented JSON, with floats at full precision."""
    return (json.dumps(value, indent=1, allow_nan=False) + "\n").encode()


def jpeg(frame: LabelledFrame) -> bytes:
    """Encode a frame's 8-bit image as JPEG, grey or in colour.

    Raises
    ------
    RuntimeError
        If OpenCV cannot encode it.
    """
    image = frame.image
    bgr = image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1])
    ok, data = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not ok:
        raise RuntimeError(f"OpenCV could not encode {frame.where}")
    return data.tobytes()


class SpeedWriter:
    """Writer of data sets in the SPEED or SPEED+ format.

    Parameters
    ----------
    output : Path
        Output folder.
    card : DatasetCard
        Card of the data set.
    kind : str
        ``speed`` or ``speedplus``.
    """

    def __init__(self, output: FormatOutput, card: DatasetCard, kind: str) -> None:
        self._output, self._camera, self._kind = output, card.camera, kind
        self._rows: dict[str, list[dict[str, Any]]] = {name: [] for name in _LISTS[kind]}

    def write(self, frame: LabelledFrame) -> None:
        """Write the image, and collect its row for the list that `finish` writes."""
        split = frame.split or "train"
        name = f"img{frame.number:06d}.jpg"
        folder = "synthetic/images" if self._kind == "speedplus" else f"images/{split}"
        self._output.write(f"{folder}/{name}", jpeg(frame))
        self._rows.setdefault(split, []).append(
            {
                "filename": name,
                QUATERNION[self._kind]: list(frame.truth.q_camera_from_target_wxyz),
                POSITION: list(frame.truth.t_camera_from_target_m),
            }
        )

    def finish(self) -> None:
        """Write the lists and the camera."""
        folder = "synthetic/" if self._kind == "speedplus" else ""
        for name, rows in self._rows.items():
            self._output.write(f"{folder}{name}.json", json_bytes(rows))
        self._output.write("camera.json", json_bytes(speed_camera(self._camera)))


def speed_camera(camera: Camera) -> dict[str, Any]:
    """Return ``camera.json`` of SPEED+, and of SPEED with focal lengths in pixels added."""
    camera_file = msgspec.convert(msgspec.to_builtins(camera), CameraFile)
    table: dict[str, Any] = json.loads(camera_text(camera_file, "speed", "camera"))
    return table | {"fx_px": camera.fx_px, "fy_px": camera.fy_px}


def _speed(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return SpeedWriter(output, card, "speed")


def _speedplus(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return SpeedWriter(output, card, "speedplus")


_POSES = {
    "carries": "image (JPEG), pose and camera",
    "lacks": "masks, boxes, keypoints and layers",
}
SPEED = DatasetFormat(
    name="speed",
    title="SPEED (Stanford, ESA)",
    writer=_speed,
    read=read_speed,
    problem=fisheye_problem,
    **_POSES,  # type: ignore[arg-type] # two sentences
)
SPEEDPLUS = DatasetFormat(
    name="speedplus",
    title="SPEED+ (Stanford, ESA)",
    writer=_speedplus,
    read=read_speedplus,
    problem=fisheye_problem,
    **_POSES,  # type: ignore[arg-type] # as above
)
