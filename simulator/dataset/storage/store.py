"""Stores: the files of a data set by name, in a folder or any fsspec file system."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from flyaround.simulator.errors import UserError, write_error
from flyaround.simulator.runtime.files import PART_FILES, write_durable
from flyaround.simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from collections.abc import Sequence

    Files = Sequence[tuple[str, bytes]]


class Store(Protocol):
    """A place to write a data set to. Names are relative, with ``/`` between folders."""

    @property
    def title(self) -> str:
        """Name for messages."""

    def write(self, *waves: Files) -> None:
        """Write files durably.

        A file gets its final name only after it and all files of earlier waves are complete.

        Raises
        ------
        UserError
            If the store is full or rejects a file.
        """

    def append(self, name: str, text: bytes) -> None:
        """Append to a text file; durable after `close` at the latest."""

    def read(self, name: str, max_bytes: int) -> bytes:
        """Read the contents of a file.

        Raises
        ------
        OSError
            If there is none or it cannot be read. A file longer than ``max_bytes`` raises `UserError`.
        """

    def exists(self, name: str) -> bool:
        """Return True if there is a file of that name."""

    def is_empty(self) -> bool:
        """Return True if there is no file at all."""

    def remove(self, name: str) -> None:
        """Remove a file, if it exists."""

    def remove_unfinished(self) -> None:
        """Remove partly written files of a writer that was killed."""

    def free_bytes(self) -> int | None:
        """Return the free space; None if unknown."""

    def close(self) -> None:
        """Finish pending work."""


class FolderStore:
    """An existing folder as a store.

    Parameters
    ----------
    folder : Path
        Folder to write into.
    other_files : frozenset of str, optional
        Names in it that do not belong to the data set.
    """

    def __init__(self, folder: Path, other_files: frozenset[str] = frozenset()) -> None:
        self.folder, self._others = folder, other_files
        self._place = folder.stat()

    @property
    def title(self) -> str:
        """Name for messages."""
        return str(self.folder)

    def write(self, *waves: Files) -> None:
        """Write files. All are synced to the disk before the first is renamed to its final name, in order.

        Raises
        ------
        UserError
            If the folder cannot be written.
        """
        self._require_not_moved()
        files = [(self.folder / name, data) for wave in waves for name, data in wave]
        for parent in {path.parent for path, _ in files}:
            try:
                parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise write_error(parent, error) from error
        write_durable(files)

    def _require_not_moved(self) -> None:
        """Raise if the folder was moved: a new folder in its place would hold an incomplete set that seems valid."""
        with contextlib.suppress(OSError):
            if os.path.samestat(self._place, self.folder.stat()):
                return
        raise UserError(
            f"{self.folder} was moved or removed while a data set was being written to it; the frames written are "
            "complete: move it back, or resume with --resume at its new place"
        )

    def append(self, name: str, text: bytes) -> None:
        """Append to a text file.

        Raises
        ------
        UserError
            If the file cannot be written.
        """
        self._require_not_moved()
        path = self.folder / name
        try:
            with path.open("ab") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise write_error(path, error) from error

    def read(self, name: str, max_bytes: int) -> bytes:
        """Read the contents of a file."""
        return read_regular(self.folder / name, max_bytes)

    def exists(self, name: str) -> bool:
        """Return True if there is a file of that name."""
        return (self.folder / name).is_file()

    def is_empty(self) -> bool:
        """Return True if the folder is empty."""
        return not any(path.name not in self._others for path in self.folder.iterdir())

    def remove(self, name: str) -> None:
        """Remove a file.

        Raises
        ------
        UserError
            If the file cannot be removed.
        """
        try:
            (self.folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise write_error(self.folder / name, error) from error

    def remove_unfinished(self) -> None:
        """Remove temporary files."""
        for folder in (self.folder, self.folder / "images"):
            for path in folder.glob(PART_FILES):
                with contextlib.suppress(OSError):
                    path.unlink()

    def free_bytes(self) -> int | None:
        """Return the free space of the folder's disk."""
        try:
            return shutil.disk_usage(self.folder).free
        except OSError:
            return None

    def close(self) -> None:
        """Do nothing: no work is pending."""
