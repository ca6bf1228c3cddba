"""Colour pictures for estimators that look at brightness alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.board.encoding import light_of, linear_picture

if TYPE_CHECKING:
    from numpy.typing import NDArray

GREY_NOTE = "colour, taken in grey (the mean of the three channels)"
"""What is said of a colour picture to whom its pose is told."""

PLAIN = "mono, 8 bits"
"""A picture of which nothing need be said."""


def grey(image: NDArray[np.unsignedinteger], encoding: str = "linear") -> NDArray[np.unsignedinteger]:
    """A picture as estimators take it: linear, and colour as the mean of its channels, the panchromatic band.

    The mean is that of light, so no display weights: they would drop most of what blue and red have seen.

    Parameters
    ----------
    image : (H, W) or (H, W, 3), whole numbers. encoding : transfer function of its numbers.

    Returns
    -------
    (H, W) of the same type; a linear grey picture comes back as it is.

    Raises
    ------
    ValueError
        If the encoding is unknown, or the picture has other pixels than it is defined for.
    """
    if image.ndim == 2:
        return linear_picture(image, encoding)
    mean = np.rint(light_of(image, encoding).mean(axis=2, dtype=np.float32))
    return np.ascontiguousarray(mean.astype(image.dtype))


def about_pictures(image: NDArray[np.unsignedinteger], encoding: str = "linear") -> str:
    """What kind of picture it is, in words: bands, bits of the file, and what is done before it is looked at."""
    bits = 8 * image.dtype.itemsize
    kind = "mono" if image.ndim == 2 else GREY_NOTE
    scale = "" if bits == 8 else ", full scale is its brightest pixel"
    curve = "" if encoding == "linear" else f", {encoding} numbers made linear"
    return f"{kind}, {bits} bits{scale}{curve}"
