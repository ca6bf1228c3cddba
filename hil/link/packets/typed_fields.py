"""Optional typed fields (tag, length, value) after the fixed part of FRAME_HEADER and POSE."""

from __future__ import annotations

import math
import struct
from typing import Dict, Iterable, Mapping, Optional, Sequence, Tuple

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.enums import FieldTag, Transfer
from flyaround.hil.link.packets.fields import known_value

MAX_FIELDS_BYTES = 1024
"""Largest total size of one packet's fields, unknown ones included [bytes]."""

# Tolerance of a direction's length, as for a quaternion
DIRECTION_TOLERANCE = 1e-3

# Number of independent elements of a symmetric 6 x 6 matrix.
COVARIANCE_NUMBERS = 21

_HEAD = struct.Struct("<HH")
_DIRECTION = struct.Struct("<3d")
_COVARIANCE = struct.Struct(f"<{COVARIANCE_NUMBERS}f")
# Positions of the diagonal in the upper triangle of a 6 x 6 matrix, row by row
_DIAGONAL = (0, 6, 11, 15, 18, 20)

FRAME_FIELDS = {FieldTag.SUN_CAMERA: _DIRECTION.size, FieldTag.TRANSFER: 1}
"""Fields of FRAME_HEADER, with the size of each value."""

POSE_FIELDS = {FieldTag.COVARIANCE: _COVARIANCE.size}
"""Fields of POSE, with the size of each value."""


def pack_fields(values: Iterable[Tuple[FieldTag, Optional[bytes]]]) -> bytes:
    """Return the concatenated fields, without those whose value is None."""
    return b"".join(_HEAD.pack(tag, len(value)) + value for tag, value in values if value is not None)


def unpack_fields(data: bytes, sizes: Mapping[FieldTag, int], name: str) -> Dict[int, bytes]:
    """Return the values of the known fields by their tags; unknown tags are skipped by their length.

    Parameters
    ----------
    data : bytes
        Bytes after the fixed part of the payload.
    sizes : mapping
        Size of each value, by tag.
    name : str
        Name of the packet type, for messages.

    Raises
    ------
    PacketError
        If a field is truncated, repeated or has another length, or the total exceeds ``MAX_FIELDS_BYTES``.
    """
    if len(data) > MAX_FIELDS_BYTES:
        raise PacketError(
            f"the fields of a {name} take {len(data)} bytes: at most {MAX_FIELDS_BYTES} are read"
        )
    values: Dict[int, bytes] = {}
    offset = 0
    while offset < len(data):
        if len(data) - offset < _HEAD.size:
            raise PacketError(f"a {name} ends within a field, after {len(data) - offset} of its bytes")
        tag, size = _HEAD.unpack_from(data, offset)
        offset += _HEAD.size
        if size > len(data) - offset:
            raise PacketError(f"field {tag} of a {name} has {len(data) - offset} bytes left, expected {size}")
        if tag in values:
            raise PacketError(f"field {tag} of a {name} is repeated: send it once")
        expected = {int(k): n for k, n in sizes.items()}.get(tag, size)
        if size != expected:
            raise PacketError(f"field {tag} of a {name} has {size} bytes, expected {expected}")
        values[tag] = data[offset : offset + size]
        offset += size
    return {tag: value for tag, value in values.items() if tag in set(sizes)}


def pack_direction(direction: Optional[Sequence[float]]) -> Optional[bytes]:
    """Return a unit vector as bytes; None stays None.

    Raises
    ------
    PacketError
        If its length is not 1.
    """
    if direction is None:
        return None
    _check_direction(direction)
    return _DIRECTION.pack(*direction)


def unpack_direction(data: Optional[bytes]) -> Optional[Tuple[float, float, float]]:
    """Return a unit vector from bytes; None stays None.

    Raises
    ------
    PacketError
        If its length is not 1.
    """
    if data is None:
        return None
    x, y, z = _DIRECTION.unpack(data)
    _check_direction((x, y, z))
    return x, y, z


def pack_transfer(transfer: Transfer) -> Optional[bytes]:
    """Return the transfer function of the pixels as a byte; None for linear pixels."""
    return None if transfer == Transfer.LINEAR else bytes([transfer])


def unpack_transfer(data: Optional[bytes]) -> Transfer:
    """Return the transfer function of the pixels; linear if it is absent."""
    return Transfer.LINEAR if data is None else known_value(Transfer, data[0], "transfer function of pixels")


def pack_covariance(triangle: Optional[Sequence[float]]) -> Optional[bytes]:
    """Return the upper triangle of a 6 x 6 covariance as bytes; None stays None.

    Raises
    ------
    PacketError
        If it is not a covariance in single precision.
    """
    if triangle is None:
        return None
    try:
        data = _COVARIANCE.pack(*triangle)
    except (OverflowError, struct.error) as error:
        raise PacketError(f"the covariance of a POSE cannot be sent: {error}") from error
    _check_covariance(_COVARIANCE.unpack(data))
    return data


def unpack_covariance(data: Optional[bytes]) -> Optional[Tuple[float, ...]]:
    """Return the upper triangle of a 6 x 6 covariance from bytes; None stays None.

    Raises
    ------
    PacketError
        If it holds non-finite numbers or a negative variance.
    """
    if data is None:
        return None
    triangle = _COVARIANCE.unpack(data)
    _check_covariance(triangle)
    return triangle


def _check_direction(direction: Sequence[float]) -> None:
    length = math.sqrt(sum(x * x for x in direction))
    if not abs(length - 1.0) <= DIRECTION_TOLERANCE:
        raise PacketError(
            f"the direction to the Sun has length {length:.6g}: make it 1 (within {DIRECTION_TOLERANCE:g})"
        )


def _check_covariance(triangle: Sequence[float]) -> None:
    if not all(math.isfinite(x) for x in triangle) or any(triangle[k] < 0.0 for k in _DIAGONAL):
        raise PacketError("the covariance of a POSE holds a negative variance or a non-finite number")
