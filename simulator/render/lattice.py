"""The rotated supersampling lattice that gives the target its area-true edges in one raster pass.

The lattice spanned by v1 = (1, a) / N and v2 = (a, -1) / N, N = a^2 + 1, repeats with every pixel and puts N samples
in each, no two of them in one row or column of an N x N grid (N-rooks). Its two axes are orthogonal, so a framebuffer
whose pixel axes are v1 and v2 *is* this sampling: the target is rasterised once, and each image pixel gathers its N
samples by whole-number coordinates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from simulator.arrays import FloatArray
    from simulator.render.projection import PixelRect


@dataclass(frozen=True)
class Lattice:
    """Lattice of parameter ``a``: ``a^2 + 1`` samples per pixel."""

    a: int

    @property
    def samples(self) -> int:
        """Samples per pixel N."""
        return self.a * self.a + 1

    @property
    def phase(self) -> float:
        """Shift of the lattice along v1, in steps."""
        # an even N would put samples on the pixel's border: half a lattice step along v1 keeps the set
        # symmetric about the pixel's centre (no bias of edges) and inside
        return 0.0 if self.samples % 2 else 0.5

    def offsets(self) -> list[tuple[int, int, float, float]]:
        """The N samples of a pixel, nearest to its centre first.

        Returns
        -------
        list of (i, j, dx_px, dy_px): steps along v1 and v2 from the pixel's own lattice index, and the sample's
        offset from the pixel's centre.
        """
        a, n, found = self.a, self.samples, []
        for i in range(-a - 1, a + 2):
            for j in range(-a - 1, a + 2):
                s, t = i + self.phase, j
                dx, dy = (s + a * t) / n, (a * s - t) / n
                if max(abs(dx), abs(dy)) < 0.5:
                    found.append((i, j, dx, dy))
        if len(found) != n:
            raise AssertionError(f"lattice a={a} has {len(found)} samples per pixel, not {n}")
        return sorted(found, key=lambda p: (p[2] ** 2 + p[3] ** 2, p[2], p[3]))

    def window(self, rect: PixelRect) -> tuple[tuple[int, int], tuple[int, int]]:
        """Framebuffer size and lattice origin (s0, t0) that hold every sample of the pixels of ``rect``."""
        a = self.a
        margin = a + 1  # samples of a pixel lie at most this many steps from its own index
        x0, y0, x1, y1 = rect.x0, rect.y0, rect.x1 - 1, rect.y1 - 1
        s0, s1 = x0 + a * y0 - margin, x1 + a * y1 + margin
        t0, t1 = a * x0 - y1 - margin, a * x1 - y0 + margin
        return (s1 - s0 + 1, t1 - t0 + 1), (s0, t0)

    def buffer_from_pixel(self, origin: tuple[int, int]) -> FloatArray:
        """(2, 3) affine map from image pixels to the lattice framebuffer's coordinates."""
        a = float(self.a)
        return np.array(
            [[1.0, a, 0.5 - self.phase - origin[0]], [a, -1.0, 0.5 - origin[1]]],
        )
