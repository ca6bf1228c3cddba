"""Exported files that would unpack to far more than they hold are refused before that."""

import gzip
import io
import struct
import tarfile
import tracemalloc

import cv2
import numpy as np
import pytest

from flyaround.simulator.dataset.check.export_contents import entries
from flyaround.simulator.errors import UserError

LARGE = 64 << 20


def packed_shard():
    shard = io.BytesIO()
    with tarfile.open(fileobj=shard, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        info = tarfile.TarInfo("0.png")
        info.size = LARGE
        tar.addfile(info, io.BytesIO(bytes(LARGE)))
    return gzip.compress(shard.getvalue())


def sparse_shard():
    """A GNU sparse file of a single hole."""
    info = tarfile.TarInfo("0.png")
    info.type = tarfile.GNUTYPE_SPARSE
    header = bytearray(info.tobuf(tarfile.GNU_FORMAT))
    header[386:410] = b"%011o\0" % LARGE + b"%011o\0" % 0
    header[483:495] = b"%011o\0" % LARGE
    header[148:156] = b" " * 8
    header[148:156] = b"%06o\0 " % sum(header[:512])
    return bytes(header[:512]) + bytes(10240 - 512)


def large_jpeg():
    data = bytearray(cv2.imencode(".jpg", np.zeros((16, 16), np.uint8))[1].tobytes())
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = struct.pack(">HH", 20_000, 20_000)
    return bytes(data)


def test_a_frame_number_of_5000_digits_belongs_to_no_frame():
    assert next(iter(entries("scene_gt.json", b'{"%s": []}' % (b"9" * 5000)))).frame is None


@pytest.mark.parametrize(
    ("name", "make"), [("a.tar", packed_shard), ("a.tar", sparse_shard), ("a.jpg", large_jpeg)]
)
def test_a_file_that_unpacks_to_far_more_is_refused_before_that(name, make):
    data = make()
    tracemalloc.start()
    with pytest.raises(UserError, match="cannot be read"):
        list(entries(name, data))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < LARGE / 4
