"""A sensor: a flash rangefinder of 32 x 20 cells along the boresight, with one centimetre of noise."""

import numpy as np

from flyaround.plugins import Frame

CELLS = (20, 32)
NOISE_M = 0.01


def measure(frame: Frame, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return the nearest depth in each cell [m], NaN for none; random numbers come from ``rng`` only."""
    depth = frame.depth_m
    rows = np.array_split(np.arange(depth.shape[0]), CELLS[0])
    columns = np.array_split(np.arange(depth.shape[1]), CELLS[1])
    nearest = np.full(CELLS, np.nan, np.float32)
    for i, y in enumerate(rows):
        for j, x in enumerate(columns):
            cell = depth[y[0] : y[-1] + 1, x[0] : x[-1] + 1]
            if np.isfinite(cell).any():
                nearest[i, j] = np.nanmin(cell) + NOISE_M * rng.standard_normal()
    return {"depth_m": nearest}
