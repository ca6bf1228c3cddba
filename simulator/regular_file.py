"""Reading what others name: regular files alone, of a bounded size, from inside one folder."""

from __future__ import annotations

import os
import stat
from pathlib import Path, PureWindowsPath
from urllib.parse import urlsplit

from simulator.errors import UserError


def read_regular(path: Path, most_bytes: int) -> bytes:
    """A file's bytes; what is no regular file is not opened for good: a pipe would wait, a device never ends.

    Parameters
    ----------
    most_bytes : a longer file is refused before it is read.

    Raises
    ------
    OSError
        As of opening a file.
    UserError
        If it is no regular file, or longer.
    """
    # without O_NONBLOCK the opening of a pipe waits for its writer
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        status = os.fstat(handle)
        if stat.S_ISDIR(status.st_mode):
            raise UserError(f"{path} is a folder; name a file")
        if not stat.S_ISREG(status.st_mode):
            raise UserError(f"{path} is no regular file but a pipe or a device; name a file")
        if status.st_size > most_bytes:
            raise UserError(
                f"{path} has {_size(status.st_size)} and at most {_size(most_bytes)} are read; make it smaller"
            )
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read(status.st_size)
    finally:
        os.close(handle)


def find_beside(owner: Path, name: str, what: str) -> Path:
    """Where a file lies that another names: within that one's folder, whatever links there are.

    Parameters
    ----------
    owner : the file that names it. name : as it stands there, relative, with / or backslashes. what : it is.

    Raises
    ------
    UserError
        If the name leads out of the folder, or is an address.
    """
    plain = name.replace("\\", "/")
    quoted = f"{owner}: {what} file {name[:80]!r}"
    if "\0" in name or not plain.strip():
        raise UserError(f"{quoted} has no name that a file can have; export the model again")
    if "://" in plain or (urlsplit(plain).scheme and not PureWindowsPath(plain).drive):
        raise UserError(f"{quoted} is an address, which is not fetched; put the file beside the model")
    folder = owner.parent.resolve()
    if Path(plain).is_absolute() or PureWindowsPath(plain).anchor or PureWindowsPath(plain).drive:
        inside = False
    else:
        try:
            inside = (folder / plain).resolve().is_relative_to(folder)
        except (OSError, RuntimeError):  # links in a circle
            inside = False
    if not inside:
        raise UserError(
            f"{quoted} is not within the model's folder, from which alone files are read; put it there and "
            "name it without its path"
        )
    return owner.parent / plain


def _size(n_bytes: int) -> str:
    if n_bytes < 2**20:
        return f"{n_bytes:,} bytes"
    return f"{n_bytes / 2**20:,.1f} MB" if n_bytes < 2**30 else f"{n_bytes / 2**30:,.1f} GB"
