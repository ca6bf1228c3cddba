"""Pinhole camera of the network's input, and resampling of other cameras' images to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Tuple

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.image.edge_field import area_mean

Array = np.ndarray

# Contrast below which an image is not amplified any further: standard deviation, square root of full scale.
MIN_CONTRAST = 0.01


@dataclass(frozen=True)
class NetworkCamera:
    """Pinhole camera with the principal point in the centre."""

    width_px: int
    height_px: int
    f_px: float

    @staticmethod
    def like(camera: CameraIntrinsics, width_px: int) -> NetworkCamera:
        """Return a camera with the horizontal field of view of another one.

        Returns
        -------
        NetworkCamera
            Camera of square pixels, ``width_px`` wide, with about the aspect ratio of ``camera``'s image.
        """
        height_px = max(round(width_px * camera.height_px / camera.width_px), 1)
        return NetworkCamera(width_px, height_px, camera.fx_px * width_px / camera.width_px)

    def enlarged(self, times: int) -> NetworkCamera:
        """Return a camera of the same view at a higher resolution.

        Returns
        -------
        NetworkCamera
            Camera with ``times`` as many pixels in each direction.
        """
        return NetworkCamera(times * self.width_px, times * self.height_px, times * self.f_px)

    @property
    def half_view(self) -> Array:
        """Tangents (2,) of half the field of view, horizontal and vertical."""
        return np.array([self.width_px, self.height_px]) / (2 * self.f_px)

    def rays(self) -> Array:
        """Return the normalised coordinates of each pixel.

        Returns
        -------
        (h, w, 2) array
            Coordinates x/z and y/z of the pixel centres.
        """
        x = (np.arange(self.width_px) - 0.5 * (self.width_px - 1)) / self.f_px
        y = (np.arange(self.height_px) - 0.5 * (self.height_px - 1)) / self.f_px
        return np.stack(np.meshgrid(x, y), axis=-1)


@dataclass(frozen=True, eq=False)
class PictureReducer:
    """Resampling of a camera's images to the network's input.

    Parameters
    ----------
    reduced : tuple of int
        Width and height to which an image is first averaged.
    at : (h, w, 2) array
        Position of each output pixel in the averaged image, float32.
    """

    reduced: Tuple[int, int]
    at: Array

    @staticmethod
    def prepare(view: NetworkCamera, camera: CameraIntrinsics) -> PictureReducer:
        """Compute the resampling of images of ``camera`` to ``view``.

        Returns
        -------
        PictureReducer
            Resampling that averages over pixels where the image is finer than ``view``, and removes the distortion.
        """
        share = min(view.f_px / (0.5 * (camera.fx_px + camera.fy_px)), 1.0)
        width, height = (max(round(share * n), 1) for n in (camera.width_px, camera.height_px))
        rays = view.rays()
        pixels = camera.pixels(np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1))
        scale = np.array([width / camera.width_px, height / camera.height_px])
        return PictureReducer((width, height), ((pixels + 0.5) * scale - 0.5).astype(np.float32))

    def __call__(self, image: Array) -> Array:
        """Return the square root of the relative brightness (h, w), float32; edge pixels are extended outwards.

        Parameters
        ----------
        image : (H, W) array
            Image, uint8 or uint16; the full scale of the latter is its largest value.
        """
        full = 255.0 if image.dtype == np.uint8 else max(float(image.max()), 1.0)
        # float, because averaging bytes would round dark images to a few levels
        small = area_mean(image.astype(np.float32), *self.reduced)
        resampled = cv2.remap(
            small, self.at[..., 0], self.at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.sqrt(np.maximum(resampled, 0.0) / np.float32(full))


def standardise(pictures: Array) -> Array:
    """Standardise the brightness of images (..., h, w), each by itself.

    Returns
    -------
    (..., h, w) array
        Images with a mean of zero and a standard deviation of one, float32; below one if that of the input is less than
        ``MIN_CONTRAST``.
    """
    mean = pictures.mean(axis=(-2, -1), keepdims=True)
    spread = pictures.std(axis=(-2, -1), keepdims=True)
    return np.asarray((pictures - mean) / np.maximum(spread, MIN_CONTRAST), np.float32)
