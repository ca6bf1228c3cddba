"""Check of the label layers of a frame that was drawn again: pixel by pixel, where rays ask about samples alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import ByteArray

RELATIVE = {"depth": 2e-5}
"""Rounding of another renderer or processor, as a share of the value."""
ABSOLUTE = {"depth": 1e-3, "normals": 0.02, "flow": 0.02, "clean": 1.0}
"""The same in the layer's own unit: metres, 1, pixels, digital numbers."""
FEW, MOST_OF_MASK = 6, 0.01
"""Pixels, and share of the mask, that rounding at an edge may leave to another surface."""


def check_same_layers(
    layers: Mapping[str, NDArray[Any]],
    again: Mapping[str, NDArray[Any]],
    mask: ByteArray,
    *,
    is_same_renderer: bool,
) -> list[str]:
    """Compare the layers of a frame with those that its record gives.

    Parameters
    ----------
    layers, again : as they were read, and as they are drawn, by name.
    is_same_renderer : the picture is the same to the byte, so that rounding at few pixels alone is allowed.
    """
    most = FEW if is_same_renderer else max(FEW, MOST_OF_MASK * np.count_nonzero(mask))
    wrong = []
    for name in sorted(layers.keys() & again.keys()):
        mine, other = layers[name], again[name]
        if not is_same_renderer and (name == "clean" or mine.shape != other.shape):
            continue  # another renderer's light is another, and its amodal mask may begin elsewhere
        if mine.shape != other.shape:
            wrong.append(f"{name} is {mine.shape}, drawn again {other.shape}")
            continue
        bad = _differing(name, mine, other)
        if bad > most:
            wrong.append(f"{name} differs at {bad} pixels from what the record gives when it is drawn again")
    return wrong


def _differing(name: str, mine: NDArray[Any], other: NDArray[Any]) -> int:
    """Count the pixels that differ by more than rounding."""
    if np.array_equal(mine, other, equal_nan=mine.dtype.kind == "f"):
        return 0
    a, b = mine.astype(np.float64), other.astype(np.float64)
    # one unknown and one known value differ, and so do two that are too far apart
    near = np.abs(a - b) <= ABSOLUTE.get(name, 0.0) + RELATIVE.get(name, 0.0) * np.abs(b)
    bad = ~(near | (np.isnan(a) & np.isnan(b)))
    return int(np.count_nonzero(bad if bad.ndim == 2 else bad.any(axis=2)))
