"""Files that anybody may have written: regular ones only, of bounded size."""

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


def read_bounded(path: Union[str, Path], most_bytes: int) -> bytes:
    """Return a file's bytes; pipes and devices are refused, since they may block or never end.

    Parameters
    ----------
    path : str or Path
        The file.
    most_bytes : int
        Longer files are refused before they are read.

    Raises
    ------
    OSError
        If it cannot be opened, is no regular file, or is longer.
    ValueError
        If the path cannot name a file.
    """
    # without O_NONBLOCK the opening of a pipe waits for its writer
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    handle = os.open(path, flags)
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is no regular file", str(path))
        if status.st_size > most_bytes:
            raise OSError(errno.EFBIG, f"it holds more than {most_bytes // 10**6} MB", str(path))
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(status.st_size)
    finally:
        os.close(handle)


def unpack_arrays(data: bytes, most_bytes: int) -> Dict[str, np.ndarray]:
    """Return the arrays of an ``.npz`` file by name.

    Parameters
    ----------
    data : bytes
        The file.
    most_bytes : int
        A file that unpacks to more is refused before it is unpacked.

    Raises
    ------
    ValueError
        If it is no such file, damaged, or unpacks to more.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as members:
            if sum(member.file_size for member in members.infolist()) > most_bytes:
                raise ValueError(f"it unpacks to more than {most_bytes // 10**6} MB")
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
        raise ValueError("it is no .npz file, or a damaged one") from error
