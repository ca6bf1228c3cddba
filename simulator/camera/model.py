"""Pinhole camera: intrinsics, and projection in OpenCV's conventions.

x right, y down, z forward; pixel (0, 0) is the centre of the top-left pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from simulator.arrays import FloatArray

DistortionModel = Literal["none", "brown_conrady", "kannala_brandt"]


@dataclass(frozen=True)
class Distortion:
    """Lens distortion; ``coefficients`` in OpenCV's order for the model."""

    model: DistortionModel = "none"
    coefficients: tuple[float, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Camera:
    """Intrinsics of one camera; this object as JSON is the CAMERA.json of the command line."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion: Distortion = Distortion()

    @property
    def K(self) -> FloatArray:
        """(3, 3) matrix of intrinsics, for ``cv2.projectPoints``."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])

    def project(self, points_camera_m: ArrayLike) -> FloatArray:
        """Pixel positions of points in the camera frame; NaN for points behind the camera.

        Parameters
        ----------
        points_camera_m : (..., 3) [m].

        Returns
        -------
        (..., 2) pixel coordinates.
        """
        p = np.asarray(points_camera_m, float)
        z = np.where(p[..., 2] > 1e-9, p[..., 2], np.nan)
        return np.stack(
            [self.fx_px * p[..., 0] / z + self.cx_px, self.fy_px * p[..., 1] / z + self.cy_px], axis=-1
        )

    def contains(self, pixels_px: ArrayLike) -> np.typing.NDArray[np.bool_]:
        """Whether pixel positions lie on the image (its edges are at -0.5 and size - 0.5)."""
        p = np.asarray(pixels_px, float)
        with np.errstate(invalid="ignore"):
            inside = (
                (p[..., 0] >= -0.5)
                & (p[..., 0] < self.width_px - 0.5)
                & (p[..., 1] >= -0.5)
                & (p[..., 1] < self.height_px - 0.5)
            )
        return np.asarray(inside)
