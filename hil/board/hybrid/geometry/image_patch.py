"""A region of the image, reduced, with its noise and scale: what a drawn target is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Dict, Optional, Tuple, Union

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.geometry.response import Response

Array = np.ndarray

# Blur that leaves of a texture what it would be without the craft: share of the region's longer side.
TEXTURE = 0.06


@dataclass(frozen=True, eq=False)
class ImagePatch:
    """A region of the picture, reduced, for comparison with the drawn craft.

    Parameters
    ----------
    gray : (h, w) float32. sigma : its noise. x0, y0 : the region's corner, picture pixels.
    factor : picture pixels per pixel of it. fine : drawn pixels per pixel of it, each way.
    full : where its scale ends. plain : what it would be without the craft, (h, w) or one level; None for itself
        under a wide blur, see ``background``.
    tall : rows' picture pixels over columns': a region is no whole number of equal pixels both ways, and to take
        it for one moves the range by a thousandth.
    sun : (3,) unit vector to the Sun, camera axes; None where shadows have to tell it.
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
        """Whether what lies behind the craft has no one level."""
        return self.plain is None or np.ndim(self.plain) > 0

    @cached_property
    def background(self) -> Union[float, Array]:
        """What it would be without the craft, made when asked for: most that is aligned on a texture never is."""
        if self.plain is None:
            return cv2.GaussianBlur(self.gray, (0, 0), TEXTURE * max(self.gray.shape))
        return self.plain

    @cached_property
    def response(self) -> Response:
        """What the picture shows of a brightness."""
        return Response(self.clipped, self.full)

    @cached_property
    def scale(self) -> Tuple[float, float]:
        """Drawn pixels per picture pixel, across and down."""
        return self.fine / self.factor, self.fine / (self.factor * self.tall)

    @cached_property
    def _blurred(self) -> Dict[float, Array]:
        return {}

    def blurred(self, sigma_px: float) -> Array:
        """(h, w) the region through a Gaussian, kept for the next pose; hardly any blur is none."""
        if sigma_px <= 0.2:
            return self.gray
        if sigma_px not in self._blurred:
            self._blurred[sigma_px] = cv2.GaussianBlur(self.gray, (0, 0), sigma_px)
        return self._blurred[sigma_px]

    def rays(self, camera: CameraIntrinsics) -> Tuple[Array, Array]:
        """Normalised coordinates of the drawn pixels' columns and rows; the patch shows a pinhole's picture."""
        h, w = self.gray.shape
        across, down = self.scale
        u = ((np.arange(w * self.fine) + 0.5) / across - 0.5 + self.x0 - camera.cx_px) / camera.fx_px
        v = ((np.arange(h * self.fine) + 0.5) / down - 0.5 + self.y0 - camera.cy_px) / camera.fy_px
        return u, v
