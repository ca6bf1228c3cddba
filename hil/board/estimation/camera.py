"""Camera intrinsics with OpenCV's two distortion models: projection of points and back-projection of pixels."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Dict, Tuple

import numpy as np

from flyaround.hil.board.encoding import ENCODINGS
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.json_values import BAD_VALUE, whole

Array = np.ndarray

# Largest width and height of an image [px]: 16 bits, as in the link's HELLO_ACK.
MAX_SIDE_PX = 65_535

_COEFFICIENT_COUNTS: Dict[str, Tuple[int, ...]] = {
    "none": (0,),
    "brown_conrady": (4, 5, 8),
    "kannala_brandt": (4,),
}


@dataclass(frozen=True)
class CameraIntrinsics:
    """Intrinsics of a camera; pixel (0, 0) is the centre of the top-left pixel.

    Parameters
    ----------
    width_px : int
        Image width.
    height_px : int
        Image height.
    fx_px : float
        Focal length in x.
    fy_px : float
        Focal length in y.
    cx_px : float
        Column of the principal point.
    cy_px : float
        Row of the principal point.
    distortion_model : str, optional
        ``none``, ``brown_conrady`` or ``kannala_brandt``.
    distortion : tuple of float, optional
        Coefficients in OpenCV's order.
    encoding : str, optional
        Transfer function of the delivered images, inverted before estimation.

    Raises
    ------
    BoardModelError
        If a number is not finite or out of range, the encoding or distortion model is unknown, or the model takes
        another number of coefficients.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    distortion_model: str = "none"
    distortion: Tuple[float, ...] = field(default_factory=tuple)
    encoding: str = "linear"

    def __post_init__(self) -> None:
        numbers = [self.fx_px, self.fy_px, self.cx_px, self.cy_px, *self.distortion]
        if not np.all(np.isfinite(numbers)) or self.fx_px <= 0 or self.fy_px <= 0:
            raise BoardModelError("camera: focal lengths must be positive and every number finite")
        if not 1 <= min(self.width_px, self.height_px) <= max(self.width_px, self.height_px) <= MAX_SIDE_PX:
            raise BoardModelError(
                f"camera: {self.width_px} x {self.height_px} pixels, allowed: 1 to {MAX_SIDE_PX} each"
            )
        if self.encoding not in ENCODINGS:
            raise BoardModelError(f"camera: unknown encoding {self.encoding!r}")
        counts = _COEFFICIENT_COUNTS.get(self.distortion_model)
        if counts is None:
            raise BoardModelError(f"camera: unknown distortion model {self.distortion_model!r}")
        if len(self.distortion) not in counts:
            allowed = " or ".join(map(str, counts))
            raise BoardModelError(
                f"camera: {len(self.distortion)} coefficients, {self.distortion_model} takes {allowed}"
            )

    @staticmethod
    def from_dict(data: Dict[str, Any]) -> CameraIntrinsics:
        """Make a camera from the project's camera JSON object.

        Returns
        -------
        CameraIntrinsics
            Camera with the given pinhole matrix and lens [px].

        Raises
        ------
        BoardModelError
            If a field is missing or invalid.
        """
        try:
            distortion = data.get("distortion") or {}
            return CameraIntrinsics(
                whole(data["width_px"]),
                whole(data["height_px"]),
                float(data["fx_px"]),
                float(data["fy_px"]),
                float(data["cx_px"]),
                float(data["cy_px"]),
                str(distortion.get("model", "none")),
                tuple(float(c) for c in distortion.get("coefficients", ())),
                str(data.get("encoding", "linear")),
            )
        except BAD_VALUE as error:
            if isinstance(error, BoardModelError):
                raise
            raise BoardModelError(f"camera has a bad field: {error!r:.200}") from error

    @property
    def distorted(self) -> bool:
        """True if the projection differs from a pinhole's. Always True for a fisheye, even with zero coefficients."""
        return self.distortion_model == "kannala_brandt" or any(self.distortion)

    @cached_property
    def pinhole(self) -> CameraIntrinsics:
        """The same camera without distortion."""
        return replace(self, distortion_model="none", distortion=())

    def distort(self, x: Array, y: Array) -> Tuple[Array, Array]:
        """Apply the lens distortion to normalised image coordinates (those of a pinhole at z = 1).

        Returns
        -------
        tuple of array
            Distorted coordinates x and y at z = 1, each of the input's shape.
        """
        if self.distortion_model == "none":
            return x, y
        k = np.zeros(8)
        k[: len(self.distortion[:8])] = self.distortion[:8]
        r2 = x * x + y * y
        if self.distortion_model == "brown_conrady":
            radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])))
            return (
                x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
                y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y,
            )
        r = np.sqrt(r2)
        theta = np.arctan(r)
        t2 = theta * theta
        bent = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
        scale = np.where(r > 1e-9, bent / np.maximum(r, 1e-9), 1.0)
        return x * scale, y * scale

    def pixels(self, points_camera_m: Array) -> Array:
        """Project points (..., 3) in the camera frame [m] to pixels (..., 2). Depths are clamped to at least 1 mm.

        Returns
        -------
        (..., 2) array
            Columns and rows [px]; (0, 0) is the centre of the first pixel.
        """
        z = np.maximum(points_camera_m[..., 2], 1e-3)
        x, y = self.distort(points_camera_m[..., 0] / z, points_camera_m[..., 1] / z)
        return np.stack([self.fx_px * x + self.cx_px, self.fy_px * y + self.cy_px], axis=-1)


def undistorted_rays(camera: CameraIntrinsics, pixels: Array) -> Array:
    """Return the undistorted normalised coordinates (N, 2) of pixels (N, 2), by fixed-point iteration."""
    p = np.asarray(pixels, float).reshape(-1, 2)
    x0 = (p[:, 0] - camera.cx_px) / camera.fx_px
    y0 = (p[:, 1] - camera.cy_px) / camera.fy_px
    x, y = x0.copy(), y0.copy()
    for _ in range(8 if camera.distortion else 0):
        xd, yd = camera.distort(x, y)
        x, y = x + (x0 - xd), y + (y0 - yd)
    return np.stack([x, y], axis=-1)
