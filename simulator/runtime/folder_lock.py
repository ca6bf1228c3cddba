"""Locks of files: one writer in a folder, one maker of a cache entry."""

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

_LOOK_AGAIN_S = 0.02


@contextmanager
def only_writer(folder: Path, what: str) -> Iterator[None]:
    """Keep other commands of this kind from writing into ``folder``.

    Parameters
    ----------
    folder : Path
        Existing folder.
    what : str
        The command: ``capture``.

    Raises
    ------
    UserError
        If another is writing there, or a lock file cannot be written.
    """
    path = folder / lock_name(what)
    with ExitStack() as held:
        try:
            held.enter_context(locked_file(path))
        except BlockingIOError:
            raise UserError(
                f"another {what} is writing into {folder}; wait until it ends, or name another folder with -o"
            ) from None
        except OSError as error:
            raise write_error(path, error) from error
        yield


def lock_name(what: str) -> str:
    """Return the name of the file that `only_writer` locks."""
    return f".{what}.lock"


@contextmanager
def locked_file(path: Path, wait_s: float = 0.0) -> Iterator[None]:
    """Hold the lock of a file, which is made and removed again.

    The system undoes a lock when its process ends, however it ends: a file that was left behind is no obstacle. Where a
    disk has no locks, as some network disks, nobody is kept out.

    Parameters
    ----------
    path : Path
        File that stands for what is locked.
    wait_s : float
        Time to wait for another process or thread that holds it [s].

    Raises
    ------
    BlockingIOError
        If another holds it for longer.
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
        time.sleep(_LOOK_AGAIN_S)
    try:
        yield
    finally:
        with suppress(OSError):  # before it is free: who opened it meanwhile looks for its name again
            path.unlink()
        os.close(file)


def _locked(path: Path) -> int | None:
    """Return the descriptor of the file if it is this caller's now."""
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    with suppress(OSError):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # the one before may just have taken the file away
            is_mine = os.path.samestat(path.stat(), os.fstat(file))
        except (BlockingIOError, FileNotFoundError):
            is_mine = False
        if not is_mine:
            os.close(file)
            return None
    return file
