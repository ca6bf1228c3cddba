"""File locks: one writer in a folder, one maker of a cache entry."""

from __future__ import annotations

import os
import sys
import time
from contextlib import ExitStack, contextmanager, suppress
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError, write_error

if sys.platform != "win32":
    import fcntl

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# Interval of attempts to take a lock [s].
_RETRY_INTERVAL_S = 0.02


@contextmanager
def only_writer(folder: Path, what: str) -> Iterator[None]:
    """Keep other commands of this kind from writing into ``folder``.

    Parameters
    ----------
    folder : Path
        Existing folder.
    what : str
        Name of the command, for example ``capture``.

    Raises
    ------
    UserError
        If another is writing there, or a lock file cannot be written.
    """
    path = folder / lock_name(what)
    with ExitStack() as locks:
        try:
            locks.enter_context(locked_file(path))
        except BlockingIOError:
            raise UserError(
                f"another {what} is writing into {folder}; wait until it ends, or name another folder with -o"
            ) from None
        except OSError as error:
            raise write_error(path, error) from error
        yield


def lock_name(what: str) -> str:
    """Return the name of the file that `only_writer` locks.

    Returns
    -------
    str
        File name without folder.
    """
    return f".{what}.lock"


@contextmanager
def locked_file(path: Path, wait_s: float = 0.0) -> Iterator[None]:
    """Hold an exclusive lock on a file, which is created for this and removed afterwards.

    The system releases a lock when its process ends, so a file left by a crash does not block. File systems without
    locks, such as some network disks, exclude no other process; nor does Windows.

    Parameters
    ----------
    path : Path
        Lock file.
    wait_s : float
        Time to wait for the current holder [s].

    Raises
    ------
    BlockingIOError
        If another process or thread holds it for longer.
    OSError
        If the file cannot be opened.
    """
    if sys.platform == "win32":
        yield
        return
    until = time.monotonic() + wait_s
    while (file := _locked(path)) is None:
        if time.monotonic() >= until:
            raise BlockingIOError
        time.sleep(_RETRY_INTERVAL_S)
    try:
        yield
    finally:
        # removed while locked: a waiter notices that its open file is gone and opens a new one
        with suppress(OSError):
            path.unlink()
        os.close(file)


def _locked(path: Path) -> int | None:
    """Try to lock the file; return its descriptor, or None if another caller holds it."""
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    with suppress(OSError):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # the previous holder may just have removed the file
            is_mine = os.path.samestat(path.stat(), os.fstat(file))
        except (BlockingIOError, FileNotFoundError):
            is_mine = False
        if not is_mine:
            os.close(file)
            return None
    return file
