"""Half-precision weights of an ONNX file in single precision, which OpenCV 4.6 (Debian 12) needs.

Only the protocol-buffer fields on the way to the weights are interpreted; all others are copied. Field numbers and data
types are those of onnx.proto (https://github.com/onnx/onnx).
"""

from __future__ import annotations

from typing import Callable, Dict, Iterator, Tuple

import numpy as np

# Fields: ModelProto.graph, GraphProto.initializer, TensorProto.data_type and raw_data.
GRAPH, INITIALIZER, DATA_TYPE, RAW_DATA = 7, 5, 2, 9

# TensorProto.DataType of half and single precision.
FLOAT16, FLOAT = 10, 1

# Wire types of Protocol Buffers: an integer of variable length, and bytes after their number.
VARINT, BYTES = 0, 2


def in_single_precision(model: bytes) -> bytes:
    """Return an ONNX file whose half-precision weights, stored as raw data, are in single precision.

    Raises
    ------
    ValueError
        If the file is not one of weights and operators as ``torch.onnx`` writes them.
    """
    return _replaced(model, {GRAPH: lambda graph: _replaced(graph, {INITIALIZER: _tensor})})


def _tensor(data: bytes) -> bytes:
    """Return a tensor in single precision, if it is in half precision."""
    if not any(field == DATA_TYPE and value == FLOAT16 for field, _, value, _ in _fields(data)):
        return data
    out = b""
    for field, _, value, raw in _fields(data):
        if field == DATA_TYPE:
            out += _varint(DATA_TYPE << 3 | VARINT) + _varint(FLOAT)
        elif field == RAW_DATA and isinstance(value, bytes):
            out += _encoded(RAW_DATA, np.frombuffer(value, "<f2").astype("<f4").tobytes())
        else:
            out += raw
    return out


def _replaced(message: bytes, rules: Dict[int, Callable[[bytes], bytes]]) -> bytes:
    """Return a message with some of its embedded messages replaced."""
    return b"".join(
        _encoded(field, rules[field](value)) if field in rules and isinstance(value, bytes) else raw
        for field, _, value, raw in _fields(message)
    )


def _fields(message: bytes) -> Iterator[Tuple[int, int, object, bytes]]:
    """Iterate over (number, wire type, value, encoded field)."""
    at = 0
    while at < len(message):
        start = at
        key, at = _read_varint(message, at)
        kind = key & 7
        value: object = None
        if kind == VARINT:
            value, at = _read_varint(message, at)
        elif kind == BYTES:
            size, at = _read_varint(message, at)
            value, at = message[at : at + size], at + size
        elif kind in (1, 5):
            at += 8 if kind == 1 else 4
        else:
            raise ValueError("not an ONNX file: a field of an unknown type")
        if at > len(message):
            raise ValueError("not an ONNX file: it ends within a field")
        yield key >> 3, kind, value, message[start:at]


def _read_varint(data: bytes, at: int) -> Tuple[int, int]:
    value = shift = 0
    while at < len(data) and shift < 64:
        byte = data[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at
    raise ValueError("not an ONNX file: a number does not end")


def _varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def _encoded(field: int, value: bytes) -> bytes:
    return _varint(field << 3 | BYTES) + _varint(len(value)) + value
