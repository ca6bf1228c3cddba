"""Input of the pose proposal network: crops of the image by a small virtual camera turned to a part of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Sequence

import cv2
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.estimation.vectors import length, swing
from flyaround.hil.board.hybrid.image.edge_field import area_mean
from flyaround.hil.board.hybrid.image.image_region import library_reads, region
from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.hybrid.propose.learned.network import INPUT_FILL, INPUT_PX, contrast

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class ImageCrop:
    """A crop: the direction of its centre, and the diameter of the target's sphere there.

    Parameters
    ----------
    direction : (3,) unit vector, camera axes. diameter_px : of the target's sphere were it on the boresight,
        which is its focal length times twice the tangent of its half angle.
    """

    direction: Array
    diameter_px: float

    @staticmethod
    def at(camera: CameraIntrinsics, u_px: float, v_px: float, diameter_px: float) -> ImageCrop:
        """Centred on a pixel, without the lens's distortion: a second pass corrects the first."""
        d = np.array([(u_px - camera.cx_px) / camera.fx_px, (v_px - camera.cy_px) / camera.fy_px, 1.0])
        return ImageCrop(d / np.linalg.norm(d), diameter_px)

    def moved(self, f_px: float, shift: Array, log_size: float) -> ImageCrop:
        """Corrected by the network's output: shift (2,) in half sides of its input, logarithm of the size.

        Parameters
        ----------
        f_px : focal length of the camera.
        """
        half = 0.5 * self.diameter_px / (INPUT_FILL * f_px)
        d = self.swing() @ np.array([half * shift[0], half * shift[1], 1.0])
        return ImageCrop(d / length(d), self.diameter_px * float(np.exp(log_size)))

    def swing(self) -> Array:
        """(3, 3) the shortest rotation from the boresight to this direction."""
        return swing(self.direction)


def crop_image(
    image: Array,
    camera: CameraIntrinsics,
    crop: ImageCrop,
    side_px: int,
    sphere_px: float,
    reduced: Optional[Array] = None,
) -> Array:
    """(side, side) float32 the image in a crop, averaged over what each pixel covers.

    Parameters
    ----------
    image : (H, W). sphere_px : diameter of the craft's sphere there. reduced : the whole picture reduced by area
        averaging, which a small camera that takes in much is shown instead.
    """
    return crop_images(image, camera, [crop], side_px, sphere_px, reduced)[0]


def crop_images(
    image: Array,
    camera: CameraIntrinsics,
    crops: Sequence[ImageCrop],
    side_px: int,
    sphere_px: float,
    reduced: Optional[Array] = None,
) -> Array:
    """(N, side, side) the same of many crops."""
    if camera.distorted or not library_reads(image):
        return np.stack([_crop_by_opencv(image, camera, g, side_px, sphere_px, reduced) for g in crops])
    whole = None if reduced is None else contiguous(reduced, "float32")
    if min(image.shape) < 2 or (whole is not None and min(whole.shape) < 2):
        raise ValueError("an image to crop must have two rows and two columns")
    intrinsics = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    given = np.array([[*c.direction, c.diameter_px] for c in crops], float).reshape(-1, 4)
    n, out = len(given), np.empty((len(given), side_px, side_px), np.float32)
    shape = (0, 0) if whole is None else whole.shape
    if library().fly_crop_images(
        *region(image), whole, *shape, intrinsics, given, n, side_px, sphere_px, out
    ):
        raise MemoryError("no memory to crop an image")
    return out


def _crop_by_opencv(
    image: Array,
    camera: CameraIntrinsics,
    crop: ImageCrop,
    side_px: int,
    sphere_px: float,
    reduced: Optional[Array],
) -> Array:
    f = 0.5 * (camera.fx_px + camera.fy_px)
    # picture pixels per pixel of the small one
    factor = crop.diameter_px / sphere_px
    step = (np.arange(side_px) - 0.5 * (side_px - 1)) * factor / f
    x, y = np.meshgrid(step, step)
    at = camera.pixels(np.stack([x, y, np.ones_like(x)], axis=-1) @ crop.swing().T)
    if reduced is not None:
        scale = np.array([image.shape[1] / reduced.shape[1], image.shape[0] / reduced.shape[0]])
        if factor > 2.0 * scale.max():
            # its pixels are averages of averages then
            image, at, factor = reduced, (at + 0.5) / scale - 0.5, factor / float(scale.max())
    h, w = image.shape
    x0, y0 = (int(np.clip(np.floor(at[..., k].min()) - factor, 0, size - 2)) for k, size in ((0, w), (1, h)))
    x1, y1 = (
        int(np.clip(np.ceil(at[..., k].max()) + factor, low + 2, size))
        for k, low, size in ((0, x0, w), (1, y0, h))
    )
    part = image[y0:y1, x0:x1]
    if factor > 1.0:
        part = area_mean(part, max(2, round((x1 - x0) / factor)), max(2, round((y1 - y0) / factor)))
    u = ((at[..., 0] - x0 + 0.5) * (part.shape[1] / (x1 - x0)) - 0.5).astype(np.float32)
    v = ((at[..., 1] - y0 + 0.5) * (part.shape[0] / (y1 - y0)) - 0.5).astype(np.float32)
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
    """(B, 64, 64, 2) float32 the network's input for each crop.

    Parameters
    ----------
    image : (H, W). noise : its standard deviation. reduced : see ``crop_image``. black : what the image adds to light.
    """
    sphere = INPUT_FILL * INPUT_PX
    pictures = crop_images(image, camera, crops, INPUT_PX, sphere, reduced)
    if black > 0:
        pictures = pictures - np.float32(black)
    return contrast(pictures, np.array([noise / max(g.diameter_px / sphere, 1.0) for g in crops]))
