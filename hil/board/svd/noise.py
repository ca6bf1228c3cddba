"""Noise of a picture, measured on the picture itself."""

from __future__ import annotations

import numpy as np

Array = np.ndarray


def noise_sigma(image: Array, full_scale: float) -> float:
    """Standard deviation of the noise where the scale does not clip it, in the picture's units.

    Immerkaer's mask (1996, Fast noise variance estimation) removes planes and edges' first order; the
    median absolute value ignores what texture remains. Black space clips half of the noise, so pixels
    well inside the scale decide where there are enough of them.
    """
    step = max(1, min(image.shape) // 400)
    rows = [image[y : y + 3] for y in range(0, image.shape[0] - 2, 3 * step)]
    if not rows or image.shape[1] < 3:
        return 0.0
    a = np.stack(rows).astype(np.float32)
    col = a[:, 0] - 2 * a[:, 1] + a[:, 2]
    lap = (col[:, :-2] - 2 * col[:, 1:-1] + col[:, 2:]) / 6.0
    mean = a.mean(axis=1)
    mean = (mean[:, :-2] + mean[:, 1:-1] + mean[:, 2:]) / 3
    absolute = np.abs(lap)
    overall = float(np.median(absolute)) * 1.4826
    inside = (mean > 4 * overall + 0.02 * full_scale) & (mean < 0.85 * full_scale)
    if int(inside.sum()) > 300:
        overall = max(overall, float(np.median(absolute[inside])) * 1.4826)
    elif overall > 0:
        # a zero-mean normal clipped at zero keeps 0.58 of its deviation
        overall /= 0.58
    return overall
