"""One writer at a time in a folder: two would do the same work twice, or mix two plans."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError, write_error

if sys.platform != "win32":
    import fcntl

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def only_writer(folder: Path, what: str) -> Iterator[None]:
    """Within, no other command of this kind writes into ``folder``.

    A file in it is locked, which the system undoes when the process ends, however it ends: one that was left behind is
    no obstacle. Where a disk has no locks, as some network disks, nobody is kept out.

    Parameters
    ----------
    what : the command: ``capture``.

    Raises
    ------
    UserError
        If another is writing there.
    """
    path = folder / lock_name(what)
    file = _locked(path, what)
    try:
        yield
    finally:
        if file is not None:
            path.unlink(
                missing_ok=True
            )  # before it is free: who opened it meanwhile looks for its name again
            os.close(file)


def lock_name(what: str) -> str:
    """Of the file that is locked."""
    return f".{what}.lock"


def _locked(path: Path, what: str) -> int | None:
    """The lock file, open and locked; ``None`` where there are no locks."""
    if sys.platform == "win32":
        return None
    while True:
        try:
            file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise write_error(path, error) from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
            raise UserError(
                f"another {what} is writing into {path.parent}; wait until it ends, or name another folder with -o"
            ) from None
        except OSError:  # a disk without locks
            return file
        if _is(path, file):
            return file
        os.close(file)  # the one before has just taken it away


def _is(path: Path, file: int) -> bool:
    """Whether a file that is open is still what its name leads to."""
    try:
        return os.path.samestat(path.stat(), os.fstat(file))
    except FileNotFoundError:
        return False
