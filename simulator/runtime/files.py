"""Atomic file writing: temporary name, then rename."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.simulator.errors import UserError, write_error

if TYPE_CHECKING:
    from collections.abc import Sequence

PART_FILES = ".*.part"
"""Pattern of the temporary files, which a killed writer leaves behind."""


def write_atomic(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path``; a reader sees the old file or the whole new one.

    Raises
    ------
    UserError
        If the folder does not exist, cannot be written, or its disk is full.
    """
    temporary = _temporary(path)
    try:
        temporary.write_bytes(data)
        temporary.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise write_error(path, error) from error


def write_durable(files: Sequence[tuple[Path, bytes]]) -> None:
    """Write files durably: all are synced to the disk before the first is renamed to its name, in order.

    Writing many files at once takes little longer than writing one, because they share the wait for the disk.

    Raises
    ------
    UserError
        If a file cannot be written, as in `write_atomic`; files already renamed are whole.
    """
    parts: list[tuple[Path, Path]] = []
    path = Path()
    try:
        for path, data in files:
            parts.append((_temporary(path), path))
            parts[-1][0].write_bytes(data)
        for temporary, _ in parts:
            _fsync_file(temporary)
        for temporary, path in parts:
            temporary.replace(path)
        for folder in {path.parent for _, path in parts}:
            _fsync_folder(folder)
    except OSError as error:
        for temporary, _ in parts:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
        raise write_error(path, error) from error


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.part")


def _fsync_file(path: Path) -> None:
    with path.open("r+b") as file:
        os.fsync(file.fileno())


def _fsync_folder(folder: Path) -> None:
    """Flush the names in a folder to the disk; Windows and some network disks cannot."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def probe_writing(path: Path) -> OSError | None:
    """Return why no file can be written in a folder, or in the nearest one above it that exists; None if one can.

    Returns
    -------
    OSError or None
        The error of a temporary file there, for example because a file is in the place of the folder.
    """
    places = path.parents if path.is_file() else (path, *path.parents)
    try:
        with tempfile.TemporaryFile(dir=next(p for p in places if p.exists())) as file:
            # an empty file fits on a full disk
            file.write(bytes(65_536))
    except OSError as error:
        return error
    return None


def new_path(base: Path, name: str, suffix: str = "") -> Path:
    """Return a path that does not exist yet: ``base/name``, or with a number appended, and the suffix.

    Returns
    -------
    Path
        Path in ``base``.

    Raises
    ------
    OSError
        If all numbers are taken.
    """
    for k in range(1, 100_000):
        path = base / f"{name}{'' if k == 1 else f'-{k}'}{suffix}"
        if not path.exists():
            return path
    raise OSError(f"{base} holds 100000 files of the name {name}: clean it up")


def write_json(path: Path, value: Any) -> None:  # noqa: ANN401 - any JSON value
    """Write a JSON value atomically, indented, with floats at full precision."""
    write_atomic(path, (json.dumps(value, indent=1, allow_nan=False) + "\n").encode())


def write_document(path: Path, document: msgspec.Struct) -> None:
    """Write a typed document atomically as indented JSON."""
    write_atomic(path, msgspec.json.format(msgspec.json.encode(document), indent=1) + b"\n")


def empty_folder(path: Path, *, option: str = "-o", resume: bool | None = None, advice: str = "") -> Path:
    """Make ``path`` a folder that output may go to.

    Parameters
    ----------
    path : Path
        Folder.
    option : str, optional
        Command-line option that names the folder.
    resume : bool, optional
        True to continue with the present contents; None for a command that never does.
    advice : str, optional
        Further remedy for a folder that is not empty.

    Returns
    -------
    Path
        The folder, which exists.

    Raises
    ------
    UserError
        If it is a file, cannot be made or written, or is not empty (unless ``resume``).
    """
    if path.exists() and not path.is_dir():
        raise UserError(f"output {path} is a file, not a folder; name another folder with {option}")
    try:
        path.mkdir(parents=True, exist_ok=True)
        if not os.access(path, os.W_OK):
            raise PermissionError(13, "permission denied")
        full = any(path.iterdir())
    except OSError as error:
        raise write_error(path, error, f"name another folder with {option}") from error
    if full and not resume:
        choices = [
            f"name a new one with {option}",
            *(["continue it with --resume"] if resume is not None else []),
        ]
        if advice:
            choices.append(advice)
        raise UserError(f"output folder {path} is not empty; {', or '.join(choices)}")
    return path
