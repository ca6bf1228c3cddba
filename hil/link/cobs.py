"""Consistent Overhead Byte Stuffing in pure Python: bytes without a zero, so that zero can delimit.

Reference: Cheshire and Baker (1999), Consistent Overhead Byte Stuffing, IEEE/ACM Trans. Networking 7(2).
"""

from __future__ import annotations

from hil.link.errors import PacketError


def encode(data: bytes) -> bytes:
    """``data`` stuffed: no zero byte in it, at most one byte in 254 longer (and one more)."""
    out = bytearray()
    runs = data.split(b"\0")
    last = len(runs) - 1
    for k, run in enumerate(runs):
        start, size = 0, len(run)
        while size - start >= 254:
            out.append(0xFF)
            out += run[start : start + 254]
            start += 254
        # a full block says "no zero follows"; at the very end there is none to announce
        if k < last or start < size or size == 0:
            out.append(size - start + 1)
            out += run[start:]
    return bytes(out)


def decode(data: bytes) -> bytes:
    """The bytes that were stuffed.

    Raises
    ------
    PacketError
        If ``data`` holds a zero or ends inside a block.
    """
    if not data or 0 in data:
        raise PacketError("a COBS frame is empty or holds a zero byte: the line damaged it")
    out = bytearray()
    i, n = 0, len(data)
    while i < n:
        code = data[i]
        end = i + code
        if end > n:
            raise PacketError("a COBS frame ends inside a block: the line lost some bytes")
        out += data[i + 1 : end]
        i = end
        if code < 0xFF and i < n:
            out.append(0)
    return bytes(out)
