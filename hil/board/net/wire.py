"""Protocol buffers as they lie in a file: the fields of one message, bounded; what an ONNX file is made of."""

from __future__ import annotations

from typing import Dict, Iterator, List, Tuple, Union

Value = Union[int, memoryview]

# Fields of one message; a graph of the largest network here has some hundred nodes.
MOST_FIELDS = 20_000


def fields(data: memoryview) -> Dict[int, List[Value]]:
    """The fields of a message by number, each with its values in order: whole numbers, or bytes of the file.

    Raises
    ------
    ValueError
        If it is no message, or has more than ``MOST_FIELDS`` values.
    """
    found: Dict[int, List[Value]] = {}
    for count, (number, value) in enumerate(_pairs(data)):
        if count >= MOST_FIELDS:
            raise ValueError(f"a message has more than {MOST_FIELDS:,} fields")
        found.setdefault(number, []).append(value)
    return found


def message(values: List[Value]) -> memoryview:
    """The bytes of a field that stands once.

    Raises
    ------
    ValueError
        If it is missing, stands twice, or is a number.
    """
    if len(values) != 1 or isinstance(values[0], int):
        raise ValueError("a field that must stand once does not")
    return values[0]


def text(values: List[Value]) -> str:
    """A field's text, empty where it is missing."""
    return bytes(message(values)).decode("utf-8") if values else ""


def number(values: List[Value], missing: int = 0) -> int:
    """A field's number."""
    if not values:
        return missing
    if not isinstance(values[-1], int):
        raise ValueError("a number is expected")  # noqa: TRY004 - whoever reads the file catches one kind
    return values[-1]


def numbers(values: List[Value]) -> List[int]:
    """A repeated field's numbers, each alone or packed together; negative ones as two's complement of 64 bits."""
    out: List[int] = []
    for value in values:
        if isinstance(value, int):
            out.append(value)
            continue
        at = 0
        while at < len(value):
            if len(out) >= MOST_FIELDS:
                raise ValueError(f"a field has more than {MOST_FIELDS:,} numbers")
            one, at = _varint(value, at)
            out.append(one)
    return [n - (1 << 64) if n >= 1 << 63 else n for n in out]


def _pairs(data: memoryview) -> Iterator[Tuple[int, Value]]:
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind == 0:
            value, at = _varint(data, at)
            yield key >> 3, value
            continue
        if kind == 2:
            size, at = _varint(data, at)
        elif kind in (1, 5):
            size = 8 if kind == 1 else 4
        else:
            raise ValueError("it is damaged")
        if at + size > len(data):
            raise ValueError("it ends too early")
        yield key >> 3, data[at : at + size]
        at += size


def _varint(data: memoryview, at: int) -> Tuple[int, int]:
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(data):
            raise ValueError("it ends too early")
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & ((1 << 64) - 1), at
    raise ValueError("it is damaged")
