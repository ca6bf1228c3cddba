"""Pictures and layers that would take more memory than any camera's are refused by what their heads say."""

import os
import struct
import zlib

import cv2
import numpy as np
import pytest

from flyaround.simulator.dataset.formats import exr
from flyaround.simulator.dataset.formats.exr import encode_exr, read_exr
from flyaround.simulator.dataset.formats.native import decode_png, encode_png, read_png
from flyaround.simulator.errors import UserError


def png_that_says(width, height):
    """A PNG's head of a size, with hardly anything behind it."""
    out = b"\x89PNG\r\n\x1a\n"
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    for kind, data in ((b"IHDR", head), (b"IDAT", zlib.compress(bytes(100))), (b"IEND", b"")):
        out += struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return out


@pytest.mark.parametrize("size", [(16_385, 16), (16, 16_385), (30_000, 30_000), (2**31 - 1, 2**31 - 1)])
def test_a_png_of_more_pixels_than_a_camera_has_is_not_decoded(tmp_path, size, monkeypatch):
    monkeypatch.setattr(cv2, "imdecode", None)
    monkeypatch.setattr(cv2, "imread", None)
    path = tmp_path / "large.png"
    path.write_bytes(png_that_says(*size))
    with pytest.raises(UserError, match=rf"large.png has {size[0]:,} x {size[1]:,} pixels, and at most"):
        read_png(path)


@pytest.mark.parametrize("data", [b"", b"\x89PNG\r\n\x1a\n", b"\x89PNG\r\n\x1a\n" + bytes(40), b"text" * 20])
def test_what_is_no_picture_is_one_sentence(tmp_path, data):
    path = tmp_path / "odd.png"
    path.write_bytes(data)
    with pytest.raises(UserError, match="it is missing or not a PNG"):
        read_png(path)


def test_a_picture_that_is_a_pipe_is_one_sentence(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    with pytest.raises(UserError, match="is a pipe or a device"):
        read_png(tmp_path / "pipe.png")


@pytest.mark.parametrize("ending", [".png", ".bmp", ".tif"])
@pytest.mark.parametrize("shape", [(20, 30), (20, 30, 3)])
def test_pictures_of_other_kinds_are_read_as_before(tmp_path, ending, shape):
    image = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    path = tmp_path / f"picture{ending}"
    cv2.imwrite(str(path), image if image.ndim == 2 else image[..., ::-1])
    assert np.array_equal(read_png(path), image)
    deep = image.astype(np.uint16) * 256
    path.write_bytes(encode_png(deep))
    assert np.array_equal(read_png(path), deep)


@pytest.mark.parametrize("kind", [".jpg", ".tif", ".bmp"])
def test_another_format_named_png_is_refused(tmp_path, kind):
    """Its pixels need not be those of the truth record, as a JPEG's are not."""
    data = cv2.imencode(kind, np.full((20, 30), 90, np.uint8))[1].tobytes()
    path = tmp_path / "000000.png"
    path.write_bytes(data)
    for read in (lambda: read_png(path), lambda: decode_png(data, "000000.png")):
        with pytest.raises(UserError, match=r"000000\.png; it is missing or not a PNG"):
            read()


def test_a_layer_of_more_pixels_or_channels_than_a_camera_gives_is_not_decoded(tmp_path, monkeypatch):
    path = tmp_path / "depth.exr"
    path.write_bytes(encode_exr(("Z",), np.zeros((8, 40), np.float32)))
    assert read_exr(path, ("Z",)).shape == (8, 40)
    monkeypatch.setattr(exr, "MAX_SIDE_PX", 39)
    with pytest.raises(UserError, match="has 40 x 8 pixels of 1 channels, and at most 39 x 39"):
        read_exr(path, ("Z",))
    monkeypatch.undo()
    path.write_bytes(encode_exr(tuple("ABCDE"), np.zeros((8, 40, 5), np.float32)))
    with pytest.raises(UserError, match="of 5 channels"):
        read_exr(path, ("A",))
