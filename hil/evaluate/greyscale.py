"""Conversion of colour images to grey for the estimators."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.board.encoding import light_of, linear_picture

if TYPE_CHECKING:
    from numpy.typing import NDArray

GREY_NOTE = "colour, taken in grey (the mean of the three channels)"
"""Note on a colour image, shown with its pose."""

PLAIN = "mono, 8 bits"
"""Description of a linear 8-bit grey image, which needs no note."""


def grey(image: NDArray[np.unsignedinteger], encoding: str = "linear") -> NDArray[np.unsignedinteger]:
    """Return a linear grey image; colour becomes the mean of its channels.

    The mean is that of light, so no display weights: they would drop most of what blue and red have seen.

    Parameters
    ----------
    image : (H, W) array
        Or (H, W, 3), whole numbers.
    encoding : str, optional
        Transfer function of its numbers.

    Returns
    -------
    (H, W) of the same type; a linear grey image comes back as it is.

    Raises
    ------
    ValueError
        If the encoding is unknown, or the image has other pixels than it is defined for.
    """
    if image.ndim == 2:
        return linear_picture(image, encoding)
    mean = np.rint(light_of(image, encoding).mean(axis=2, dtype=np.float32))
    return np.ascontiguousarray(mean.astype(image.dtype))


def about_pictures(image: NDArray[np.unsignedinteger], encoding: str = "linear") -> str:
    """Describe an image: bands, bit depth and the conversion before estimation."""
    bits = 8 * image.dtype.itemsize
    kind = "mono" if image.ndim == 2 else GREY_NOTE
    scale = "" if bits == 8 else ", full scale is its brightest pixel"
    curve = "" if encoding == "linear" else f", {encoding} numbers made linear"
    return f"{kind}, {bits} bits{scale}{curve}"
