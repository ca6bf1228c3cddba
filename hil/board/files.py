"""Reading of files given by name: regular files only, of bounded size."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path
from typing import Union


def read_bounded(path: Union[str, Path], most_bytes: int) -> bytes:
    """Return a file's bytes; pipes and devices are refused, since they may block or never end.

    Parameters
    ----------
    most_bytes : a longer file is refused before it is read.

    Raises
    ------
    OSError
        As of opening a file, and with a ``strerror`` of its own if it is no regular file or longer.
    ValueError
        If the path is none.
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
