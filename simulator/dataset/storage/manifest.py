"""``manifest.sha256``: the hash of every file of the native layout, for ``sha256sum -c`` and for resuming.

A frame's lines are written before its files are renamed to their final names, so every complete frame is listed. After
an interruption the last lines may name missing files; resuming removes them. The line of a frame's record comes last.
"""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from flyaround.simulator.dataset.storage.store import Files, Store

MANIFEST_NAME = "manifest.sha256"

# Maximum size of an accepted manifest [bytes].
MAX_BYTES = 2**32
_LINE = re.compile(r"([0-9a-f]{64})  (images/(\d{6,8})\.[\w.]+)")


def file_hash(data: bytes) -> str:
    """Return the SHA-256 of a file's bytes."""
    return hashlib.sha256(data).hexdigest()


def manifest_lines(files: Files) -> bytes:
    """Return the manifest lines of ``files``, in their order."""
    return _text((name, file_hash(data)) for name, data in files)


def read_manifest(store: Store) -> dict[int, dict[str, str]]:
    """Return the hashes by frame number and file name; empty without a manifest.

    If a name is listed twice, its last line applies. An incomplete last line, left by a loss of power, is ignored.

    Raises
    ------
    UserError
        If it cannot be read.
    """
    if not store.exists(MANIFEST_NAME):
        return {}
    try:
        text = store.read(MANIFEST_NAME, MAX_BYTES).decode("ascii", "replace")
    except OSError as error:
        raise UserError(
            f"{store.title}: cannot read {MANIFEST_NAME} ({error.strerror or error}); remove it, and --resume looks at "
            "every image instead"
        ) from error
    frames: dict[int, dict[str, str]] = {}
    for line in text.splitlines():
        match = _LINE.fullmatch(line)
        if match:
            frames.setdefault(int(match[3]), {})[match[2]] = match[1]
    return frames


def rewrite_manifest(store: Store, frames: Mapping[int, Mapping[str, str]]) -> None:
    """Replace the manifest by one that lists only ``frames``, in the order of their numbers."""
    text = b"".join(_text(frames[k].items()) for k in sorted(frames))
    store.write([(MANIFEST_NAME, text)])


def sort_manifest(store: Store) -> None:
    """Sort the manifest of a finished data set by frame, so that a resumed set equals an uninterrupted one."""
    frames = read_manifest(store)
    if list(frames) != sorted(frames):
        rewrite_manifest(store, frames)


def _text(pairs: Iterable[tuple[str, str]]) -> bytes:
    return "".join(f"{digest}  {name}\n" for name, digest in pairs).encode()
