"""Sample patterns: rotated lattices that supersample the target in one raster pass.

A lattice that repeats with every pixel and puts N samples in each consists of all points (x, y) whose s = s_x x + s_y y
and t = t_x x + t_y y are integers, for integer coefficients of determinant -N. A framebuffer with pixel coordinates s
and t *is* this sampling, whatever the angle between its axes: the target is rasterised once, and each image pixel
gathers its N samples by integer coordinates. If the coefficients of s are coprime, and those of t, no two samples
of a pixel share a row or column of an N x N grid (N-rooks).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True)
class SamplePattern:
    """A lattice, by the coefficients of its counters ``s`` and ``t``; their determinant is negative."""

    s: tuple[int, int]
    t: tuple[int, int]

    @property
    def samples(self) -> int:
        """Samples per pixel N."""
        return self.s[1] * self.t[0] - self.s[0] * self.t[1]

    @property
    def phase(self) -> float:
        """Shift of the lattice along s [steps]."""
        # With coprime coefficients an even N would put samples on the pixel's border. Half a step keeps all of them
        # inside and symmetric about the pixel's centre, so that edges have no bias.
        return 0.0 if self.samples % 2 else 0.5

    def offsets(self) -> list[tuple[int, int, float, float]]:
        """Return the N samples of a pixel, nearest to its centre first.

        Returns
        -------
        list of tuple
            List of (i, j, dx_px, dy_px): steps of s and t from the pixel's own lattice index, and the offset of the
            sample from the pixel's centre.
        """
        n, offsets = self.samples, []
        (sx, sy), (tx, ty) = self.s, self.t
        reach_i, reach_j = abs(sx) + abs(sy), abs(tx) + abs(ty)
        for i in range(-reach_i, reach_i + 1):
            for j in range(-reach_j, reach_j + 1):
                s, t = i + self.phase, j
                dx, dy = (sy * t - ty * s) / n, (tx * s - sx * t) / n
                if max(abs(dx), abs(dy)) < 0.5:
                    offsets.append((i, j, dx, dy))
        if len(offsets) != n:
            raise AssertionError(f"{self} has {len(offsets)} samples per pixel, not {n}")
        return sorted(offsets, key=lambda p: (p[2] ** 2 + p[3] ** 2, p[2], p[3]))

    def window(self, tiles_px: FloatArray, reach_px: float) -> tuple[tuple[int, int], tuple[int, int]]:
        """Return framebuffer size and lattice origin (s0, t0) that hold every sample of some tiles of the image.

        Parameters
        ----------
        tiles_px : (K, 2) array
            Centres of the tiles [px].
        reach_px : float
            Distance along an axis from a tile's centre to the centre of its corner pixel.
        """
        low, high = [], []
        for cx, cy in (self.s, self.t):
            counter = tiles_px @ [float(cx), float(cy)]
            # the samples of a pixel and of its neighbours to the sides lie at most this many steps from its own index
            margin = (reach_px + 1.25) * (abs(cx) + abs(cy))
            low.append(int(np.floor(counter.min() - margin)))
            high.append(int(np.ceil(counter.max() + margin)))
        return (high[0] - low[0] + 1, high[1] - low[1] + 1), (low[0], low[1])

    def buffer_from_pixel(self, origin: tuple[int, int]) -> FloatArray:
        """Return the (2, 3) affine map from image pixels to coordinates of the lattice framebuffer."""
        return np.array([[*self.s, 0.5 - self.phase - origin[0]], [*self.t, 0.5 - origin[1]]], float)


def rotated(a: int, b: int = 1) -> SamplePattern:
    """Return the rotated square lattice of a^2 + b^2 samples.

    Raises
    ------
    ValueError
        If a and b are not coprime: samples would share rows and columns.
    """
    if math.gcd(a, b) != 1:
        raise ValueError(f"a lattice has the coefficients {a} and {b}, which must be coprime")
    return SamplePattern((b, a), (a, -b))


SEVEN = SamplePattern((1, 2), (3, -1))
"""Seven samples per pixel. Five suffice for edges, but draw gaps between cells a third of a pixel wide as dashes."""


@lru_cache
def pattern_defines(lattice: SamplePattern) -> Mapping[str, object]:
    """Return the lattice as preprocessor defines; a macro applies F to every sample, so that no loop is needed."""
    in_order = " ".join(f"F({k}, {i}, {j})" for k, (i, j, _, _) in enumerate(lattice.offsets()))
    # the same samples, those nearest to the centres of the pixel's quarters first
    quarter_first = sorted(
        enumerate(lattice.offsets()), key=lambda p: np.hypot(abs(p[1][2]) - 0.25, abs(p[1][3]) - 0.25)
    )
    by_quarters = " ".join(f"F({k}, {i}, {j})" for k, (i, j, _, _) in quarter_first)
    defines: dict[str, object] = {
        "PATTERN_S": f"ivec2{lattice.s}",
        "PATTERN_T": f"ivec2{lattice.t}",
        "PATTERN_PHASE": lattice.phase,
        "SAMPLES": lattice.samples,
        "FOR_EACH_SAMPLE(F)": in_order,
        "FOR_EACH_SAMPLE_OF_QUARTERS(F)": by_quarters,
    }
    return MappingProxyType(defines)
