"""A store: the files of a data set by their names within it, in a folder or anywhere that fsspec knows."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from flyaround.simulator.errors import UserError, write_error
from flyaround.simulator.runtime.files import PART_FILES, write_lasting
from flyaround.simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from collections.abc import Sequence

    Files = Sequence[tuple[str, bytes]]


class Store(Protocol):
    """What a data set is written to. Names are relative, with ``/`` between folders."""

    @property
    def title(self) -> str:
        """What messages call it."""

    def write(self, *waves: Files) -> None:
        """Write files that outlast a loss of power; one has its name once it and all of the waves before are whole.

        Raises
        ------
        UserError
            If the store is full or refuses.
        """

    def append(self, name: str, text: bytes) -> None:
        """Add to the end of a file of text; lasting by the end of `close` at the latest."""

    def read(self, name: str, most_bytes: int) -> bytes:
        """The bytes of a file.

        Raises
        ------
        OSError
            If there is none or it cannot be read. A longer one than ``most_bytes`` is a `UserError`.
        """

    def exists(self, name: str) -> bool:
        """Whether there is a file of that name."""

    def is_empty(self) -> bool:
        """Whether there is no file at all."""

    def remove(self, name: str) -> None:
        """Take a file away; none of that name is no mistake."""

    def remove_unfinished(self) -> None:
        """Take away what a writer that was killed left half-written."""

    def free_bytes(self) -> int | None:
        """Room that is left; None where nobody knows."""

    def close(self) -> None:
        """Finish what is under way."""


class FolderStore:
    """A folder that exists.

    Parameters
    ----------
    others : names in it that are no part of the data set.
    """

    def __init__(self, folder: Path, others: frozenset[str] = frozenset()) -> None:
        self.folder, self._others = folder, others
        self._place = folder.stat()

    @property
    def title(self) -> str:
        """What messages call it."""
        return str(self.folder)

    def write(self, *waves: Files) -> None:
        """Write files, all of them on the disk before the first has its name; they get their names in order."""
        self._refuse_if_moved()
        files = [(self.folder / name, data) for wave in waves for name, data in wave]
        for parent in {path.parent for path, _ in files}:
            try:
                parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise write_error(parent, error) from error
        write_lasting(files)

    def _refuse_if_moved(self) -> None:
        """A folder made anew in place of one that was moved away would hold half a data set that calls itself whole."""
        with contextlib.suppress(OSError):
            if os.path.samestat(self._place, self.folder.stat()):
                return
        raise UserError(
            f"{self.folder} was moved or removed while a data set was written to it; what was written is whole: "
            "move it back, or go on with --resume where it is now"
        )

    def append(self, name: str, text: bytes) -> None:
        """Add to the end of a file of text."""
        self._refuse_if_moved()
        path = self.folder / name
        try:
            with path.open("ab") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise write_error(path, error) from error

    def read(self, name: str, most_bytes: int) -> bytes:
        """The bytes of a file."""
        return read_regular(self.folder / name, most_bytes)

    def exists(self, name: str) -> bool:
        """Whether there is a file of that name."""
        return (self.folder / name).is_file()

    def is_empty(self) -> bool:
        """Whether nothing is there."""
        return not any(path.name not in self._others for path in self.folder.iterdir())

    def remove(self, name: str) -> None:
        """Take a file away."""
        try:
            (self.folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise write_error(self.folder / name, error) from error

    def remove_unfinished(self) -> None:
        """Take away temporary files."""
        for place in (self.folder, self.folder / "images"):
            for path in place.glob(PART_FILES):
                with contextlib.suppress(OSError):
                    path.unlink()

    def free_bytes(self) -> int | None:
        """Room on the folder's disk."""
        try:
            return shutil.disk_usage(self.folder).free
        except OSError:
            return None

    def close(self) -> None:
        """Nothing is under way."""
