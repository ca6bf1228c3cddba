"""A reduced region of the image with its noise and scale, for comparison with the drawn target."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Dict, Optional, Tuple, Union

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.geometry.response import Response

Array = np.ndarray

# Blur that removes the craft from a textured background [share of the region's longer side].
TEXTURE = 0.06


@dataclass(frozen=True, eq=False)
class ImagePatch:
    """A reduced region of the image, for comparison with the drawn craft.

    Parameters
    ----------
    gray : (h, w) array
        Pixels, float32.
    sigma : float
        Standard deviation of their noise.
    x0, y0 : float
        Corner of the region [image px].
    factor : float
        Image pixels per patch pixel.
    fine : int
        Drawn pixels per patch pixel, each way.
    full : float
        Full scale.
    plain : float or (h, w) array, optional
        The background without the craft; None for the region under a wide blur, see ``background``.
    tall : float
        Height over width of a patch pixel [image px]: patch pixels are not quite square, and ignoring that would move
        the range by a thousandth.
    clipped : float
        Standard deviation of noise that is cut off at zero, 0 where none is.
    exact : bool
        True for a patch that compares a few refined poses.
    sun : (3,) array, optional
        Unit vector to the Sun, camera axes; None if shadows must show it.
    """

    gray: Array
    sigma: float
    x0: float
    y0: float
    factor: float
    fine: int
    full: float = 255.0
    plain: Union[float, Array, None] = 0.0
    tall: float = 1.0
    clipped: float = 0.0
    exact: bool = False
    sun: Optional[Array] = None

    @cached_property
    def textured(self) -> bool:
        """True if the background has more than one level."""
        return self.plain is None or np.ndim(self.plain) > 0

    @cached_property
    def background(self) -> Union[float, Array]:
        """Level of the background, or its image (h, w). Computed on first use: most patches never need it."""
        if self.plain is None:
            return cv2.GaussianBlur(self.gray, (0, 0), TEXTURE * max(self.gray.shape))
        return self.plain

    @cached_property
    def response(self) -> Response:
        """Mean pixel value as a function of brightness."""
        return Response(self.clipped, self.full)

    @cached_property
    def scale(self) -> Tuple[float, float]:
        """Drawn pixels per picture pixel, across and down."""
        return self.fine / self.factor, self.fine / (self.factor * self.tall)

    @cached_property
    def _blurred(self) -> Dict[float, Array]:
        return {}

    def blurred(self, sigma_px: float) -> Array:
        """Return the region (h, w) through a Gaussian, cached for the next pose; up to 0.2 px there is no blur."""
        if sigma_px <= 0.2:
            return self.gray
        if sigma_px not in self._blurred:
            self._blurred[sigma_px] = cv2.GaussianBlur(self.gray, (0, 0), sigma_px)
        return self._blurred[sigma_px]

    def rays(self, camera: CameraIntrinsics) -> Tuple[Array, Array]:
        """Return the normalised pinhole coordinates of the drawn pixels' columns and rows."""
        h, w = self.gray.shape
        across, down = self.scale
        u = ((np.arange(w * self.fine) + 0.5) / across - 0.5 + self.x0 - camera.cx_px) / camera.fx_px
        v = ((np.arange(h * self.fine) + 0.5) / down - 0.5 + self.y0 - camera.cy_px) / camera.fy_px
        return u, v
