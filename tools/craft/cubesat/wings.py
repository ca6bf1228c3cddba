"""A CubeSat's pair of wings, hinged panels in one plane, and their labels."""

from __future__ import annotations

from dataclasses import dataclass

from flyaround.simulator.runtime.arrays import Vec3
from flyaround.simulator.targets.model import Detail, Edge
from tools.craft.assemble import Piece
from tools.craft.cubesat.fittings import WING_M, wing, wing_width_m
from tools.craft.labels import prism_edges
from tools.craft.mass import MassElement
from tools.craft.place import placed_pieces
from tools.craft.shapes.mesh import Mesh
from tools.craft.shapes.prism import rectangle
from tools.craft.shapes.solids import box


@dataclass(frozen=True, kw_only=True)
class Wings:
    """A pair of wings along +-x with cells on their +y side.

    Parameters
    ----------
    root_x_m : float
        Distance of the hinge line from the centre.
    y_m : float
        Y coordinate of the cells' plane.
    panels : int
        Number of panels of each wing.
    size_m : tuple of float
        Size of a panel along x and z.
    gap_m : float
        Gap before each panel.
    """

    root_x_m: float
    y_m: float
    panels: int
    size_m: tuple[float, float]
    gap_m: float

    @property
    def reach_m(self) -> float:
        """Distance of the tips from the centre [m]."""
        return self.root_x_m + wing_width_m(self.panels, self.size_m[0], self.gap_m)

    def corners(self) -> dict[str, Vec3]:
        """Return the four outermost corners, by name."""
        return {
            f"wing_{a}_{c}": (sx * self.reach_m, self.y_m, sz * self.size_m[1] / 2)
            for a, sx in (("nx", -1), ("px", 1))
            for c, sz in (("nz", -1), ("pz", 1))
        }

    def pieces(self, detail: Detail) -> list[Piece]:
        """Return both wings; their cells face the viewer along -y."""
        right, left = (
            wing(name, self.panels, 2, 4, self.size_m, self.gap_m, detail) for name in ("wing_px", "wing_nx")
        )
        return [
            # x along +-x of the craft, y along -+z: their product is +y
            *placed_pieces(right, (self.root_x_m, self.y_m, 0), (1, 0, 0), (0, 0, -1)),
            *placed_pieces(left, (-self.root_x_m, self.y_m, 0), (-1, 0, 0), (0, 0, 1)),
        ]

    def outlines(self) -> dict[str, tuple[Vec3, Vec3]]:
        """Return the lowest and highest corner of each panel, by name."""
        z = self.size_m[1] / 2
        outlines: dict[str, tuple[Vec3, Vec3]] = {}
        for k in range(self.panels):
            x0 = self.root_x_m + self.gap_m + k * (self.size_m[0] + self.gap_m)
            x1 = x0 + self.size_m[0]
            outlines[f"wing_px_{k}"] = ((x0, self.y_m - WING_M, -z), (x1, self.y_m, z))
            outlines[f"wing_nx_{k}"] = ((-x1, self.y_m - WING_M, -z), (-x0, self.y_m, z))
        return outlines

    def bodies(self) -> list[Mesh]:
        """Return the panels as boxes, for visibility."""
        return [box(lo, hi) for lo, hi in self.outlines().values()]

    def edges(self) -> list[Edge]:
        """Return the outlines of the panels."""
        edges: list[Edge] = []
        for name, (lo, hi) in self.outlines().items():
            # u x v = x x (-z) = +y
            outline = rectangle((lo[0], -hi[2]), (hi[0], -lo[2]))
            edges += prism_edges(name, outline, WING_M, origin_m=(0, lo[1], 0), u=(1, 0, 0), v=(0, 0, -1))
        return edges

    def lumps(self, mass_kg: float) -> list[MassElement]:
        """Return both wings, of ``mass_kg`` each."""
        span = self.reach_m - self.root_x_m
        size = (span, WING_M, self.size_m[1])
        return [
            MassElement(f"wing {s}x", mass_kg, (sx * (self.root_x_m + span / 2), self.y_m, 0), size_m=size)
            for s, sx in (("+", 1), ("-", -1))
        ]
