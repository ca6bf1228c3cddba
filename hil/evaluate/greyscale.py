"""Colour pictures for estimators that look at brightness alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

GREY_NOTE = "colour, taken in grey (the mean of the three channels)"
"""What is said of a colour picture to whom its pose is told."""

PLAIN = "mono, 8 bits"
"""A picture of which nothing need be said."""


def grey(image: NDArray[np.unsignedinteger]) -> NDArray[np.unsignedinteger]:
    """A colour picture in grey: the mean of its channels, which together are the panchromatic band.

    Digital numbers are linear in radiance, so no display weights: they would drop most of what blue and red have seen.

    Parameters
    ----------
    image : (H, W) or (H, W, 3), whole numbers; the former comes back as it is, the latter as (H, W) of the same type.
    """
    if image.ndim == 2:
        return image
    mean = np.rint(image.mean(axis=2, dtype=np.float32))
    return np.ascontiguousarray(mean.astype(image.dtype))


def about_pictures(image: NDArray[np.unsignedinteger]) -> str:
    """What kind of picture it is, in words: bands, bits of the file, and what is done before it is looked at."""
    bits = 8 * image.dtype.itemsize
    kind = "mono" if image.ndim == 2 else GREY_NOTE
    scale = "" if bits == 8 else ", full scale is its brightest pixel"
    return f"{kind}, {bits} bits{scale}"
