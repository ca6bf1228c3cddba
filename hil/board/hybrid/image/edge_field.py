"""Thin edges of an image region by orientation, with the distance to and position of the nearest one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Optional, Tuple

import cv2
import numpy as np

from flyaround.hil.board.hybrid.image.image_region import library_reads, region
from flyaround.hil.board.hybrid.native.library import is_available, library
from flyaround.hil.board.svd.line_streams import remove_specks

Array = np.ndarray

# Number of orientation bins of the nearest-edge tables, 22.5 deg each.
ORIENTATION_BINS = 8

# Hysteresis thresholds of edges [sigma of the gradient's noise].
LOW_SIGMA, HIGH_SIGMA = 3.0, 6.0

# Probability of the craft below which an edge counts as background texture.
MIN_CRAFT_PROBABILITY = 0.08


@dataclass(frozen=True, eq=False)
class NearestEdges:
    """Nearest-edge table of one orientation bin.

    Parameters
    ----------
    distance : (h, w) array
        Distance to the nearest edge, float32 [field px].
    label : (h, w) array
        Index of the nearest edge.
    place : (N + 1, 2) array
        Column and row of each edge [field px].
    """

    distance: Array
    label: Array
    place: Array


@dataclass(frozen=True, eq=False)
class EdgeField:
    """Edges of one region at one scale, with nearest-edge tables by orientation.

    Parameters
    ----------
    x0 : float
        Left edge of the region [image px].
    y0 : float
        Upper edge of the region [image px].
    factor : float
        Image pixels per field pixel.
    mask : (h, w) array
        Mask of thin edges.
    gx : (h, w) array
        Horizontal gradient.
    gy : (h, w) array
        Vertical gradient.
    lit : (h, w) array
        True within two pixels of a pixel brighter than the empty background.
    core : (h, w) array
        Pixels brighter than the empty background, without the rim caused by blur; empty if the background is not empty
        space.
    empty : bool
        True if the background is empty space.
    """

    x0: float
    y0: float
    factor: float
    mask: Array
    gx: Array
    gy: Array
    lit: Array
    core: Array
    empty: bool

    @cached_property
    def direction(self) -> Array:
        """Direction (h, w) of the gradient, -pi..pi, towards the brighter side."""
        return np.arctan2(self.gy, self.gx)

    @cached_property
    def angle(self) -> Array:
        """Orientation (h, w) of the gradient, 0..pi."""
        return np.mod(self.direction, np.pi).astype(np.float32)

    @cached_property
    def tables(self) -> Tuple[NearestEdges, ...]:
        """Nearest-edge tables, one per orientation. Computed on first use; most regions never need them."""
        return nearest_edges(self.mask, self.angle)

    @cached_property
    def distance(self) -> Array:
        """Distance (K, h, w) to the nearest edge of each orientation, float32 [field px]."""
        return np.stack([t.distance for t in self.tables])

    @cached_property
    def nearest(self) -> Array:
        """Position (K, h, w, 2) of that edge, float32 [field px]."""
        return np.stack([np.take(t.place, t.label, axis=0) for t in self.tables])

    def nearest_at(self, flat: Array) -> Array:
        """Return the position (N, 2) of the nearest edge at flat indices (N,) from ``lookup``."""
        channel, pixel = np.divmod(flat, self.mask.size)
        out = np.zeros((len(flat), 2), np.float32)
        for k, t in enumerate(self.tables):
            own = channel == k
            out[own] = t.place[t.label.ravel()[pixel[own]]]
        return out

    def nearest_to(self, flat: Array) -> Tuple[Array, Array]:
        """Return distance (N,) and position (N, 2) of the nearest edge at a few flat indices (N,) from ``lookup``.

        Exact, unlike the distances in the tables, and faster than computing the tables.
        """
        channel, pixel = np.divmod(flat, self.mask.size)
        distance, position = np.full(len(flat), 1e4, np.float32), np.zeros((len(flat), 2), np.float32)
        y, x = np.nonzero(self.mask)
        theta = np.mod(np.arctan2(self.gy[y, x], self.gx[y, x]), np.pi)
        edge = np.stack([x, y], axis=-1).astype(np.float32)
        positions = np.stack(np.divmod(pixel, self.mask.shape[1])[::-1], axis=-1).astype(np.float32)
        for k in range(ORIENTATION_BINS):
            own, near = np.flatnonzero(channel == k), edge[_in_bin(theta, k)]
            if not len(own) or not len(near):
                continue
            squared_distance, down = positions[own, :1] - near[:, 0], positions[own, 1:] - near[:, 1]
            # in place: another allocation would take as long as the arithmetic
            squared_distance *= squared_distance
            down *= down
            squared_distance += down
            best = squared_distance.argmin(axis=1)
            distance[own], position[own] = np.sqrt(squared_distance[np.arange(len(own)), best]), near[best]
        return distance, position

    @property
    def size(self) -> Tuple[int, int]:
        """Width and height [field px]."""
        return self.mask.shape[1], self.mask.shape[0]

    def to_field(self, pixels: Array) -> Array:
        """Convert image pixels (..., 2) to field coordinates."""
        return (pixels - (self.x0, self.y0) + 0.5) / self.factor - 0.5

    def lookup(self, uv: Array, angle: Array) -> Tuple[Array, Array]:
        """Return flat indices into tables (K, h, w), and a mask of the points inside the field.

        Parameters
        ----------
        uv : (..., 2) array
            Field coordinates.
        angle : (...) array
            Orientation of the model edge's normal, 0..pi.
        """
        w, h = self.size
        x = np.rint(uv[..., 0])
        y = np.rint(uv[..., 1])
        inside = (x >= 0) & (x < w) & (y >= 0) & (y < h)
        xi = np.clip(x, 0, w - 1).astype(np.intp)
        yi = np.clip(y, 0, h - 1).astype(np.intp)
        k = np.rint(angle * (ORIENTATION_BINS / np.pi)).astype(np.intp) % ORIENTATION_BINS
        return (k * h + yi) * w + xi, inside


@lru_cache(maxsize=32)
def gradient_noise(blur_px: float) -> float:
    """Return the noise of a gradient component for white image noise of unit variance after the same filters."""
    noise = np.random.default_rng(1).standard_normal((192, 192)).astype(np.float32)
    gx, _ = gradient(noise, blur_px)
    return float(np.std(gx[16:-16, 16:-16]))


def gradient(image: Array, blur_px: float) -> Tuple[Array, Array]:
    """Return the gradient of a blurred float32 image with Scharr's nearly isotropic kernels."""
    blurred = cv2.GaussianBlur(image, (0, 0), blur_px) if blur_px > 0 else image
    return (
        cv2.Scharr(blurred, cv2.CV_32F, 1, 0, scale=1 / 32),
        cv2.Scharr(blurred, cv2.CV_32F, 0, 1, scale=1 / 32),
    )


