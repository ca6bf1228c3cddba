"""The prebuilt cache: entries that are slow to make and the same for everyone, shipped under their cache names.

A first start reads them instead of making them. An entry's name hashes its inputs and the source of its maker, so a
change never meets an old file; `python -m tools.prebuilt` rebuilds ``assets/prebuilt``.
"""

from __future__ import annotations

import io
import logging
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np
import zstandard

if TYPE_CHECKING:
    from collections.abc import Iterator
    from importlib.resources.abc import Traversable

    from numpy.typing import NDArray

SUFFIX = ".zst"
log = logging.getLogger(__name__)
_ignore_prebuilt: ContextVar[bool] = ContextVar("_ignore_prebuilt", default=False)


@contextmanager
def without_prebuilt() -> Iterator[None]:
    """Hide the prebuilt entries from this thread, to make or test them."""
    token = _ignore_prebuilt.set(True)
    try:
        yield
    finally:
        _ignore_prebuilt.reset(token)


def is_prebuilt(name: str) -> bool:
    """Return True if an entry is shipped; it may be damaged."""
    return not _ignore_prebuilt.get() and _file(name).is_file()


def prebuilt_array(key: str) -> NDArray[np.generic] | None:
    """Return the shipped array of a cache key.

    Returns
    -------
    array or None
        Array in memory; None if it is missing or damaged, or hidden by `without_prebuilt`.
    """
    if _ignore_prebuilt.get():
        return None
    name = f"{key}.npy"
    try:
        compressed = _file(name).read_bytes()
    except OSError:
        return None
    try:
        data = zstandard.decompress(compressed)
        array: NDArray[np.generic] = np.load(io.BytesIO(data), allow_pickle=False)
    except (zstandard.ZstdError, MemoryError, ValueError, EOFError) as error:
        log.warning("assets/prebuilt/%s%s is damaged (%s); it is computed again", name, SUFFIX, error)
        return None
    return array


def _file(name: str) -> Traversable:
    return resources.files("flyaround.assets").joinpath("prebuilt", name + SUFFIX)
