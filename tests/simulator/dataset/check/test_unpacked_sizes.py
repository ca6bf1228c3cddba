"""Exported files that would unpack to far more than they hold are refused before that."""

import contextlib
import gzip
import io
import struct
import tarfile
import tracemalloc

import cv2
import numpy as np
import pytest

from flyaround.simulator.dataset.check import export_contents
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


def shard_of_pages(**column):
    parquet = pytest.importorskip("pyarrow.parquet", reason="format parquet needs pyarrow")
    pyarrow = pytest.importorskip("pyarrow")
    file = io.BytesIO()
    parquet.write_table(pyarrow.table({"number": [0, 1, 2]} | column), file, compression="zstd")
    return file.getvalue()


def large_value():
    return shard_of_pages(image=[bytes(LARGE), b"", None])


def long_list():
    return shard_of_pages(points=[[0.5] * (LARGE // 8), [], None])


def list_of_one_text():
    return shard_of_pages(names=[["a" * 65536] * 1024, [], None])


def value_larger_than_declared():
    """A shard whose metadata declare a tenth of the image, as the headers of its pages do not."""
    parquet = pytest.importorskip("pyarrow.parquet", reason="format parquet needs pyarrow")
    data = large_value()
    column = parquet.ParquetFile(io.BytesIO(data)).metadata.row_group(0).column(1)
    declared, less = varint(2 * column.total_uncompressed_size), varint(2 * (LARGE // 10))
    assert data.count(declared) == 1
    assert len(declared) == len(less)
    return data.replace(declared, less)


def varint(value):
    low, rest = value & 127, value >> 7
    return bytes([low | 128]) + varint(rest) if rest else bytes([low])


@pytest.mark.parametrize("make", [large_value, long_list, list_of_one_text, value_larger_than_declared])
def test_a_shard_of_pages_that_unpacks_to_far_more_is_refused_before_that(make, monkeypatch):
    data = make()
    monkeypatch.setattr(export_contents, "MAX_SHARD_BYTES", LARGE - 1)
    pyarrow = pytest.importorskip("pyarrow")
    before = pyarrow.default_memory_pool().max_memory()
    with pytest.raises(UserError, match="it unpacks to 6"):
        list(entries("a.parquet", data))
    assert pyarrow.default_memory_pool().max_memory() == before


def test_rows_of_a_large_text_that_repeats_are_read_one_at_a_time():
    rows = list(entries("a.parquet", shard_of_pages(text=["a" * (1 << 20)] * 3)))
    assert [len(e.value) for e in rows if e.key.endswith("text")] == [1 << 20] * 3


@pytest.mark.parametrize("seed", range(40))
def test_damaged_pages_are_refused_or_read(seed):
    data = bytearray(shard_of_pages(text=["a", "b", "c"], numbers=[[1.0], [], [2.0]]))
    rng = np.random.default_rng(seed)
    for at in rng.integers(0, len(data) - 8, 6).tolist():
        data[at] = int(rng.integers(256))
    with contextlib.suppress(UserError):
        list(entries("a.parquet", bytes(data)))


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
