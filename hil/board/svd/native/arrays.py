"""Arrays as C takes them: contiguous, of one dtype, and the pointer to the first element."""

from __future__ import annotations

import ctypes
from typing import Any, Callable, Optional, Tuple

import numpy as np

Array = np.ndarray

# Built once: to compare a dtype with a name builds one each time.
DTYPES = {
    kind: np.dtype(kind)
    for kind in ("bool", "uint8", "uint16", "int16", "int32", "int64", "float32", "float64")
}

_FIRST: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer


def contiguous(a: Array, kind: str) -> Array:
    """The array in C order and of this dtype: itself if it is so already, else a copy."""
    return a if a.dtype == DTYPES[kind] and a.flags.c_contiguous else np.ascontiguousarray(a, dtype=kind)


def checked_pointer(a: Array, kind: str, shape: Optional[Tuple[int, ...]] = None) -> int:
    """Address of the first element of a C-contiguous array; the caller keeps the array alive.

    Parameters
    ----------
    kind : its dtype, one of ``DTYPES``. shape : what C takes it for, where that is known.

    Raises
    ------
    ValueError
        If the array is another: C would read beside it.
    """
    if a.dtype != DTYPES[kind] or not a.flags.c_contiguous or (shape is not None and a.shape != shape):
        raise ValueError(f"a kernel takes {kind} {shape or ''}, not {a.dtype} {a.shape}")
    return pointer(a)


def pointer(a: Array) -> int:
    """Address of the first element, unchecked: for an array that the caller has just made."""
    try:
        # a fifth of the time of ``__array_interface__``
        return ctypes.addressof(_FIRST(a))
    except (TypeError, ValueError):
        # read-only, or empty
        return int(a.__array_interface__["data"][0])
