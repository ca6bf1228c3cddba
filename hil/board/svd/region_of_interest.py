"""Region of interest: a box of the image that may contain the target.

Sharma, Ventura & D'Amico (2018), image processing, WGE: along each axis the box spans the cumulative distribution of
the surviving gradient pixels from 0.025 to 0.975. The Milan thesis enlarges it by 5 % of the mean
edge length.
"""

from __future__ import annotations

from typing import NamedTuple, Tuple

import numpy as np

Array = np.ndarray

# Interval of the marginal distributions that the region spans: Sharma, Ventura & D'Amico (2018).
CDF_INTERVAL = (0.025, 0.975)

MIN_MARGIN_PX = 6.0  # keeps the blurred outline of a small craft inside its grown box

Box = Tuple[float, float, float, float]


class Region(NamedTuple):
    """Candidate extent of the target, in full-resolution pixels, whose centres are at whole numbers.

    Parameters
    ----------
    x0 : float
        Left edge of the box: that of pixel column 0 is at -0.5.
    y0 : float
        Upper edge of the box.
    x1 : float
        Right edge of the box: that of pixel column 0 is at 0.5.
    y1 : float
        Lower edge of the box.
    source : str
        Rule that proposed it.
    """

    x0: float
    y0: float
    x1: float
    y1: float
    source: str

    @property
    def diagonal_px(self) -> float:
        """Length of the diagonal [px]."""
        return float(np.hypot(self.x1 - self.x0, self.y1 - self.y0))

    def grown(self, share: float, width: int, height: int) -> Tuple[int, int, int, int]:
        """Return the pixels of the enlarged box, clipped to an image.

        Each side moves out by ``share`` of the diagonal, but at least `MIN_MARGIN_PX`.

        Returns
        -------
        tuple of int
            Pixels x0, y0, x1, y1, without column x1 and row y1.
        """
        m = max(MIN_MARGIN_PX, share * self.diagonal_px)
        return (
            max(0, int(self.x0 - m)),
            max(0, int(self.y0 - m)),
            min(width, int(np.ceil(self.x1 + m)) + 1),
            min(height, int(np.ceil(self.y1 + m)) + 1),
        )


def overlap(a: Box, b: Box) -> float:
    """Return the intersection over union of two boxes (x0, y0, x1, y1)."""
    w, h = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0.0
    union = (a[2] - a[0]) * (a[3] - a[1]) + (b[2] - b[0]) * (b[3] - b[1]) - w * h
    return float(w * h / max(union, 1e-9))


def marginal_interval(weights: Array, low: float, high: float) -> Tuple[float, float]:
    """Return the indices at which the cumulative sum of ``weights`` passes two fractions of its total."""
    c = np.cumsum(weights.astype(float))
    if c[-1] <= 0:
        return 0.0, float(len(weights) - 1)
    return float(np.searchsorted(c, low * c[-1])), float(np.searchsorted(c, high * c[-1]))


def cdf_box(strong: Array, reduction: int = 1) -> Region:
    """Return the 2.5 % to 97.5 % interval of both marginal CDFs of the surviving gradients, full resolution.

    Parameters
    ----------
    strong : (h, w) array
        True at the pixels that survive weak gradient elimination; without any the region is the whole image.
    reduction : int
        Image pixels per pixel of ``strong``, along each axis.
    """
    x0, x1 = marginal_interval(strong.sum(axis=0), *CDF_INTERVAL)
    y0, y1 = marginal_interval(strong.sum(axis=1), *CDF_INTERVAL)
    f = reduction
    return Region(x0 * f - 0.5, y0 * f - 0.5, (x1 + 1) * f - 0.5, (y1 + 1) * f - 0.5, "wge-cdf")


def crop_of(region: Region, image: Array, margin: float = 0.0) -> Tuple[slice, slice]:
    """Return the rows and columns that a region, enlarged by ``margin`` pixels, touches within the image."""
    h, w = image.shape
    x0, y0 = max(0, int(region.x0 - margin + 0.5)), max(0, int(region.y0 - margin + 0.5))
    x1, y1 = (min(n, int(np.ceil(edge + margin + 0.5))) for n, edge in ((w, region.x1), (h, region.y1)))
    return slice(y0, y1), slice(x0, x1)


def grown_region(region: Region, lines: Array, share: float, shape: Tuple[int, int]) -> Region:
    """Return the region enlarged by a share of the mean length of ``lines``, within the image.

    After the Milan thesis. ``lines`` is (n, 4): the end points x0, y0, x1, y1 [px].
    """
    if not len(lines) or share <= 0:
        return region
    m = share * float(np.hypot(lines[:, 2] - lines[:, 0], lines[:, 3] - lines[:, 1]).mean())
    return Region(
        max(-0.5, region.x0 - m),
        max(-0.5, region.y0 - m),
        min(shape[1] - 0.5, region.x1 + m),
        min(shape[0] - 0.5, region.y1 + m),
        region.source,
    )
