"""A pair of solar wings along +x and -x, their cells towards +y, with the labels of their panels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.targets.builders.assembly import Piece
from flyaround.simulator.targets.builders.labels import box_edges, moved_edges
from flyaround.simulator.targets.builders.mass import MassElement
from flyaround.simulator.targets.builders.mesh import Mesh, merge
from flyaround.simulator.targets.builders.wing import (
    Wing,
    wing_cells,
    wing_hinges,
    wing_panels,
    wing_ribs,
    wing_yoke,
)
from flyaround.simulator.targets.craft.level import Level
from flyaround.simulator.targets.model import Edge

AXES = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""Columns: the wing's own x, y, z in the model frame, on the +x side. A reflection: y to z, z to y."""
MIRROR_X = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True, kw_only=True)
class SideWings:
    """Two wings and where they are mounted.

    Parameters
    ----------
    wing : dimensions of one. root_m : x of the yoke's foot. z_m : height of the long axis.
    spread : width of the yoke's fork, of the chord. section_m : of the yoke's bars.
    ribs : stiffeners across the back of each panel. rib_m : their depth.
    cells, panels, back : names of materials.
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
        """Both wings at a level of detail."""
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
        """All panels of both wings as plain boxes."""
        right = self._place(wing_panels(self.wing))
        return merge([right, right.mirrored(0)])

    def corners(self) -> dict[str, Vec3]:
        """Corners of both wings on the cells' side, by name."""
        w, y, half = self.wing, self.wing.thickness_m / 2, self.wing.chord_m / 2
        return {
            f"wing_{side}_{at}_{end}": (sign * x, y, self.z_m + z)
            for side, sign in (("px", 1.0), ("nx", -1.0))
            for at, x in (("tip", w.tip_m), ("root", w.first_m))
            for end, z in (("aft", -half), ("fore", half))
        }

    def edges(self) -> list[Edge]:
        """The twelve edges of every panel."""
        edges = []
        for k, (lo, hi) in enumerate(self.wing.boxes()):
            panel = moved_edges(box_edges(f"panel_{k + 1}", lo, hi), AXES, (0, 0, self.z_m))
            edges += moved_edges(panel, np.eye(3), (0, 0, 0), "px_")
            edges += moved_edges(panel, MIRROR_X, (0, 0, 0), "nx_")
        return edges

    def lumps(self, mass_kg: float) -> list[MassElement]:
        """Each wing as a plate of ``mass_kg``."""
        w = self.wing
        middle = (w.tip_m + w.first_m) / 2
        return [
            MassElement(
                name=f"wing {side}",
                mass_kg=mass_kg,
                centre_m=vec3(np.array([sign * middle, 0.0, self.z_m])),
                size_m=(w.tip_m - w.first_m, w.thickness_m, w.chord_m),
            )
            for side, sign in (("+x", 1), ("-x", -1))
        ]

    def _place(self, mesh: Mesh) -> Mesh:
        # the reflection y <-> z is a mirror of y followed by a quarter turn about x
        return mesh.mirrored(1).rotated(AXES @ np.diag([1.0, -1.0, 1.0])).moved((0, 0, self.z_m))
