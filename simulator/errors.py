"""The exception for a user's mistakes, with problem, place and remedy; and suggestions for misspelt names."""

from __future__ import annotations

import errno
from difflib import get_close_matches
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

# share of matching letters: one wrong letter of three passes, "bogus" for "burns" does not
_NEAR = 0.65
_FULL = (errno.ENOSPC, errno.EDQUOT)


class UserError(Exception):
    """A user's mistake or a missing part of the machine.

    The message is one sentence with problem, place and remedy. The command line prints it
    without a traceback and exits with 2.
    """


def write_error(path: Path, error: OSError, remedy: str = "choose a folder you may write to") -> UserError:
    """Return the error to raise if ``path`` cannot be written; a full disk is reported as such.

    Parameters
    ----------
    path : Path
        File that cannot be written.
    error : OSError
        Error of the operating system.
    remedy : str, optional
        Advice for any error but a full disk.

    Returns
    -------
    UserError
        Error with the path and the reason.
    """
    if error.errno in _FULL:
        return UserError(
            f"cannot write {path}: no space left on its disk; free some space or choose another disk"
        )
    return UserError(f"cannot write {path}: {error.strerror or error}; {remedy}")


def missing_extra(what: str, extra: str, error: ImportError) -> UserError:
    """Return the error to raise if a library of an extra cannot be imported: it is missing, or does not load.

    Parameters
    ----------
    what : str
        Feature that needs the library, as in "format parquet".
    extra : str
        Name in pyproject.toml.
    error : ImportError
        Error of the import.

    Returns
    -------
    UserError
        Error with the command that installs the extra.
    """
    if isinstance(error, ModuleNotFoundError):
        name = (error.name or str(error)).partition(".")[0]
        return UserError(
            f"{what} needs {name}, which is not installed; run: pip install 'flyaround[{extra}]'"
        )
    reason = " ".join(str(error).split())
    return UserError(
        f"{what} needs the extra {extra}, which cannot be loaded: {reason}; see what flyaround doctor says"
    )


_LIMITS = (
    "cannot allocate memory",
    "out of memory",
    "bad_alloc",
    "can't start new thread",
    "failed to map segment",
)
"""Messages of libraries that run out of memory or threads but raise other errors."""


def machine_sentence(error: BaseException) -> str | None:
    """Describe a failure of the machine or system: memory, threads, files, or the installation.

    Returns
    -------
    str or None
        What happened and what to do, without a full stop; None for an error of the program itself.
    """
    reason = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        detail = f" ({reason})" if reason else ""
        return f"not enough memory{detail}; close other programs, or use fewer workers or a smaller image or mesh"
    if any(mark in reason.lower() for mark in _LIMITS):
        return (
            f"the machine's limits are reached: {reason}; raise them (ulimit -v, -u) or ask for fewer workers"
        )
    if isinstance(error, ImportError):
        return f"a part of the installation cannot be loaded: {reason}; install it again, or raise this shell's limits"
    if isinstance(error, RecursionError):
        return "the input is nested too deeply to be read; check the file for nested brackets"
    if not isinstance(error, OSError):
        return None
    file = f": {error.filename}" if error.filename is not None else ""
    if error.errno in _FULL:
        return f"no space left on the disk{file}; free some space or choose another disk"
    reason = error.strerror or str(error) or type(error).__name__
    return f"the system refused{file}: {reason}; check the path, its permissions and the machine's limits"


def near_names(name: str, names: Sequence[str], most: int = 1) -> list[str]:
    """Find the names that ``name`` was probably meant for.

    Returns
    -------
    list of str
        At most ``most`` of ``names``: close matches first, the closest in front, then those that contain ``name``
        or are contained in it; empty if there are none.
    """
    close = get_close_matches(name, names, n=most, cutoff=_NEAR)
    containing = [
        k for k in names if k not in close and min(len(k), len(name)) > 2 and (name in k or k in name)
    ]
    return [*close, *containing][:most]
