"""Calibration board: a ChArUco board with its squares as geometry and its markers as a texture.

The plate and the frame are the chessboard's (`craft.chessboard`): origin in the middle of the
face, x right, y up, z out of the face. `charuco_board` is the same pattern as OpenCV knows it, whose object points have
their origin in the upper left corner of the pattern, y down and z into the board; `model_from_opencv_m` turns them into
the model's. Corner ``corner_R_C`` has the ChArUco id ``10 R + C``.

References
----------
Garrido-Jurado et al. (2014), Automatic generation and detection of highly reliable fiducial markers under occlusion,
Pattern Recognition 47(6).
"""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np

from flyaround.simulator.runtime.arrays import BoolArray, FloatArray
from flyaround.simulator.targets.model import Detail, Material, Target, TextureImage
from tools.craft.assemble import Piece
from tools.craft.chessboard import COLUMNS, MATT_WHITE, ROWS, SQUARE_M, board, lines_x_m, lines_y_m, squares
from tools.craft.shapes.mesh import merge

DICTIONARY = cv2.aruco.DICT_4X4_50
MARKER_M = 0.030  # side of a marker
MODULES = 8
"""Modules of 5 mm along a square: six of the marker, its border included, and one of white on either side."""
TEXELS = 24
"""Picture elements along a module: 0.2 mm each."""
INK_SRGB, PAPER_SRGB = 54, 255
"""Ink reflects 0.037 of what the paper does, as much as the dark squares' paint."""

MARKERS = "markers"
PRINTED = Material(
    name="board-markers",
    base_color=MATT_WHITE.base_color,
    roughness=MATT_WHITE.roughness,
    base_color_texture=MARKERS,
)
NOTES = (
    "ChArUco board of OpenCV's dictionary DICT_4X4_50, markers 0 to 43 of 30 mm, 11 x 8 squares of 40 mm. Face at "
    "z = 0, x right, y up. Keypoint corner_R_C is the inner corner of ChArUco id 10 R + C, rows from the top. Levels "
    "of detail are the same."
)


def build_calibration_board(detail: Detail = "full") -> Target:  # noqa: ARG001 (one geometry for all levels)
    """Return the board; every level is the same."""
    tiles = merge(squares(dark=False))
    low, high = np.array([lines_x_m()[0], lines_y_m()[-1]]), np.array([lines_x_m()[-1], lines_y_m()[0]])
    share = np.clip((tiles.positions_m[:, :2] - low) / (high - low), 0, 1)
    uv = np.stack([share[:, 0], 1 - share[:, 1]], axis=1)
    # the sides of the tiles are paper: nothing is printed in the upper left square
    uv[tiles.normals[:, 2] < 0.5] = 0.5 / (COLUMNS * MODULES)
    return board(
        "calibration-board",
        "Calibration board (ChArUco), 11 x 8 squares of 40 mm",
        Piece("squares_light", PRINTED.name, tiles, uv),
        materials=(PRINTED,),
        pictures=(TextureImage(name=MARKERS, data=two_tone_png(_ink(), (INK_SRGB, PAPER_SRGB))),),
        notes=NOTES,
    )


def charuco_board() -> cv2.aruco.CharucoBoard:
    """Return the pattern as OpenCV's detectors take it."""
    return cv2.aruco.CharucoBoard(
        (COLUMNS, ROWS), SQUARE_M, MARKER_M, cv2.aruco.getPredefinedDictionary(DICTIONARY)
    )


def model_from_opencv_m(points_m: FloatArray) -> FloatArray:
    """Return points (..., 3) of OpenCV's board frame in the model frame [m]: half a turn about x, and a new origin."""
    return np.asarray(points_m, float) * (1, -1, -1) + (lines_x_m()[0], lines_y_m()[0], 0)


def _ink() -> BoolArray:
    """Return the (H, W) mask of printed markers; the dark squares are geometry and left white here."""
    pattern = charuco_board()
    dictionary, ink = pattern.getDictionary(), np.zeros((ROWS * MODULES, COLUMNS * MODULES), bool)
    side = round(MARKER_M / SQUARE_M * MODULES)
    for number, corners in zip(np.asarray(pattern.getIds()).ravel(), pattern.getObjPoints(), strict=True):
        x, y = np.rint(np.asarray(corners).min(axis=0)[:2] / SQUARE_M * MODULES).astype(int)
        ink[y : y + side, x : x + side] = (
            cv2.aruco.generateImageMarker(dictionary, int(number), side, borderBits=1) < 128
        )
    return ink.repeat(TEXELS, axis=0).repeat(TEXELS, axis=1)


BLOCK_BYTES = 65_535


def two_tone_png(dark: BoolArray, greys: tuple[int, int]) -> bytes:
    """Return a PNG of one bit per pixel.

    Parameters
    ----------
    dark : BoolArray
        (H, W), True where the first grey is.
    greys : tuple of int
        Dark and light, 0..255 (sRGB).

    Notes
    -----
    The pixels are stored, not compressed: what a compressor makes of them depends on its version, and a target's
    hash must not. PNG specification (W3C 2003), sections 10 and 11; stored blocks of RFC 1951, section 3.2.4.
    """
    height, width = dark.shape
    rows = np.packbits(~np.asarray(dark, bool), axis=1)
    raw = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    blocks = [raw[k : k + BLOCK_BYTES] for k in range(0, len(raw), BLOCK_BYTES)]
    stored = b"".join(
        struct.pack("<BHH", k == len(blocks) - 1, len(b), 0xFFFF - len(b)) + b for k, b in enumerate(blocks)
    )
    palette = bytes(grey for grey in greys for _ in range(3))
    stream = b"\x78\x01" + stored + struct.pack(">I", zlib.adler32(raw))
    return (
        b"\x89PNG\r\n\x1a\n"
        + _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 3, 0, 0, 0))
        + _chunk(b"PLTE", palette)
        + _chunk(b"IDAT", stream)
        + _chunk(b"IEND", b"")
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
