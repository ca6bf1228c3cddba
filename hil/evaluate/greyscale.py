"""Conversion of colour images to grey for the estimators."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.hil.board.encoding import light_of, linear_picture

if TYPE_CHECKING:
    from numpy.typing import NDArray

GREY_NOTE = "colour, taken in grey (the mean of the three channels)"
"""Note on a colour image, shown with its pose."""

PLAIN_NOTE = "mono, 8 bits"
"""Description of a linear 8-bit grey image, which needs no note."""


def grey(image: NDArray[np.unsignedinteger], encoding: str = "linear") -> NDArray[np.unsignedinteger]:
    """Return a linear grey image; colour becomes the mean of its linear channels.

    Luma weights of displays would suppress most of the signal of blue and red.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        Image with integer pixels.
    encoding : str, optional
        Transfer function of the pixels.

    Returns
    -------
    (H, W) array
        Grey image of the same type; a linear grey image is returned unchanged.

    Raises
    ------
    ValueError
        If the encoding is unknown, or not defined for this pixel type.
    """
    if image.ndim == 2:
        return linear_picture(image, encoding)
    mean = np.rint(light_of(image, encoding).mean(axis=2, dtype=np.float32))
    return np.ascontiguousarray(mean.astype(image.dtype))


def describe_pictures(image: NDArray[np.unsignedinteger], encoding: str = "linear") -> str:
    """Describe an image: bands, bit depth and the conversion before estimation.

    Returns
    -------
    str
        Phrase such as ``mono, 8 bits``.
    """
    bits = 8 * image.dtype.itemsize
    kind = "mono" if image.ndim == 2 else GREY_NOTE
    scale = "" if bits == 8 else ", full scale taken from the brightest pixel"
    curve = "" if encoding == "linear" else f", linearised from {encoding}"
    return f"{kind}, {bits} bits{scale}{curve}"
