"""A store on any fsspec file system: an object store, a server, or memory."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.runtime.urls import without_secrets

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from flyaround.simulator.dataset.storage.store import Files

_APPEND_INTERVAL_S = 30.0
"""Interval at which appended text is rewritten as a whole object, because objects cannot be appended to."""


def is_url(place: str | Path) -> bool:
    """Return True if a place to write to is a URL rather than a folder."""
    return isinstance(place, str) and "://" in place


class UrlStore:
    """A folder at a URL such as ``s3://bucket/set`` or ``memory://set``; objects are written whole.

    Credentials and servers are configured as for fsspec: ``FSSPEC_S3_ENDPOINT_URL``, a configuration file, ...

    Raises
    ------
    UserError
        If the kind of URL is unknown, its package is missing, or the store does not answer.
    """

    def __init__(self, url: str) -> None:
        try:
            from fsspec.core import url_to_fs  # noqa: PLC0415 - an extra, not needed for folders
        except ImportError as error:
            raise missing_extra(f"output {without_secrets(url)}", "stores", error) from error
        self._title = without_secrets(url.rstrip("/"))
        self._appended: dict[str, tuple[bytearray, float]] = {}
        # some file systems connect on creation
        with self._store_errors("reach"):
            try:
                self._fs, self._root = url_to_fs(url.rstrip("/"))
            except ImportError as error:
                package = getattr(error.__cause__, "name", None) or "the package of this kind of store"
                raise UserError(
                    f"output {self._title} needs a package that is missing: {error}; run: pip install {package}"
                ) from error
            except ValueError as error:
                raise UserError(
                    f"output {self._title} cannot be used: {without_secrets(str(error))}; name a folder with -o"
                ) from error
            self._fs.invalidate_cache()
            self._fs.exists(self._root)

    @property
    def title(self) -> str:
        """The URL without its secrets."""
        return self._title

    def write(self, *waves: Files) -> None:
        """Write files, those of a wave in parallel if the store can."""
        for name, _ in (file for wave in waves for file in wave):
            self._appended.pop(name, None)  # earlier appended data is replaced
        for wave in waves:
            with self._store_errors("write to"):
                # object stores have no folders, and would create a missing bucket
                if not self._fs.async_impl:
                    for folder in {self._path(name).rpartition("/")[0] for name, _ in wave}:
                        self._fs.makedirs(folder, exist_ok=True)
                self._fs.pipe({self._path(name): data for name, data in wave})

    def append(self, name: str, text: bytes) -> None:
        """Append to a text file; written periodically, and by `close`."""
        if name not in self._appended:
            former = self.read(name, 2**32) if self.exists(name) else b""
            self._appended[name] = (bytearray(former), time.monotonic())
        content, written_s = self._appended[name]
        content += text
        if time.monotonic() - written_s >= _APPEND_INTERVAL_S:
            self._write_appended(name)
            self._appended[name] = (content, time.monotonic())

    def read(self, name: str, max_bytes: int) -> bytes:
        """Read the contents of a file, including appended text.

        Raises
        ------
        UserError
            If the file is longer than ``max_bytes``.
        OSError
            If it cannot be read.
        """
        if name in self._appended:
            return bytes(self._appended[name][0])
        try:
            size = self._fs.size(self._path(name))
            if size is not None and size > max_bytes:
                raise UserError(f"{self._title}/{name} has {size:,} bytes and at most {max_bytes:,} are read")
            data: bytes = self._fs.cat_file(self._path(name))
        except OSError:
            raise
        except UserError:
            raise
        except Exception as error:
            raise OSError(without_secrets(f"{type(error).__name__}: {error}")) from error
        return data

    def exists(self, name: str) -> bool:
        """Return True if there is a file of that name."""
        if name in self._appended:
            return True
        with self._store_errors("read"):
            return bool(self._fs.isfile(self._path(name)))

    def is_empty(self) -> bool:
        """Return True if no object lies below the URL."""
        with self._store_errors("read"):
            return not self._fs.find(self._root, maxdepth=1) and not self._fs.find(self._root)

    def remove(self, name: str) -> None:
        """Remove a file."""
        self._appended.pop(name, None)
        with self._store_errors("write to"):
            if self._fs.exists(self._path(name)):
                self._fs.rm_file(self._path(name))

    def remove_unfinished(self) -> None:
        """Do nothing: there are no partly written objects."""

    def free_bytes(self) -> int | None:
        """Return None: the free space is unknown."""
        return None

    def close(self) -> None:
        """Write the appended text."""
        for name in list(self._appended):
            self._write_appended(name)
        self._appended.clear()

    def _write_appended(self, name: str) -> None:
        self.write([(name, bytes(self._appended[name][0]))])

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}"

    @contextmanager
    def _store_errors(self, what: str) -> Iterator[None]:
        """Convert the store's errors to one sentence."""
        try:
            yield
        except UserError:
            raise
        except Exception as error:
            reason = without_secrets(" ".join(str(error).split())) or type(error).__name__
            raise UserError(
                f"cannot {what} {self._title}: {reason}; check the URL, the store and its permissions"
            ) from error
