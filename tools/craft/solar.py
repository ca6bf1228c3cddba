"""Solar panels: a stiff board with rows of cells and their busbars, lying in the x-y plane with the cells up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flyaround.simulator.targets.model import Detail
from tools.craft.assemble import Piece
from tools.craft.shapes.mesh import Mesh, merge
from tools.craft.shapes.prism import cell_grid, clipped_rectangle, rectangle
from tools.craft.shapes.solids import box


@dataclass(frozen=True, kw_only=True)
class CellField:
    """Layout of cells on a board.

    Parameters
    ----------
    columns : int
        Number of cells along x.
    rows : int
        Number of cells along y.
    pitch_x_m : float
        Distance between centres of neighbouring cells along x.
    pitch_y_m : float
        Distance between centres of neighbouring cells along y.
    gap_m : float, optional
        Free space between two cells.
    clip_m : float, optional
        Cut of a cell's corners; 0 for none.
    height_m : float, optional
        Thickness of cell and cover glass above the board.
    """

    columns: int
    rows: int
    pitch_x_m: float
    pitch_y_m: float
    gap_m: float = 0.002
    clip_m: float = 0.0
    height_m: float = 0.001

    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the centres of columns and rows about the origin [m]."""
        return (
            (np.arange(self.columns) - (self.columns - 1) / 2) * self.pitch_x_m,
            (np.arange(self.rows) - (self.rows - 1) / 2) * self.pitch_y_m,
        )


def cells(field: CellField, z_m: float, detail: Detail) -> Mesh:
    """Return the cells of a field on the plane at ``z_m``: clipped tiles, plain tiles at medium, one sheet at low."""
    w, h = field.pitch_x_m - field.gap_m, field.pitch_y_m - field.gap_m
    if detail == "low":
        x = field.columns * field.pitch_x_m / 2 - field.gap_m / 2
        y = field.rows * field.pitch_y_m / 2 - field.gap_m / 2
        return box((-x, -y, z_m), (x, y, z_m + field.height_m))
    if field.clip_m > 0 and detail == "full":
        tile = clipped_rectangle(w, h, field.clip_m, "all")
    else:
        tile = rectangle((-w / 2, -h / 2), (w / 2, h / 2))
    return cell_grid(*field.centres(), tile, z_m, field.height_m)


def busbars(field: CellField, z_m: float, width_m: float, detail: Detail) -> list[Mesh]:
    """Return the bright ribbons on the cells, two along each column, a tenth of a cell's height proud; full detail
    only.
    """
    if detail != "full":
        return []
    xs, ys = field.centres()
    reach = (field.pitch_y_m - field.gap_m) / 2 * 0.96
    top = z_m + field.height_m
    ribbon = rectangle((-width_m / 2, -reach), (width_m / 2, reach))
    positions = np.concatenate([xs - field.pitch_x_m / 4, xs + field.pitch_x_m / 4])
    # sunk into the cell: no two faces in one plane
    return [cell_grid(positions, ys, ribbon, top - 0.5e-4, 1.5e-4)]


def panel(
    name: str,
    size_m: tuple[float, float],
    thickness_m: float,
    field: CellField,
    *,
    detail: Detail,
    board: str,
    cell: str,
    busbar_m: float = 0.0,
) -> list[Piece]:
    """Return a board of ``size_m`` about the origin, its upper face at z = 0, with cells on it.

    Parameters
    ----------
    name : str
        Common part of the pieces' names.
    size_m : tuple of float
        Size along x and y.
    thickness_m : float
        Thickness of the board.
    field : CellField
        Arrangement of the cells.
    detail : Detail
        Level of detail.
    board : str
        Material of the board.
    cell : str
        Material of the cells.
    busbar_m : float, optional
        Width of the ribbons on the cells; 0 for none.
    """
    x, y = size_m[0] / 2, size_m[1] / 2
    pieces = [
        Piece(f"{name}_board", board, box((-x, -y, -thickness_m), (x, y, 0.0))),
        Piece(f"{name}_cells", cell, cells(field, 0.0, detail)),
    ]
    ribbons = busbars(field, 0.0, busbar_m, detail) if busbar_m > 0 else []
    if ribbons:
        pieces.append(Piece(f"{name}_busbars", "busbar", merge(ribbons)))
    return pieces
