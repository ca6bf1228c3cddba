"""Time code in a corner of an image: frame number and time with a checksum, readable from the pixels.

The block is 18 x 10 square cells. Its first row and first column are white and the rest of its rim is black, which
gives the reference levels. Inside, row by row, are 128 bits, most significant first, white for 1: frame number (32),
nanoseconds since 1970-01-01 UTC (64), CRC-32 of these twelve bytes (32, as in zlib). All numbers are big-endian.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Cells of the code, without its border.
COLUMNS, ROWS = 16, 8

# Cells of the code, with a border of one cell.
BLOCK_COLUMNS, BLOCK_ROWS = COLUMNS + 2, ROWS + 2
PAYLOAD = struct.Struct(">IQ")
CHECK = struct.Struct(">I")

MIN_CONTRAST = 8.0
"""Minimum difference between the rim's levels for a code to be detected [DN]."""


@dataclass(frozen=True)
class CornerCode:
    """Contents of the time code.

    Parameters
    ----------
    frame_id : int
        Frame number, below 2**32.
    time_ns : int
        Nanoseconds since 1970-01-01 UTC, below 2**64.

    Raises
    ------
    ValueError
        If a number does not fit its bits.
    """

    frame_id: int
    time_ns: int

    def __post_init__(self) -> None:
        for name, number, bits in (("frame number", self.frame_id, 32), ("time [ns]", self.time_ns, 64)):
            if not 0 <= number < 2**bits:
                raise ValueError(f"the code's {name} {number} is outside 0 to 2**{bits} - 1")


@dataclass(frozen=True)
class CodePlace:
    """Position of the time code in an image.

    Parameters
    ----------
    left_px : int, optional
        First column of the block.
    top_px : int, optional
        First row of the block.
    cell_px : int, optional
        Width and height of a cell.
    """

    left_px: int = 0
    top_px: int = 0
    cell_px: int = 6

    @property
    def box_px(self) -> tuple[int, int, int, int]:
        """Bounds of the block, ends excluded: left, top, right, bottom."""
        right, bottom = self.left_px + BLOCK_COLUMNS * self.cell_px, self.top_px + BLOCK_ROWS * self.cell_px
        return self.left_px, self.top_px, right, bottom

    def fits(self, height_px: int, width_px: int) -> bool:
        """Return True if the block lies inside an image of that size.

        Returns
        -------
        bool
            True if every cell, the rim included, is inside.
        """
        left, top, right, bottom = self.box_px
        return left >= 0 and top >= 0 and right <= width_px and bottom <= height_px


def code_cells(code: CornerCode) -> NDArray[np.bool_]:
    """Return the cells (10, 18) of a code's block, True for white."""
    payload = PAYLOAD.pack(code.frame_id, code.time_ns)
    bits = np.unpackbits(np.frombuffer(payload + CHECK.pack(zlib.crc32(payload)), np.uint8))
    cells = np.zeros((BLOCK_ROWS, BLOCK_COLUMNS), bool)
    cells[0, :] = True
    cells[:, 0] = True
    cells[1:-1, 1:-1] = bits.reshape(ROWS, COLUMNS)
    return cells


def draw_code(
    image: NDArray[np.unsignedinteger], code: CornerCode, place: CodePlace, white_dn: int
) -> NDArray[np.unsignedinteger]:
    """Return a copy of an image with the time code drawn into it.

    Parameters
    ----------
    image : (H, W) or (H, W, 3) array
        Digital numbers.
    code : CornerCode
        Frame number and time to draw.
    place : CodePlace
        Position of the code.
    white_dn : int
        Digital number of white; black is 0.

    Returns
    -------
    array
        Copy of the image's shape and type.

    Raises
    ------
    ValueError
        If the block does not lie inside the image.
    """
    if not place.fits(image.shape[0], image.shape[1]):
        raise ValueError(
            f"a code at {place.box_px} does not fit an image of {image.shape[1]} x {image.shape[0]}"
        )
    left, top, right, bottom = place.box_px
    output = image.copy()
    block = np.kron(code_cells(code), np.ones((place.cell_px, place.cell_px), bool))
    levels = np.where(block, white_dn, 0).astype(image.dtype)
    output[top:bottom, left:right] = levels if image.ndim == 2 else levels[..., None]
    return output


def read_code(image: NDArray[Any], place: CodePlace) -> CornerCode | None:
    """Read the code in an image.

    Each cell is compared, by the mean of its middle half, with the mean of the rim's white and black levels.

    Returns
    -------
    CornerCode or None
        Frame number and time. None if the block does not fit the image, has too little contrast, or its check fails.
    """
    if not place.fits(image.shape[0], image.shape[1]):
        return None
    left, top, right, bottom = place.box_px
    grey = image[top:bottom, left:right].astype(np.float64)
    if grey.ndim == 3:
        grey = grey.mean(axis=2)
    cells = grey.reshape(BLOCK_ROWS, place.cell_px, BLOCK_COLUMNS, place.cell_px)
    margin = place.cell_px // 4
    inner = slice(margin, place.cell_px - margin)
    levels = cells[:, inner, :, inner].mean(axis=(1, 3))
    white = np.concatenate((levels[0, 1:-1], levels[1:-1, 0])).mean()
    black = np.concatenate((levels[-1, 1:-1], levels[1:-1, -1])).mean()
    if white - black < MIN_CONTRAST:
        return None
    bits = levels[1:-1, 1:-1] > (white + black) / 2
    data = np.packbits(bits.ravel()).tobytes()
    payload, check = data[: PAYLOAD.size], data[PAYLOAD.size :]
    if CHECK.unpack(check)[0] != zlib.crc32(payload):
        return None
    return CornerCode(*PAYLOAD.unpack(payload))
