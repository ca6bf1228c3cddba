"""Solar wings: hinged panels with cells on one face, a yoke at the root."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.targets.builders.cells import cell_grid, clipped_rectangle
from flyaround.simulator.targets.builders.mesh import Mesh, merge
from flyaround.simulator.targets.builders.prism import rectangle
from flyaround.simulator.targets.builders.solids import bar, box, rod

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Vec3

CELL_M = 0.002
"""Cells stand this far proud of their panel."""


@dataclass(frozen=True, kw_only=True)
class Wing:
    """Dimensions of a wing along +x of its own frame, chord along y, cells towards +z, mid-plane z = 0.

    Parameters
    ----------
    panels : number of panels. first_m : x of the first panel's inner edge. length_m : of a panel, along x.
    gap_m : between panels. chord_m : along y. thickness_m : of a panel.
    cells : number of cells along x and y in each panel. margin_m : bare rim of a panel.
    """

    panels: int
    first_m: float
    length_m: float
    gap_m: float
    chord_m: float
    thickness_m: float
    cells: tuple[int, int]
    margin_m: float = 0.025

    def boxes(self) -> list[tuple[Vec3, Vec3]]:
        """Opposite corners of each panel."""
        y, z = self.chord_m / 2, self.thickness_m / 2
        starts = [self.first_m + k * (self.length_m + self.gap_m) for k in range(self.panels)]
        return [((x, -y, -z), (x + self.length_m, y, z)) for x in starts]

    @property
    def tip_m(self) -> float:
        """X of the outer edge."""
        return self.first_m + self.panels * (self.length_m + self.gap_m) - self.gap_m


def wing_panels(wing: Wing) -> Mesh:
    """The panels as plates."""
    return merge([box(lo, hi) for lo, hi in wing.boxes()])


def wing_cells(wing: Wing, grouping: str) -> Mesh:
    """The cells: ``"single"``, by ``"string"`` (a column of cells each), or by ``"panel"``."""
    nx, ny = wing.cells
    inner_x, inner_y = wing.length_m - 2 * wing.margin_m, wing.chord_m - 2 * wing.margin_m
    pitch = (inner_x / nx, inner_y / ny)
    gap = 0.004
    fields = []
    for lo, hi in wing.boxes():
        xs = lo[0] + wing.margin_m + (np.arange(nx) + 0.5) * pitch[0]
        ys = -inner_y / 2 + (np.arange(ny) + 0.5) * pitch[1]
        if grouping == "single":
            w, h = pitch[0] - gap, pitch[1] - gap
            outline = clipped_rectangle(w, h, 0.12 * min(w, h), "all")
        elif grouping == "string":
            ys = np.zeros(1)
            half = (pitch[0] / 2 - gap, inner_y / 2)
            outline = rectangle((-half[0], -half[1]), half)
        else:
            xs, ys = np.array([(lo[0] + hi[0]) / 2]), np.zeros(1)
            half = (inner_x / 2, inner_y / 2)
            outline = rectangle((-half[0], -half[1]), half)
        fields.append(cell_grid(xs, ys, outline, hi[2], CELL_M))
    return merge(fields)


def wing_ribs(wing: Wing, depth_m: float, count: int) -> Mesh:
    """Stiffeners on the back of each panel, along its chord and along x at both edges."""
    back, width = -wing.thickness_m / 2, 0.03
    ribs = []
    for lo, hi in wing.boxes():
        # offsets keep the ends of crossing ribs apart
        ribs += [
            box((x - width / 2, lo[1] + 0.05, back - depth_m), (x + width / 2, hi[1] - 0.05, back))
            for x in np.linspace(lo[0] + 0.04, hi[0] - 0.04, count)
        ]
        ribs += [
            box((lo[0] + 0.01, y - width / 2, back - 1.2 * depth_m), (hi[0] - 0.01, y + width / 2, back))
            for y in (lo[1] + 0.03, hi[1] - 0.03)
        ]
    return merge(ribs)


def wing_hinges(wing: Wing, radius_m: float, segments: int) -> Mesh:
    """Hinge barrels in the gaps, two to a gap, and at the inner edge."""
    at = [lo[0] - wing.gap_m / 2 for lo, _ in wing.boxes()]
    y = 0.33 * wing.chord_m
    return merge(
        [rod((x, s * y - 0.06, 0), (x, s * y + 0.06, 0), radius_m, segments) for x in at for s in (-1, 1)]
    )


def wing_yoke(wing: Wing, root_m: float, spread: float, section_m: float) -> Mesh:
    """A forked yoke from the axis at ``root_m`` to the first panel's edge, ``spread`` of the chord wide."""
    end, half = wing.first_m - wing.gap_m, spread * wing.chord_m / 2
    knee = root_m + 0.25 * (end - root_m)
    s = section_m
    up = (0, 0, 1)
    return merge(
        [
            bar((root_m, 0, 0), (knee, 0, 0), 1.4 * s, 1.4 * s, up),
            bar((knee - s / 2, 0, 0), (end, half, 0), s, s, up),
            bar((knee - s / 2, 0, 0), (end, -half, 0), s, 0.9 * s, up),
            bar((end - s / 2, -half - s, 0), (end - s / 2, half + s, 0), s, 0.8 * s, up),
        ]
    )
