"""Compiled libraries cached in a folder: used only as they were written, and only where nobody else can have put them.

A library is code: one that another user planted would run as this one. The folder must be the user's own, and is made
the user's alone; it is held open from the check until the library is loaded, so that no other takes its place.
A library's name ends with a checksum of its bytes: one that was cut short or changed is compiled again, not run.
"""

import contextlib
import ctypes
import hashlib
import logging
import os
import stat
import tempfile
from pathlib import Path
from typing import Iterator, Optional

SUFFIX = ".so"
OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
HELD = Path("/proc/self/fd")

logger = logging.getLogger(__name__)


@contextlib.contextmanager
def own_folder(path: Path) -> Iterator[Optional[Path]]:
    """A folder that is the user's and that nobody else may write to, made where it is not there.

    One of the user's that others may write to (a umask of 002 makes such) is closed to them. What they may have put
    there before is told by its owner and mode when a library is loaded.

    Yields
    ------
    Where its files are to be reached, which stays the same folder whatever is done to its path; None where it is
    another's, a symbolic link, cannot be closed to others, or cannot be had: the reason is logged.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            path.mkdir(mode=0o700)
        held = None  # Windows gives a user's folder to that user alone
        if hasattr(os, "geteuid"):
            held = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except (OSError, RuntimeError) as error:
        logger.warning("kernels are not kept: no folder %s can be had (%s)", path, error)
        yield None
        return
    if held is None:
        yield path
        return
    try:
        why = _close_to_others(held)
        if why:
            logger.warning("kernels are not kept, and compiled at every start: %s %s; remove it", path, why)
            yield None
        else:
            yield HELD / str(held) if HELD.is_dir() else path
    finally:
        os.close(held)


def _close_to_others(held: int) -> str:
    """Take what others may do in an open folder from them; what stands against using it, empty if nothing."""
    info = os.fstat(held)
    if info.st_uid != os.geteuid():
        return "is another user's"
    if info.st_mode & OTHERS_MAY_WRITE:
        with contextlib.suppress(OSError):  # some disks have no modes
            os.fchmod(held, 0o700)
        if os.fstat(held).st_mode & OTHERS_MAY_WRITE:
            return "may be written to by others"
    return ""


def load_cached(folder: Path, stem: str) -> Optional[ctypes.CDLL]:
    """The library of this stem in a folder of `own_folder`; None where there is none as it was written.

    Parameters
    ----------
    stem : the name but for the checksum.
    """
    try:
        names = sorted(path.name for path in folder.glob(f"{stem}-*{SUFFIX}"))
    except OSError:
        return None
    for name in names:
        try:
            if _is_sound(folder / name, stem):
                return ctypes.CDLL(str(folder / name))
            logger.warning("kept kernels %s are damaged and compiled again", name)
            (folder / name).unlink()
        except OSError as error:  # on some disks nothing may be run
            logger.warning("kept kernels %s cannot be used (%s)", name, error)
    return None


def store(made: Path, folder: Path, stem: str) -> None:
    """Keep a library that was compiled elsewhere; a disk that is full or read-only is logged, no error."""
    data = made.read_bytes()
    temporary = None
    try:
        # a temporary file is the user's alone
        with tempfile.NamedTemporaryFile(dir=folder, suffix=".tmp", delete=False) as file:
            temporary = Path(file.name)
            file.write(data)
        temporary.replace(folder / _name(stem, data))
    except OSError as error:
        logger.warning("kernels cannot be kept (%s) and are compiled at every start", error)
        with contextlib.suppress(OSError):
            if temporary:
                temporary.unlink()


def _is_sound(path: Path, stem: str) -> bool:
    """Whether a library is what its name says, and nobody else may have written to it."""
    info = path.lstat()
    if not stat.S_ISREG(info.st_mode) or info.st_mode & OTHERS_MAY_WRITE:
        return False
    if hasattr(os, "geteuid") and info.st_uid != os.geteuid():
        return False
    return path.name == _name(stem, path.read_bytes())


def _name(stem: str, data: bytes) -> str:
    return f"{stem}-{hashlib.blake2b(data, digest_size=16).hexdigest()}{SUFFIX}"
