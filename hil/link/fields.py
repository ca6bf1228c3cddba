"""Text, hashes and JSON inside payloads: fixed fields that a C struct can hold."""

from __future__ import annotations

import json
from typing import Any, Dict

from hil.link.errors import PacketError

HASH_BYTES = 32


def pack_text(text: str, size: int) -> bytes:
    """UTF-8, cut at a character's edge to ``size`` bytes; struct pads it with zeros."""
    return text.encode("utf-8")[:size].decode("utf-8", "ignore").encode("utf-8")


def unpack_text(data: bytes) -> str:
    """Text up to the first zero.

    Raises
    ------
    PacketError
        If it is not UTF-8.
    """
    try:
        return data.split(b"\0", 1)[0].decode("utf-8")
    except UnicodeDecodeError as error:
        raise PacketError("a text field is not UTF-8") from error


def pack_hash(digest: str) -> bytes:
    """SHA-256 in hexadecimal as 32 bytes; an empty string (unknown) as zeros."""
    if not digest:
        return bytes(HASH_BYTES)
    try:
        data = bytes.fromhex(digest)
    except ValueError as error:
        raise PacketError(f"a model hash must be hexadecimal, got {digest!r}") from error
    if len(data) != HASH_BYTES:
        raise PacketError(f"a model hash must be {2 * HASH_BYTES} hexadecimal digits, got {len(digest)}")
    return data


def unpack_hash(data: bytes) -> str:
    """Hexadecimal digits, or an empty string for zeros."""
    return data.hex() if any(data) else ""


def pack_json(value: Dict[str, Any]) -> bytes:
    """Compact UTF-8 JSON; NaN has no place in it.

    Raises
    ------
    PacketError
        If ``value`` is not JSON.
    """
    try:
        return json.dumps(value, separators=(",", ":"), sort_keys=True, allow_nan=False).encode("utf-8")
    except (TypeError, ValueError) as error:
        raise PacketError(f"a JSON payload cannot be written: {error}") from error


def unpack_json(data: bytes) -> Dict[str, Any]:
    """A JSON object.

    Raises
    ------
    PacketError
        If the bytes are something else.
    """
    try:
        value = json.loads(data.decode("utf-8"))
    except ValueError as error:
        raise PacketError(f"a JSON payload cannot be read: {error}") from error
    if not isinstance(value, dict):
        raise PacketError("a JSON payload is not an object")
    return value
