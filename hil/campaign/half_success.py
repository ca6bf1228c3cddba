"""Shares of success with their intervals, and the level at which half of the flights fail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.runtime.arrays import FloatArray

Z_95 = 1.959963984540054
"""Of a two-sided interval of 95 %."""


def wilson(n_good: int, n: int) -> tuple[float, float]:
    """The 95 % interval of a share.

    After Wilson (1927), *Probable inference, the law of succession, and statistical inference*, JASA 22.
    """
    share, z2 = n_good / n, Z_95**2
    middle = (share + z2 / (2 * n)) / (1 + z2 / n)
    half = Z_95 / (1 + z2 / n) * np.sqrt(share * (1 - share) / n + z2 / (4 * n**2))
    return float(max(middle - half, 0.0)), float(min(middle + half, 1.0))


@dataclass(frozen=True)
class Half:
    """Where half of the flights fail.

    Parameters
    ----------
    at : by interpolation between the levels next to it; None where no such level was flown.
    above : the highest level below it whose share of success is more than a half by its 95 % interval;
        None where there is none.
    below : the lowest level above it whose share is less than a half, likewise.
    """

    at: float | None
    above: float | None
    below: float | None

    def in_words(self, unit: str = "s") -> str:
        """The level with its interval."""
        if self.at is None:
            more = self.above is not None
            limit = self.above if more else self.below
            return "not found" if limit is None else f"{'above' if more else 'below'} {limit:g} {unit}"
        low = "?" if self.above is None else f"{self.above:.3g}"
        high = "?" if self.below is None else f"{self.below:.3g}"
        return f"{self.at:.3g} {unit} ({low} to {high})"


def half_success(levels: Sequence[float], n_good: Sequence[int], n: Sequence[int]) -> Half:
    """Where success falls through a half, by linear interpolation of shares that never rise with the level.

    Parameters
    ----------
    levels : increasing. n_good, n : flights that succeeded, and all, at each.
    """
    shares = falling(np.array(n_good) / np.array(n), np.array(n, float))
    bounds = [wilson(good, of) for good, of in zip(n_good, n, strict=True)]
    # the first level at which no more than a half succeeds
    k = int(np.argmax(shares <= 0.5)) if (shares <= 0.5).any() else len(levels)
    above = max((levels[i] for i in range(k) if bounds[i][0] > 0.5), default=None)
    below = min((levels[i] for i in range(k, len(levels)) if bounds[i][1] < 0.5), default=None)
    if k == len(levels) or k == 0:
        return Half(None, above, below)
    step = (shares[k - 1] - 0.5) / (shares[k - 1] - shares[k])
    return Half(float(levels[k - 1] + step * (levels[k] - levels[k - 1])), above, below)


def falling(values: FloatArray, weights: FloatArray) -> FloatArray:
    """The nearest values, in the sense of least squares, that never rise: neighbours that do are pooled."""
    blocks: list[tuple[float, float, int]] = []
    for value, weight in zip(values, weights, strict=True):
        blocks.append((float(value), float(weight), 1))
        while len(blocks) > 1 and blocks[-2][0] < blocks[-1][0]:
            (a, u, m), (b, v, n) = blocks[-2:]
            blocks[-2:] = [((a * u + b * v) / (u + v), u + v, m + n)]
    return np.concatenate([np.full(count, value) for value, _, count in blocks])
