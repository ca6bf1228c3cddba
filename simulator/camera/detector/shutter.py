"""The shutter: exposure times of an image's rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray

ShutterKind = Literal["global", "rolling"]

EXPOSURE_S = (1e-9, 1e4)
"""Smallest and largest exposure time of files and recorded scenes."""
READOUT_S = (0.0, 10.0)
"""Smallest and largest read-out time of files and recorded scenes."""


@dataclass(frozen=True, kw_only=True)
class Shutter:
    """Shutter of a camera.

    Parameters
    ----------
    kind : ShutterKind, optional
        ``global``, all rows at once; ``rolling``, one after the other from the top.
    readout_s : float, optional
        Time from the exposure of the first row to that after the last; for a rolling shutter [s].
    motion_blur : bool, optional
        True to integrate the motion during the exposure; otherwise an image is an instant.
    """

    kind: ShutterKind = "global"
    readout_s: float = 0.0
    motion_blur: bool = True

    @property
    def is_rolling(self) -> bool:
        """True if rows are exposed at different times."""
        return self.kind == "rolling" and self.readout_s > 0

    def row_time_s(self, row_px: ArrayLike, height_px: int) -> FloatArray:
        """Return the mid-exposure times of rows relative to that of the image.

        Returns
        -------
        array
            Times [s] of the shape of ``row_px``, negative for rows read before the middle one; rows outside the image
            have the times of its edges. Zeros for a global shutter.
        """
        row = np.clip(np.asarray(row_px, float), -0.5, height_px - 0.5)
        if not self.is_rolling:
            return np.zeros_like(row)
        return np.asarray((row - (height_px - 1) / 2) * (self.readout_s / height_px))
