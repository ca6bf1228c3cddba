"""Image crops: views of a virtual camera turned towards a part of the image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Sequence

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.vectors import length, swing
from flyaround.hil.board.hybrid.image.edge_field import area_mean
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL, INPUT_PX, channels

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class ImageCrop:
    """Crop of an image: direction of its centre, and assumed diameter of the target's bounding sphere.

    Parameters
    ----------
    direction : (3,) array
        Unit vector to the centre, camera axes.
    diameter_px : float
        Diameter that the bounding sphere would have on the boresight: twice the focal length times the tangent of its
        angular radius.
    """

    direction: Array
    diameter_px: float

    @staticmethod
    def at(camera: CameraIntrinsics, u_px: float, v_px: float, diameter_px: float) -> ImageCrop:
        """Return a crop centred on a pixel.

        Returns
        -------
        ImageCrop
            Crop in the pixel's direction, computed without the camera's distortion.
        """
        d = np.array([(u_px - camera.cx_px) / camera.fx_px, (v_px - camera.cy_px) / camera.fy_px, 1.0])
        return ImageCrop(d / np.linalg.norm(d), diameter_px)

    def moved(self, f_px: float, shift: Array, log_size: float) -> ImageCrop:
        """Return the crop corrected by outputs of the network.

        Parameters
        ----------
        f_px : float
            Focal length of the camera [px].
        shift : (2,) array
            Displacement of the target's centre [half sides of the input].
        log_size : float
            Logarithm of the target's size over the size that the crop assumes.

        Returns
        -------
        ImageCrop
            Crop turned towards the target's centre, with the target's diameter.
        """
        half = 0.5 * self.diameter_px / (INPUT_FILL * f_px)
        d = self.swing() @ np.array([half * shift[0], half * shift[1], 1.0])
        return ImageCrop(d / length(d), self.diameter_px * float(np.exp(log_size)))

    def swing(self) -> Array:
        """Return the shortest rotation from the boresight to the crop's direction.

        Returns
        -------
        (3, 3) array
            Rotation matrix, camera from crop.
        """
        return swing(self.direction)


def crop_image(
    image: Array,
    camera: CameraIntrinsics,
    crop: ImageCrop,
    side_px: int,
    sphere_px: float,
    reduced: Optional[Array] = None,
) -> Array:
    """Resample an image to the view of a crop.

    Parameters
    ----------
    image : (H, W) array
        The image.
    camera : CameraIntrinsics
        Intrinsics of the camera.
    crop : ImageCrop
        Crop to take.
    side_px : int
        Side of the result [px].
    sphere_px : float
        Diameter of the bounding sphere in the result [px].
    reduced : (h, w) array, optional
        Whole image reduced by area averaging, from which much wider crops are taken.

    Returns
    -------
    (side_px, side_px) array
        Crop, float32, averaged over the area of each pixel; beyond the image its border is replicated.
    """
    f = 0.5 * (camera.fx_px + camera.fy_px)
    # image pixels per pixel of the crop
    factor = crop.diameter_px / sphere_px
    step = (np.arange(side_px) - 0.5 * (side_px - 1)) * factor / f
    x, y = np.meshgrid(step, step)
    pixels = camera.pixels(np.stack([x, y, np.ones_like(x)], axis=-1) @ crop.swing().T)
    if reduced is not None:
        scale = np.array([image.shape[1] / reduced.shape[1], image.shape[0] / reduced.shape[0]])
        if factor > 2.0 * scale.max():
            # averages of averages
            image, pixels, factor = reduced, (pixels + 0.5) / scale - 0.5, factor / float(scale.max())
    h, w = image.shape
    x0, y0 = (
        int(np.clip(np.floor(pixels[..., k].min()) - factor, 0, size - 2)) for k, size in ((0, w), (1, h))
    )
    x1, y1 = (
        int(np.clip(np.ceil(pixels[..., k].max()) + factor, low + 2, size))
        for k, low, size in ((0, x0, w), (1, y0, h))
    )
    part = image[y0:y1, x0:x1]
    if factor > 1.0:
        part = area_mean(part, max(2, round((x1 - x0) / factor)), max(2, round((y1 - y0) / factor)))
    u = ((pixels[..., 0] - x0 + 0.5) * (part.shape[1] / (x1 - x0)) - 0.5).astype(np.float32)
    v = ((pixels[..., 1] - y0 + 0.5) * (part.shape[0] / (y1 - y0)) - 0.5).astype(np.float32)
    part = np.asarray(part, np.float32)
    return np.asarray(cv2.remap(part, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def network_inputs(
    image: Array,
    noise: float,
    camera: CameraIntrinsics,
    crops: Sequence[ImageCrop],
    reduced: Optional[Array] = None,
    black: float = 0.0,
) -> Array:
    """Return inputs (B, 2, S, S) of the keypoint network for crops of an image, float32.

    Parameters
    ----------
    image : (H, W) array
        The image.
    noise : float
        Standard deviation of the image noise.
    camera : CameraIntrinsics
        Intrinsics of the camera.
    crops : sequence of ImageCrop
        Crops to take.
    reduced : (h, w) array, optional
        Image reduced by area averaging, from which much wider crops are taken.
    black : float
        Black level, which is subtracted.
    """
    sphere = INPUT_FILL * INPUT_PX
    pictures = np.stack([crop_image(image, camera, g, INPUT_PX, sphere, reduced) for g in crops])
    if black > 0:
        pictures = pictures - np.float32(black)
    return channels(pictures, np.array([noise / max(g.diameter_px / sphere, 1.0) for g in crops]))
