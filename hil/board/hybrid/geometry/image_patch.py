"""Reduced image region with its noise and scale, for comparison with the rendered target."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Dict, Optional, Tuple, Union

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.geometry.response import Response

Array = np.ndarray

# Standard deviation of the blur that removes the craft from a textured background [share of the region's longer side];
# hand-tuned.
BACKGROUND_BLUR = 0.06


@dataclass(frozen=True, eq=False)
class ImagePatch:
    """Reduced region of the image, for comparison with the rendered target.

    Parameters
    ----------
    gray : (h, w) array
        Pixel values, float32.
    sigma : float
        Standard deviation of the pixel noise.
    x0 : float
        Left edge of the region [image px].
    y0 : float
        Upper edge of the region [image px].
    factor : float
        Image pixels per patch pixel.
    fine : int
        Rendered pixels per patch pixel, in each direction.
    full_scale : float
        Full scale of the pixel values.
    background_level : float or (h, w) array, optional
        Background without the craft. If None, ``background`` estimates it by a wide blur of the region.
    pixel_aspect : float
        Height over width of a patch pixel. Patch pixels are not quite square; ignoring it would bias the range by a
        thousandth.
    clipped : float
        Standard deviation of the noise that is clipped at zero; 0 if the noise is not clipped.
    exact : bool
        True for a patch on which a few refined poses are compared.
    sun : (3,) array, optional
        Unit vector to the Sun, camera axes; None if it is unknown.
    """

    gray: Array
    sigma: float
    x0: float
    y0: float
    factor: float
    fine: int
    full_scale: float = 255.0
    background_level: Union[float, Array, None] = 0.0
    pixel_aspect: float = 1.0
    clipped: float = 0.0
    exact: bool = False
    sun: Optional[Array] = None

    @cached_property
    def textured(self) -> bool:
        """True if the background is not uniform."""
        return self.background_level is None or np.ndim(self.background_level) > 0

    @cached_property
    def background(self) -> Union[float, Array]:
        """Background level, or background image (h, w). Computed on first use, because most patches never need it."""
        if self.background_level is None:
            return cv2.GaussianBlur(self.gray, (0, 0), BACKGROUND_BLUR * max(self.gray.shape))
        return self.background_level

    @cached_property
    def response(self) -> Response:
        """Mean pixel value as a function of brightness."""
        return Response(self.clipped, self.full_scale)

    @cached_property
    def scale(self) -> Tuple[float, float]:
        """Rendered pixels per image pixel, horizontal and vertical."""
        return self.fine / self.factor, self.fine / (self.factor * self.pixel_aspect)

    @cached_property
    def _blurred(self) -> Dict[float, Array]:
        return {}

    def blurred(self, sigma_px: float) -> Array:
        """Return the region (h, w) after a Gaussian blur, cached; no blur is applied up to 0.2 px."""
        # such a kernel leaves a pixel all but 2e-5 of its weight
        if sigma_px <= 0.2:
            return self.gray
        if sigma_px not in self._blurred:
            self._blurred[sigma_px] = cv2.GaussianBlur(self.gray, (0, 0), sigma_px)
        return self._blurred[sigma_px]

    def rays(self, camera: CameraIntrinsics) -> Tuple[Array, Array]:
        """Return the normalised pinhole coordinates of the rendered pixels' columns and rows."""
        h, w = self.gray.shape
        across, down = self.scale
        u = ((np.arange(w * self.fine) + 0.5) / across - 0.5 + self.x0 - camera.cx_px) / camera.fx_px
        v = ((np.arange(h * self.fine) + 0.5) / down - 0.5 + self.y0 - camera.cy_px) / camera.fy_px
        return u, v
