"""Texts changed at random, as accidents and attackers change them: for tests that read thousands of them."""

import json

NASTY_VALUES = (
    None, True, False, 0, -1, 1, 2**31, 2**63, -(2**63), 10**400, 0.0, -0.0, 1e-320, 1e308, -1e308,
    "", "x", "nan", "\u0000", "../../etc/passwd", "/dev/zero", "[" * 50, "a" * 5000,
    [], {}, [[]], [None], [1, 2, 3], {"a": 1},
)  # fmt: skip
NASTY_TEXTS = (
    b"", b"nan", b"inf", b"-1", b"1e999", b"9" * 5000, b"[" * 3000, b"{" * 3000, b"[[", b"]]", b"}", b'"', b"'",
    b"\\", b"\n", b"\0", b"\xff\xfe", b"a." * 500, b"= = =", b"null", b"true", b"2026-99-99", b"&a [*a]", b"*b",
    b"!!python/none", b"%YAML 9", b"\t", b":", b"- ", b"#", b"0x", b"1_", b"\xef\xbb\xbf", b"!!binary x", b"? ",
    b"1:99:99", b"<<: ",
)  # fmt: skip


def changed_text(text, rng):
    """Bytes with one to four places cut, doubled, flipped, exchanged, or filled with what trips a parser."""
    data = bytearray(text)
    for _ in range(int(rng.integers(1, 5))):
        at = int(rng.integers(0, len(data) + 1))
        end = min(len(data), at + int(rng.integers(0, 40)))
        kind = int(rng.integers(6))
        if kind == 0:
            del data[at:end]
        elif kind == 1 and data:
            data[at % len(data)] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            data[at:at] = data[at:end]
        elif kind == 3:
            data[at:end] = NASTY_TEXTS[int(rng.integers(len(NASTY_TEXTS)))]
        elif kind == 4:
            lines = bytes(data).split(b"\n")
            k = int(rng.integers(len(lines)))
            lines[k] = lines[int(rng.integers(len(lines)))]
            data = bytearray(b"\n".join(lines))
        else:
            words = _numbers_in(data)
            if words:
                first, last = words[int(rng.integers(len(words)))]
                value = NASTY_VALUES[int(rng.integers(len(NASTY_VALUES)))]
                data[first:last] = str(value).encode("utf-8", "replace")
    return bytes(data) if rng.integers(40) else bytes(data[: int(rng.integers(len(data) + 1))])


def changed_json(document, rng):
    """A document of JSON with one to three values exchanged for others, left out, or doubled."""
    copy = json.loads(json.dumps(document))
    for _ in range(int(rng.integers(1, 4))):
        holder, key = _somewhere(copy, rng)
        kind = int(rng.integers(5))
        if kind == 0:
            del holder[key]
        elif kind == 1 and isinstance(holder, list):
            holder.append(holder[key])
        elif kind == 2 and isinstance(holder[key], (int, float)) and not isinstance(holder[key], bool):
            holder[key] = min(holder[key], 1e300) * float(rng.choice([-1, 0, 1e-6, 0.5, 3, 1e3, 1e9]))
        else:
            holder[key] = NASTY_VALUES[int(rng.integers(len(NASTY_VALUES)))]
    return json.dumps(copy).encode()


def _somewhere(node, rng):
    """A table or list within a document, and a key or index of it."""
    while True:
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        key = keys[int(rng.integers(len(keys)))]
        inner = node[key]
        if not isinstance(inner, (dict, list)) or not inner or rng.integers(4) == 0:
            return node, key
        node = inner


def _numbers_in(data):
    found, first = [], None
    for k, byte in enumerate(data):
        is_part = chr(byte) in "0123456789.-+e"
        if is_part and first is None:
            first = k
        elif not is_part and first is not None:
            found.append((first, k))
            first = None
    return found
