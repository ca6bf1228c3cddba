"""Bounded reading of untrusted files: regular files only, of limited size."""

from __future__ import annotations

import errno
import io
import os
import stat
import zipfile
import zlib
from pathlib import Path
from typing import Dict, Union

import numpy as np


def read_bounded(path: Union[str, Path], max_bytes: int) -> bytes:
    """Read a file. Pipes and devices are refused, because they may block or never end.

    Parameters
    ----------
    path : str or Path
        Path of the file.
    max_bytes : int
        Largest size that is read [bytes].

    Raises
    ------
    OSError
        If the file cannot be opened, is not a regular file, or is too large.
    ValueError
        If the path is not a valid file name.
    """
    # without O_NONBLOCK, opening a pipe blocks until it has a writer
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    handle = os.open(path, flags)
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is not a regular file", str(path))
        if status.st_size > max_bytes:
            raise OSError(errno.EFBIG, f"it holds more than {max_bytes // 10**6} MB", str(path))
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(status.st_size)
    finally:
        os.close(handle)


def unpack_arrays(data: bytes, max_bytes: int) -> Dict[str, np.ndarray]:
    """Return the arrays of an ``.npz`` file by name.

    Parameters
    ----------
    data : bytes
        Contents of the file.
    max_bytes : int
        Largest total size of the unpacked arrays [bytes], checked before unpacking.

    Raises
    ------
    ValueError
        If the data are not a valid ``.npz`` file, or unpack to more than ``max_bytes``.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as members:
            if sum(member.file_size for member in members.infolist()) > max_bytes:
                raise ValueError(f"it unpacks to more than {max_bytes // 10**6} MB")
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            return {name: np.asarray(arrays[name]) for name in arrays.files}
    except (
        ArithmeticError,
        AttributeError,
        EOFError,
        LookupError,
        MemoryError,
        OSError,
        RuntimeError,
        SyntaxError,
        TypeError,
        zipfile.BadZipFile,
        zlib.error,
    ) as error:
        raise ValueError("it is not an .npz file, or it is damaged") from error
