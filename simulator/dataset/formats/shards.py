"""Frames gathered into shards of a bounded size, each written whole."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

Item = TypeVar("Item")

MAX_BYTES, MAX_FRAMES = 128_000_000, 1000
"""Limits of a shard, which is collected in memory before it is written."""


class Shards(Generic[Item]):
    """Collector of items by split, which passes on each full shard.

    Parameters
    ----------
    write : callable
        Function that takes a split's name, the shard's number in it, and its items.
    """

    def __init__(self, write: Callable[[str, int, list[Item]], None]) -> None:
        self._write = write
        self._items: dict[str, list[Item]] = {}
        self._bytes: dict[str, int] = {}
        self.counts: dict[str, int] = {}
        """Number of items of each split."""
        self.written: dict[str, int] = {}
        """Number of shards written of each split."""

    def add(self, split: str, item: Item, size_bytes: int) -> None:
        """Add one item of a split."""
        if self._items.get(split) and self._bytes[split] + size_bytes > MAX_BYTES:
            self._flush(split)
        self._items.setdefault(split, []).append(item)
        self._bytes[split] = self._bytes.get(split, 0) + size_bytes
        self.counts[split] = self.counts.get(split, 0) + 1
        if len(self._items[split]) >= MAX_FRAMES:
            self._flush(split)

    def finish(self) -> None:
        """Pass the last shards on."""
        for split in list(self._items):
            if self._items[split]:
                self._flush(split)

    def _flush(self, split: str) -> None:
        number = self.written.get(split, 0)
        self._write(split, number, self._items[split])
        self.written[split] = number + 1
        self._items[split], self._bytes[split] = [], 0
