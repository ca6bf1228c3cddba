"""Images of a craft with known pose next to renderings at the same pose, under fitted light."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.compare.image_statistics import (
    EDGE_BLUR_PX,
    MAX_GRADIENT_DN,
    gradient_histogram,
    histogram_distance_dn,
    sobel,
)
from flyaround.simulator.dataset.importing import is_coloured, read_picture
from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene
from tools.studies.fitted_light.fit import fit_light, fit_materials, light_basis, repainted

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.compare.references import Reference
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray
    from flyaround.simulator.targets.model import Target
    from tools.studies.fitted_light.fit import FittedLight, LightBasis

CLIPPED_DN = 250  # digital number from which a pixel counts as saturated
SHAPE_WITHIN = 0.01  # maximum difference of the aspect ratios of an image and its camera
_BLOCK_PX = 16  # side of the blocks whose darkest give noise and black level
_SSIM_SIGMA_PX, _SSIM_SIDE_PX = 1.5, 11  # Gaussian window of Wang et al. (2004)
_EDGE_DN_PX = 2.0  # gradient of the blurred image that counts as an edge: a third of a dark craft's outline


@dataclass(frozen=True, eq=False, kw_only=True)
class CraftLook:
    """Appearance of the craft in one of two images.

    Parameters
    ----------
    dark_dn : float
        Mean of the darkest tenth of all blocks of 16 x 16 pixels.
    noise_dn : float
        Standard deviation inside these blocks: second differences are unreliable where compression has smoothed the
        noise.
    clipped : float
        Share of the pixels inside the craft's convex hull at 250 DN or above.
    """

    dark_dn: float
    noise_dn: float
    clipped: float


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedPair:
    """A real image and the rendering at its pose.

    Parameters
    ----------
    reference : Reference
        The real image with its pose.
    image : ByteArray
        Rendering.
    light : FittedLight
        Fitted light.
    window : tuple of int
        Bounding box ``x0, y0, x1, y1`` of the craft [pixels].
    ncc : float
        Normalised cross-correlation inside the silhouette.
    ssim : float
        Structural similarity inside the silhouette.
    theirs : CraftLook
        Measurements of the real image.
    ours : CraftLook
        Measurements of the rendering.
    gradient_moved_dn : float
        Earth mover's distance of the gradient histograms inside the silhouette [DN per pixel].
    outline_px : float or None
        Median distance from the visible outline of the rendering to the nearest edge of the image; None without
        outline.
    fitted_on : bool
        True if the materials were fitted on this image.
    """

    reference: Reference
    image: ByteArray
    light: FittedLight
    window: tuple[int, int, int, int]
    ncc: float
    ssim: float
    theirs: CraftLook
    ours: CraftLook
    gradient_moved_dn: float
    outline_px: float | None
    fitted_on: bool

    def document(self) -> dict[str, Any]:
        """Return the figures as a JSON document."""
        looks = {
            side: {
                "dark_dn": round(l.dark_dn, 1),
                "noise_dn": round(l.noise_dn, 2),
                "clipped": round(l.clipped, 4),
            }
            for side, l in (("reference", self.theirs), ("ours", self.ours))
        }
        return {
            "picture": self.reference.path.name,
            "lights": len(self.light.lights),
            "ncc": round(self.ncc, 3),
            "ssim": round(self.ssim, 3),
            **looks,
            "gradient_moved_dn": round(self.gradient_moved_dn, 3),
            "outline_px": None if self.outline_px is None else round(self.outline_px, 2),
            "materials_fitted_on_it": self.fitted_on,
        }


def fit_pictures(
    renderer: Renderer,
    references: Sequence[Reference],
    target: Target,
    *,
    materials: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[FittedPair], dict[str, float]]:
    """Fit the light of every reference, render its pose under that light, and measure both images.

    Parameters
    ----------
    renderer : Renderer
        Renderer.
    references : sequence of Reference
        Images with poses.
    target : Target
        Model of the craft.
    materials : bool, optional
        True to fit the brightness of the materials too, on every second image, and to use it in all images.
    progress : callable, optional
        Receives the number of finished images and the total.

    Returns
    -------
    Pairs of images, and the factor of each material by name, empty without ``materials``.

    Raises
    ------
    UserError
        If the pose of an image is unknown, or the craft is not in the image.
    """
    steps = 2 * len(references)
    bases = []
    for k, reference in enumerate(references):
        bases.append(light_basis(renderer, reference, target))
        if progress is not None:
            progress(k + 1, steps)
    factors = fit_materials(bases[::2], target) if materials else None
    painted = target if factors is None else repainted(target, factors)
    pairs = []
    for k, (reference, basis) in enumerate(zip(references, bases, strict=True)):
        light = fit_light(basis, factors)
        fitted_on = materials and k % 2 == 0
        pairs.append(_pair(renderer, reference, painted, basis, light, fitted_on=fitted_on))
        if progress is not None:
            progress(len(references) + k + 1, steps)
    named = (
        {}
        if factors is None
        else {m.name: round(float(f), 3) for m, f in zip(target.materials, factors, strict=True)}
    )
    return pairs, named


def _pair(
    renderer: Renderer,
    reference: Reference,
    target: Target,
    basis: LightBasis,
    light: FittedLight,
    *,
    fitted_on: bool,
) -> FittedPair:
    scene, detector = basis.scene, basis.scene.sensor.detector
    if detector is not None:
        level = float(np.clip(light.black_dn, 0.0, 200.0))
        scene = replace(scene, sensor=replace(scene.sensor, detector=replace(detector, black_level_dn=level)))
    reference_of = replace(scene.target, sha256=target.sha256)
    scene = replace(scene, lights=light.lights, target=reference_of)
    drawn = renderer.render(scene, target, labels=True)
    image = np.asarray(digitise_scene(scene, expose_scene(scene, drawn.radiance)), np.uint8)
    if drawn.coverage is None:
        raise RuntimeError("the frame was rendered without labels")
    on = drawn.coverage > 0.5
    rows, columns = np.flatnonzero(on.any(axis=1)), np.flatnonzero(on.any(axis=0))
    hull = np.zeros(on.shape, np.uint8)
    cv2.fillConvexPoly(hull, cv2.convexHull(np.argwhere(on)[:, ::-1].astype(np.int32)), 1)
    photograph = reference.image
    gradients = [gradient_histogram(sobel(one)[on]) for one in (photograph, image)]
    return FittedPair(
        reference=reference,
        image=image,
        light=light,
        window=(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1),
        ncc=correlation(photograph[on], image[on]),
        ssim=float(structural_similarity(photograph, image)[on].mean()),
        theirs=_look(photograph, hull > 0),
        ours=_look(image, hull > 0),
        gradient_moved_dn=histogram_distance_dn(gradients[0], gradients[1], MAX_GRADIENT_DN),
        outline_px=_outline_px(photograph, image, on),
        fitted_on=fitted_on,
    )


def _look(image: ByteArray, hull: BoolArray) -> CraftLook:
    height, width = (n // _BLOCK_PX * _BLOCK_PX for n in image.shape)
    blocks = image[:height, :width].reshape(height // _BLOCK_PX, _BLOCK_PX, width // _BLOCK_PX, _BLOCK_PX)
    means, spread = blocks.mean(axis=(1, 3)).ravel(), blocks.std(axis=(1, 3)).ravel()
    darkest = np.argsort(means)[: max(len(means) // 10, 1)]
    return CraftLook(
        dark_dn=float(means[darkest].mean()),
        noise_dn=float(np.median(spread[darkest])),
        clipped=float(np.mean(image[hull] >= CLIPPED_DN)),
    )


def correlation(a: ByteArray, b: ByteArray) -> float:
    """Return the normalised cross-correlation of two sets of values; 0 where one of them is constant."""
    x, y = (np.asarray(v, float).ravel() - np.mean(v) for v in (a, b))
    size = float(np.sqrt((x @ x) * (y @ y)))
    return float(x @ y) / size if size > 0 else 0.0


def structural_similarity(a: ByteArray, b: ByteArray) -> np.typing.NDArray[np.float64]:
    """Return the (H, W) structural similarity of two 8-bit images, with a Gaussian window of 11 pixels.

    References
    ----------
    Wang et al. (2004), Image quality assessment, IEEE Transactions on Image Processing 13(4), equation 13.
    """

    def mean(v: np.typing.NDArray[np.float64]) -> np.typing.NDArray[np.float64]:
        side = (_SSIM_SIDE_PX, _SSIM_SIDE_PX)
        return np.asarray(cv2.GaussianBlur(v, side, _SSIM_SIGMA_PX), np.float64)

    x, y = a.astype(np.float64), b.astype(np.float64)
    mx, my = mean(x), mean(y)
    vx, vy, covariance = mean(x * x) - mx * mx, mean(y * y) - my * my, mean(x * y) - mx * my
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return np.asarray(
        (2 * mx * my + c1) * (2 * covariance + c2) / ((mx * mx + my * my + c1) * (vx + vy + c2))
    )


def _outline_px(photograph: ByteArray, rendering: ByteArray, on: BoolArray) -> float | None:
    """Return the median distance from the rendering's gradient ridges along the outline to the image's ridges [px]."""
    solid, near = np.asarray(on, np.uint8), np.ones((5, 5), np.uint8)
    along = cv2.dilate(solid, near) > cv2.erode(solid, near)
    ridge, edge = _ridges(photograph), _ridges(rendering) & along
    # the craft may be cut off at the border of the image
    edge[[0, 1, -2, -1]] = edge[:, [0, 1, -2, -1]] = False
    if not ridge.any() or not edge.any():
        return None
    distance_px = cv2.distanceTransform(np.asarray(~ridge, np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return float(np.median(distance_px[edge]))


def _ridges(image: ByteArray) -> BoolArray:
    gradient = sobel(np.asarray(cv2.GaussianBlur(image.astype(np.float32), (0, 0), EDGE_BLUR_PX), np.float32))
    largest = cv2.dilate(gradient, np.ones((3, 3), np.uint8))
    return np.asarray((gradient > _EDGE_DN_PX) & (gradient >= largest - 1e-3))


def check_pictures(references: Sequence[Reference], camera: Camera) -> None:
    """Raise if light cannot be fitted to one of the images.

    Raises
    ------
    UserError
        If an image has no pose, is in colour, or has another aspect ratio than the camera.
    """
    without = [one.path.name for one in references if one.pose is None]
    if without:
        raise UserError(f"{len(without)} of {len(references)} images have no pose, for example {without[0]}")
    for path in (one.path for one in references):
        image = read_picture(path)
        height, width = image.shape[:2]
        if abs(width * camera.height_px / (height * camera.width_px) - 1) > SHAPE_WITHIN:
            raise UserError(
                f"image {path} is {width} x {height} pixels, another aspect ratio than the camera's "
                f"{camera.width_px} x {camera.height_px}; name the image's camera with --camera"
            )
        if is_coloured(image):
            raise UserError(f"image {path} is in colour; light is fitted to monochrome images only")