def shrink(image: Array, x0: int, y0: int, x1: int, y1: int, longest_px: int) -> Tuple[Array, float]:
    """Reduce a region by area averaging to at most ``longest_px``.

    Returns
    -------
    crop : (h, w) array
        Reduced region, float32. If it is not reduced and the image is float32, it shares the image's memory.
    factor : float
        Image pixels per pixel of ``crop`` along the longer side, at least 1.
    """
    crop = image[y0:y1, x0:x1]
    factor = max(1.0, max(crop.shape) / longest_px)
    if factor > 1.0:
        width, height = max(8, round(crop.shape[1] / factor)), max(8, round(crop.shape[0] / factor))
        crop = area_mean(crop, width, height)
    return np.asarray(crop, np.float32), factor


def area_mean(picture: Array, width: int, height: int) -> Array:
    """Return an image reduced by area averaging to (height, width), float32; rounded for integer input.

    Raises
    ------
    MemoryError
        If the library is out of memory.
    """
    smaller = 0 < height <= picture.shape[0] and 0 < width <= picture.shape[1]
    if not (smaller and is_available() and library_reads(picture)):
        # the published methods work without the native library
        return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), np.float32)
    out = np.empty((height, width), np.float32)
    if library().fly_area_average(*region(picture), height, width, out):
        raise MemoryError("out of memory while reducing an image")
    return out


def thin_edges(gx: Array, gy: Array, sigma: float) -> Array:
    """Return Canny edges (h, w); ``sigma`` is the gradient's noise."""
    scale = 8000.0 / max(float(cv2.magnitude(gx, gy).max()), 1e-9)
    mask = cv2.Canny(
        np.clip(gx * scale, -32000, 32000).astype(np.int16),
        np.clip(gy * scale, -32000, 32000).astype(np.int16),
        max(LOW_SIGMA * sigma * scale, 2.0),
        max(HIGH_SIGMA * sigma * scale, 3.0),
        L2gradient=True,
    )
    return np.asarray(mask > 0)


