"""Solar wings: hinged panels with cells on one face, a yoke at the root, and their labels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.model import Edge
from tools.craft.assemble import Piece
from tools.craft.labels import box_edges, moved_edges
from tools.craft.level import Level
from tools.craft.mass import MassElement
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import cell_grid, clipped_rectangle, rectangle
from tools.craft.shapes.solids import bar, box, rod

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Vec3


CELL_M = 0.002
"""Cells stand this far proud of their panel."""


@dataclass(frozen=True, kw_only=True)
class Wing:
    """Dimensions of a wing along +x of its own frame, chord along y, cells towards +z, mid-plane z = 0.

    Parameters
    ----------
    panels : int
        Number of panels.
    first_m : float
        X of the first panel's inner edge.
    length_m : float
        Of a panel, along x.
    gap_m : float
        Between panels.
    chord_m : float
        Along y.
    thickness_m : float
        Of a panel.
    cells : tuple of int
        Number of cells along x and y in each panel.
    margin_m : float, optional
        Bare rim of a panel.
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
        """Return the opposite corners of each panel."""
        y, z = self.chord_m / 2, self.thickness_m / 2
        starts = [self.first_m + k * (self.length_m + self.gap_m) for k in range(self.panels)]
        return [((x, -y, -z), (x + self.length_m, y, z)) for x in starts]

    @property
    def tip_m(self) -> float:
        """X of the outer edge."""
        return self.first_m + self.panels * (self.length_m + self.gap_m) - self.gap_m


def wing_panels(wing: Wing) -> Mesh:
    """Return the panels as plates."""
    return merge([box(lo, hi) for lo, hi in wing.boxes()])


def wing_cells(wing: Wing, grouping: str) -> Mesh:
    """Return the cells: ``"single"``, by ``"string"`` (a column of cells each), or by ``"panel"``."""
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
    """Return the stiffeners on the back of each panel, along its chord and along x at both edges."""
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
    """Return the hinge barrels in the gaps, two to a gap, and at the inner edge."""
    hinges = [lo[0] - wing.gap_m / 2 for lo, _ in wing.boxes()]
    y = 0.33 * wing.chord_m
    return merge(
        [rod((x, s * y - 0.06, 0), (x, s * y + 0.06, 0), radius_m, segments) for x in hinges for s in (-1, 1)]
    )


def wing_yoke(wing: Wing, root_m: float, spread: float, section_m: float) -> Mesh:
    """Return a forked yoke from the axis at ``root_m`` to the first panel's edge, ``spread`` of the chord wide."""
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


AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""Columns: the wing's own x, y, z in the model frame, on the +x side. A reflection: y to z, z to y."""
MIRROR_X = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class SideWings:
    """A pair of wings and their mounting.

    Parameters
    ----------
    wing : Wing
        Dimensions of one wing.
    root_m : float
        X coordinate of the yoke's root.
    z_m : float
        Z coordinate of the wing's long axis.
    spread : float
        Width of the yoke's fork as a share of the chord.
    section_m : float
        Side of the square section of the yoke's bars.
    ribs : int
        Number of stiffeners across the back of each panel.
    rib_m : float
        Depth of the stiffeners.
    cells : str
        Material of the cells.
    panels : str
        Material of the panels' cell side.
    back : str
        Material of the panels' back.
    """

    wing: Wing
    root_m: float
    z_m: float
    spread: float
    section_m: float
    ribs: int
    rib_m: float
    cells: str
    panels: str
    back: str

    def pieces(self, level: Level) -> list[Piece]:
        """Return both wings at a level of detail."""
        grouping = {"full": "single", "medium": "string", "low": "panel"}[level.detail]
        meshes = {
            ("panels", self.panels): wing_panels(self.wing),
            ("cells", self.cells): wing_cells(self.wing, grouping),
            ("yoke", "grey-paint"): wing_yoke(self.wing, self.root_m, self.spread, self.section_m),
        }
        if level.fittings:
            ribs = self.ribs if level.fine else 2
            meshes["ribs", self.back] = wing_ribs(self.wing, self.rib_m, ribs)
            meshes["hinges", "brushed-metal"] = wing_hinges(
                self.wing, 0.9 * self.wing.thickness_m, level.segments(12)
            )
        pieces = []
        for (name, material), mesh in meshes.items():
            right = self._place(mesh)
            pieces.append(Piece(f"wing_px_{name}", material, right))
            pieces.append(Piece(f"wing_nx_{name}", material, right.mirrored(0)))
        return pieces

    def panel_bodies(self) -> Mesh:
        """Return all panels of both wings as plain boxes."""
        right = self._place(wing_panels(self.wing))
        return merge([right, right.mirrored(0)])

    def corners(self) -> dict[str, Vec3]:
        """Return the corners of both wings on the cells' side, by name."""
        w, y, half = self.wing, self.wing.thickness_m / 2, self.wing.chord_m / 2
        return {
            f"wing_{side}_{at}_{end}": (sign * x, y, self.z_m + z)
            for side, sign in (("px", 1.0), ("nx", -1.0))
            for at, x in (("tip", w.tip_m), ("root", w.first_m))
            for end, z in (("aft", -half), ("fore", half))
        }

    def edges(self) -> list[Edge]:
        """Return the twelve edges of every panel."""
        edges = []
        for k, (lo, hi) in enumerate(self.wing.boxes()):
            panel = moved_edges(box_edges(f"panel_{k + 1}", lo, hi), AXES, (0, 0, self.z_m))
            edges += moved_edges(panel, np.eye(3), (0, 0, 0), "px_")
            edges += moved_edges(panel, MIRROR_X, (0, 0, 0), "nx_")
        return edges

    def lumps(self, mass_kg: float) -> list[MassElement]:
        """Return each wing as a plate of ``mass_kg``."""
        w = self.wing
        middle = (w.tip_m + w.first_m) / 2
        return [
            MassElement(
                f"wing {side}",
                mass_kg,
                vec3(np.array([sign * middle, 0.0, self.z_m])),
                size_m=(w.tip_m - w.first_m, w.thickness_m, w.chord_m),
            )
            for side, sign in (("+x", 1), ("-x", -1))
        ]

    def _place(self, mesh: Mesh) -> Mesh:
        # the reflection y <-> z is a mirror of y followed by a quarter turn about x
        return mesh.mirrored(1).rotated(AXES @ np.diag([1.0, -1.0, 1.0])).moved((0, 0, self.z_m))
