"""Images of a report as files next to its page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import ByteArray

QUALITY = 88  # JPEG quality


def jpeg(image: ByteArray, quality: int = QUALITY) -> bytes:
    """Encode an image, grey (H, W) or RGB (H, W, 3), as JPEG.

    Raises
    ------
    RuntimeError
        If OpenCV cannot encode it.
    """
    bgr = image if image.ndim == 2 else image[..., ::-1]
    ok, data = cv2.imencode(".jpg", np.ascontiguousarray(bgr), [cv2.IMWRITE_JPEG_QUALITY, quality])
    if not ok:
        raise RuntimeError("OpenCV could not encode a JPEG")
    return np.asarray(data).tobytes()


def write_jpeg(path: Path, image: ByteArray, quality: int = QUALITY) -> None:
    """Write an image, grey or RGB, as a JPEG file."""
    write_atomic(path, jpeg(image, quality))