def edge_field(
    image: Array,
    box: Tuple[int, int, int, int],
    noise: float,
    longest_px: int,
    background: float = -1.0,
    craft_probability: Optional[Array] = None,
) -> EdgeField:
    """Return the edges of a region, reduced to ``longest_px``.

    Parameters
    ----------
    image : (H, W) array
        Image.
    box : tuple of int
        Region: x0, y0, x1, y1.
    noise : float
        Standard deviation of the image noise.
    longest_px : int
        Longest side of the reduced region.
    background : float
        Level of empty space; negative if the background is not empty, in which case all pixels count as lit.
    craft_probability : (h, w) array, optional
        Probability of the craft over the whole image: edges far from it count as background texture.

    Returns
    -------
    EdgeField
        Edges of the reduced region, with its gradient and masks; nearest-edge tables are computed on first use.
    """
    x0, y0, x1, y1 = box
    small, factor = shrink(image, x0, y0, x1, y1, longest_px)
    # reduction averages noise and blurs by itself; levels chosen by eye
    blur = 1.0 if factor >= 3 else (1.3 if factor >= 1.8 else 1.7)
    gx, gy = gradient(small, blur)
    # area averaging over factor^2 independent pixels
    sigma = max(noise / factor * gradient_noise(blur), 1e-6)
    mask = thin_edges(gx, gy, sigma)
    if craft_probability is not None:
        mask &= _craft_mask(craft_probability, box, image.shape, mask.shape)
    mask = remove_specks(mask, 5)
    lit, core = np.ones(mask.shape, bool), np.zeros(mask.shape, bool)
    if background >= 0:
        # a Gaussian of b pixels averages over 4 pi b^2 of them
        level = cv2.GaussianBlur(small, (0, 0), blur)
        step = 4.0 * noise / factor / (2 * np.sqrt(np.pi) * blur)
        bright = (level > background + step).astype(np.uint8)
        lit = cv2.dilate(bright, np.ones((5, 5), np.uint8)) > 0
        core = cv2.erode(bright, np.ones((5, 5), np.uint8)) > 0
    return EdgeField(
        x0=float(x0),
        y0=float(y0),
        factor=factor,
        mask=mask,
        gx=gx,
        gy=gy,
        lit=lit,
        core=core,
        empty=background >= 0,
    )


def _craft_mask(
    craft_probability: Array, box: Tuple[int, int, int, int], picture: Tuple[int, ...], field: Tuple[int, ...]
) -> Array:
    """Return a mask of the field's pixels that may show the craft, from a probability map of the whole image."""
    near = cv2.dilate((craft_probability > MIN_CRAFT_PROBABILITY).astype(np.uint8), np.ones((3, 3), np.uint8))
    (H, W), (h, w) = picture[:2], craft_probability.shape
    x = ((np.arange(field[1]) + 0.5) / field[1] * (box[2] - box[0]) + box[0]) * w / W
    y = ((np.arange(field[0]) + 0.5) / field[0] * (box[3] - box[1]) + box[1]) * h / H
    rows, columns = np.clip(y.astype(int), 0, h - 1), np.clip(x.astype(int), 0, w - 1)
    return np.asarray(near[rows[:, None], columns[None]] > 0)


def _in_bin(theta: Array, k: int) -> Array:
    """Return True for orientations (N,) near the ``k``-th bin."""
    step = np.pi / ORIENTATION_BINS
    angle = np.abs(np.mod(theta - k * step + np.pi / 2, np.pi) - np.pi / 2)
    # neighbouring bins overlap: an edge between two counts in both
    return np.asarray(angle < 1.2 * step)


def nearest_edges(mask: Array, angle: Array) -> Tuple[NearestEdges, ...]:
    """Return the nearest-edge table of each orientation."""
    h, w = mask.shape
    edge_index = np.flatnonzero(mask)
    theta = angle.ravel()[edge_index]
    out = []
    for k in range(ORIENTATION_BINS):
        near = edge_index[_in_bin(theta, k)]
        if not len(near):
            far = np.full((h, w), 1e4, np.float32)
            out.append(NearestEdges(far, np.zeros((h, w), np.int32), np.zeros((1, 2), np.float32)))
            continue
        zero = np.full(h * w, 255, np.uint8)
        zero[near] = 0
        distance, label = cv2.distanceTransformWithLabels(
            zero.reshape(h, w), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
        )
        place = np.zeros((len(near) + 1, 2), np.float32)
        place[label.ravel()[near]] = np.stack(np.divmod(near, w)[::-1], axis=-1)
        out.append(NearestEdges(distance, label, place))
    return tuple(out)
