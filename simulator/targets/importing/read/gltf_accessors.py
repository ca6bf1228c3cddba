"""glTF accessors as arrays: strides, normalised integers, sparse values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


def read_accessor(document: dict[str, Any], buffers: list[bytes], number: int) -> FloatArray:
    """Return (count, width) values of an accessor as float64 (glTF 2.0, 3.6.2); scalars are one column.

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError
        If the document violates glTF.
    """
    accessor = document["accessors"][number]
    width, dtype = WIDTHS[accessor["type"]], np.dtype(COMPONENTS[accessor["componentType"]])
    count = int(accessor["count"])
    if "bufferView" not in accessor and not 0 <= count <= max(map(len, buffers), default=0):
        raise ValueError(f"an accessor without data has {count:,} values, more than its file has bytes")
    if "bufferView" not in accessor:
        values = np.zeros((count, width))
    else:
        start = accessor.get("byteOffset", 0)
        values = _view(document, buffers, accessor["bufferView"], start, dtype, count, width)
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        index_record, value_record = sparse["indices"], sparse["values"]
        kind = np.dtype(COMPONENTS[index_record["componentType"]])
        indices = _view(
            document,
            buffers,
            index_record["bufferView"],
            index_record.get("byteOffset", 0),
            kind,
            sparse["count"],
            1,
        )
        replacements = _view(
            document,
            buffers,
            value_record["bufferView"],
            value_record.get("byteOffset", 0),
            dtype,
            sparse["count"],
            width,
        )
        if len(indices) and not 0 <= indices.min() <= indices.max() < count:
            raise ValueError("a sparse accessor changes values that it has not")
        values[indices[:, 0].astype(np.int64)] = replacements
    if accessor.get("normalized") and dtype.kind in "iu":
        values = np.maximum(values / np.iinfo(dtype).max, -1.0)
    return values


def _view(
    document: dict[str, Any],
    buffers: list[bytes],
    number: int,
    start: int,
    dtype: np.dtype[Any],
    count: int,
    width: int,
) -> FloatArray:
    view = document["bufferViews"][number]
    data = buffers[view["buffer"]]
    begin, item = view.get("byteOffset", 0) + start, width * dtype.itemsize
    stride = view.get("byteStride", item)
    if not all(isinstance(x, int) for x in (begin, count, stride)):
        raise TypeError("an accessor's offsets are not whole numbers")
    if (
        begin < 0
        or count < 0
        or stride < item
        or begin + stride * max(count - 1, 0) + item * (count > 0) > len(data)
    ):
        raise ValueError("an accessor runs past the end of its buffer")
    raw = np.ndarray((count, width), dtype, data, begin, (stride, dtype.itemsize))
    return raw.astype(float)
