"""Fields of payloads: fixed C struct layouts, enumerations, text, hashes and JSON."""

from __future__ import annotations

import json
import re
import struct
from functools import partial
from typing import TYPE_CHECKING, Any, Callable, Dict, NamedTuple, Tuple, Type, TypeVar, Union

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.packet import PROTOCOL_VERSION

if TYPE_CHECKING:
    from enum import IntEnum

E = TypeVar("E", bound="IntEnum")

# Size of a SHA-256 hash [bytes].
HASH_BYTES = 32

# Limits of a receiver [bytes]: a camera is a few hundred bytes of JSON, a truth record some ten thousand
MAX_CAMERA_JSON_BYTES = 1 << 16
MAX_TRUTH_JSON_BYTES = 1 << 20
# Longest reason or error text that is sent or kept [bytes]
MAX_TEXT_BYTES = 400
# Largest nesting depth of objects and arrays; a truth record has six levels
MAX_JSON_DEPTH = 32

# A string, even unterminated, or a bracket; linear time on any input
_STRING_OR_BRACKET = re.compile(rb'"[^"\\]*(?:\\.?[^"\\]*)*(?:"|\Z)|[\[\]{}]', re.DOTALL)
# Control characters: line ends would break a ledger's rows, escape sequences manipulate a terminal
_CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")


def pack_text(text: str, size: int) -> bytes:
    """Encode text as UTF-8, truncated at a character boundary to ``size`` bytes; struct pads it with zeros."""
    return text.encode("utf-8", "replace")[:size].decode("utf-8", "ignore").encode("utf-8")


def unpack_text(data: bytes) -> str:
    """Decode text up to the first zero, with control characters replaced by spaces.

    Raises
    ------
    PacketError
        If the text is not UTF-8.
    """
    try:
        return _CONTROL.sub(" ", data.split(b"\0", 1)[0].decode("utf-8"))
    except UnicodeDecodeError as error:
        raise PacketError("a text field is not UTF-8") from error


def unpack_sentence(data: bytes) -> str:
    """Decode a text of variable length, truncated like a sent one to ``MAX_TEXT_BYTES``. Raises as `unpack_text`."""
    return pack_text(unpack_text(data), MAX_TEXT_BYTES).decode("utf-8")


def pack_hash(digest: str) -> bytes:
    """Encode a hexadecimal SHA-256 as 32 bytes; an empty string (unknown) as zeros.

    Raises
    ------
    PacketError
        If the text is no hexadecimal SHA-256.
    """
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
    """Decode a hash to hexadecimal digits; zeros give an empty string."""
    return data.hex() if any(data) else ""


def pack_json(value: Dict[str, Any]) -> bytes:
    """Encode an object as compact UTF-8 JSON; NaN is refused.

    Raises
    ------
    PacketError
        If ``value`` is not JSON.
    """
    try:
        return json.dumps(value, separators=(",", ":"), sort_keys=True, allow_nan=False).encode("utf-8")
    except (TypeError, ValueError) as error:
        raise PacketError(f"a JSON payload cannot be written: {error}") from error


def unpack_json(data: bytes, max_bytes: int) -> Dict[str, Any]:
    """Decode a JSON object; its size and depth are checked first.

    Parameters
    ----------
    data : bytes
        UTF-8 text of the object.
    max_bytes : int
        Largest accepted size; nesting deeper than ``MAX_JSON_DEPTH`` is refused as well.

    Raises
    ------
    PacketError
        If the bytes are not such an object.
    """
    if len(data) > max_bytes:
        raise PacketError(f"a JSON payload of {len(data)} bytes is refused: at most {max_bytes} are read")
    if _deeper_than(data, MAX_JSON_DEPTH):
        raise PacketError(f"a JSON payload nested deeper than {MAX_JSON_DEPTH} levels is refused")
    try:
        value = json.loads(data.decode("utf-8"), parse_constant=_no_constant)
    except ValueError as error:
        raise PacketError(f"a JSON payload cannot be read: {error}") from error
    if not isinstance(value, dict):
        raise PacketError("a JSON payload is not an object")
    return value


def _deeper_than(data: bytes, max_depth: int) -> bool:
    depth = 0
    for match in _STRING_OR_BRACKET.finditer(data):
        token = match.group()
        if token in (b"[", b"{"):
            depth += 1
            if depth > max_depth:
                return True
        elif token in (b"]", b"}"):
            depth -= 1
    return False


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")


def unpack_fixed(layout: struct.Struct, data: bytes, name: str, *, tail: bool = False) -> Tuple[Any, ...]:
    """Unpack a payload after checking its length.

    Raises
    ------
    PacketError
        If the payload has another length.
    """
    if len(data) < layout.size or (not tail and len(data) != layout.size):
        raise PacketError(f"a {name} payload has {len(data)} bytes, expected {layout.size}")
    return layout.unpack_from(data)


def known_value(kind: Type[E], value: int, name: str) -> E:
    """Return the enumeration's member.

    Raises
    ------
    PacketError
        If the value is unknown.
    """
    try:
        return kind(value)
    except ValueError as error:
        raise PacketError(f"{name} {value} is unknown to link protocol {PROTOCOL_VERSION}") from error


class WireField(NamedTuple):
    """Field of a fixed layout: its code in `struct`, and the conversions to and from that type.

    Parameters
    ----------
    code : str
        Code of the type in `struct`.
    pack : callable
        Converts an attribute of the message.
    unpack : callable
        Converts a value of the payload; raises PacketError if the protocol does not allow it.
    """

    code: str
    pack: Callable[[Any], Any] = int
    unpack: Callable[[Any], Any] = int


HASH = WireField(f"{HASH_BYTES}s", pack_hash, unpack_hash)
REAL = WireField("d", float, float)


def wire_text(size: int) -> WireField:
    """Return the field of a text of at most ``size`` bytes."""
    return WireField(f"{size}s", partial(pack_text, size=size), unpack_text)


def wire_enum(kind: Type[IntEnum], code: str, name: str) -> WireField:
    """Return the field of an enumeration, named ``name`` in messages about unknown values."""
    return WireField(code, int, partial(known_value, kind, name=name))


class FixedLayout:
    """Fixed-size part of a payload: the fields in their order on the wire, little-endian.

    Parameters
    ----------
    fields : str or WireField
        Fields by the name of the message's attribute; a code of `struct` stands for an integer.
    """

    def __init__(self, **fields: Union[str, WireField]) -> None:
        self._fields = {n: WireField(f) if isinstance(f, str) else f for n, f in fields.items()}
        self._struct = struct.Struct("<" + "".join(f.code for f in self._fields.values()))
        self.size = self._struct.size

    def pack(self, values: Dict[str, Any]) -> bytes:
        """Return the bytes of these values by name; others are ignored."""
        return self._struct.pack(*(f.pack(values[name]) for name, f in self._fields.items()))

    def unpack(self, data: bytes, name: str, *, tail: bool = False) -> Dict[str, Any]:
        """Return the values by name.

        Raises
        ------
        PacketError
            See `unpack_fixed`, or if a value is impossible.
        """
        values = unpack_fixed(self._struct, data, name, tail=tail)
        return {n: f.unpack(v) for (n, f), v in zip(self._fields.items(), values)}  # noqa: B905 - Python 3.9
