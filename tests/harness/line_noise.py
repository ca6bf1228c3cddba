"""Byte errors of a line: turned over, inserted and deleted, by chance from a seed."""

from __future__ import annotations

import numpy as np


class Noise:
    """Strikes what passes, piece by piece, and knows where.

    Parameters
    ----------
    rate : errors in a byte, a third of each kind.
    """

    def __init__(self, rate: float, seed: int) -> None:
        self._rate, self._rng = rate, np.random.default_rng(seed)
        self._passed = 0
        self.places: list[int] = []

    def __call__(self, data: bytes) -> bytes:
        """The next bytes, with their errors."""
        places = np.nonzero(self._rng.random(len(data)) < self._rate)[0].tolist()
        parts, at = [], 0
        for place in places:
            kind, value = self._rng.integers(0, 3), int(self._rng.integers(1, 256))
            parts.append(data[at:place])
            if kind == 0:
                parts.append(bytes([data[place] ^ value]))
            elif kind == 1:  # a quarter of those inserted are delimiters
                parts.append(bytes([value if value % 4 else 0, data[place]]))
            at = place + 1
        parts.append(data[at:])
        self.places += [self._passed + place for place in places]
        self._passed += len(data)
        return b"".join(parts)

    def untouched(self, sizes: list[int]) -> set[int]:
        """Which of the packets, that followed each other with these sizes, no error struck."""
        struck = np.searchsorted(np.cumsum(sizes), self.places, side="right")
        return set(range(len(sizes))) - set(struck.tolist())
