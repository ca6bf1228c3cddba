"""Scale, axes and the numbers themselves: vertices that are real, on something the size of a spacecraft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from simulator.errors import UserError
from simulator.runtime.arrays import FloatArray, vec3
from simulator.targets.importing.read.raw_model import RawModel
from simulator.targets.importing.repair.topology import used_vertices

UNITS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
UNIT_NAMES = {"mm": "millimetres", "cm": "centimetres", "m": "metres", "in": "inches"}
SMALLEST_M, LARGEST_M = 0.03, 150.0
"""From a printed-circuit satellite to the International Space Station (109 m); outside it the unit must be said."""
SMALLEST_SAID_M, LARGEST_SAID_M = 0.005, 1000.0
MOST_TRIANGLES, MOST_PARTS = 500_000, 4000
OFF, FARTHEST = 0.1, 100.0
"""Extents between origin and model beyond which it is said, and beyond which vertices lose 1e-5 of the craft."""


def check_numbers(model: RawModel) -> None:
    """Refuse vertices that are not finite and triangles that use vertices which are not there.

    Raises
    ------
    UserError
        Naming the part, how many, and the first.
    """
    for part in model.parts:
        where = f"{model.path}, part {part.name!r}"
        bad = np.asarray(~np.isfinite(part.positions_m).all(axis=1))
        if bad.any():
            raise UserError(
                f"{where}: {int(bad.sum())} of {len(bad)} vertices are not finite (the first is vertex "
                f"{int(np.argmax(bad))}); delete them in the modelling tool and export again"
            )
        wrong = ((part.triangles < 0) | (part.triangles >= len(part.positions_m))).any(axis=1)
        if wrong.any():
            face = int(np.argmax(wrong))
            raise UserError(
                f"{where}: {int(wrong.sum())} triangles use vertices that are not there (the first, triangle {face}, "
                f"uses {int(part.triangles[face].max())} of {len(part.positions_m)}); export it again"
            )


def check_count(model: RawModel, decimate: int | None) -> None:
    """Refuse more triangles than can be drawn and labelled, unless they will be reduced.

    Raises
    ------
    UserError
        Naming the count and the option.
    """
    if decimate is not None and not 500 <= decimate <= MOST_TRIANGLES:
        raise UserError(f"--decimate {decimate} is out of range; choose 500 to {MOST_TRIANGLES} triangles")
    if decimate is None and model.triangle_count > MOST_TRIANGLES:
        raise UserError(
            f"{model.path} has {model.triangle_count:,} triangles and at most {MOST_TRIANGLES:,} are taken; add "
            "--decimate 200000, or reduce it in the modelling tool"
        )


def check_parts(model: RawModel) -> None:
    """Refuse more parts than a craft has: each is a body with labels of its own.

    Raises
    ------
    UserError
        Naming the count.
    """
    if len(model.parts) > MOST_PARTS:
        raise UserError(
            f"{model.path} has {len(model.parts):,} parts and at most {MOST_PARTS:,} are taken; join them in the "
            "modelling tool"
        )


def place_model(
    model: RawModel, scale: float | None, units: str | None, up: str | None, *, recentre: bool = False
) -> list[str]:
    """Bring the model to metres and its up axis to z, in place; says what was assumed.

    Parameters
    ----------
    recentre : move the origin to the middle of the box about the model.

    Raises
    ------
    UserError
        If the result is not the size of a spacecraft, with the unit that would make it one; or so far from its origin
        that float32 cannot hold its shape.
    """
    if scale is not None and units is not None:
        raise UserError("give --scale or --units, not both; --units mm is --scale 0.001")
    if units is not None and units not in UNITS_M:
        raise UserError(f"unknown unit {units!r} in --units; choose from {', '.join(UNITS_M)}")
    if up is not None and up not in ("y", "z"):
        raise UserError(f"unknown axis {up!r} in --up; choose y or z")
    if scale is not None and not (np.isfinite(scale) and scale > 0):
        raise UserError(f"--scale {scale:g} is not a positive number; 0.001 turns millimetres into metres")
    factor = scale if scale is not None else UNITS_M[units] if units is not None else 1.0
    said = scale is not None or units is not None
    low, high = bounds(model)
    extent = float((high - low).max()) * factor
    _check_size(model, extent, said=said)
    axis = up or model.up or "z"
    for part in model.parts:
        part.positions_m = part.positions_m * factor
        if axis == "y":
            part.positions_m = z_up_from_y_up(part.positions_m)
            part.normals = None if part.normals is None else z_up_from_y_up(part.normals)
    if axis == "y":
        model.materials = [
            replace(m, grain=vec3(z_up_from_y_up(np.array([m.grain]))[0])) for m in model.materials
        ]
    low, high = bounds(model)
    size = " x ".join(f"{s:.4g}" for s in high - low)
    if said:
        how = f"scaled by {factor:g}"
    else:
        how = "glTF is in metres" if model.in_metres else "taken as metres, for the file names no unit"
    turned = "y turned to z (up)" if axis == "y" else "axes as in the file, z up"
    return [f"size {size} m ({how}); {turned}", *_origin_lines(model, low, high, recentre=recentre)]


def _origin_lines(model: RawModel, low: FloatArray, high: FloatArray, *, recentre: bool) -> list[str]:
    """Move the origin if told so; else a warning where it is off the model, for poses are the origin's."""
    middle = (low + high) / 2
    extent = float((high - low).max())
    at = ", ".join(f"{x:.4g}" for x in middle)
    if recentre:
        for part in model.parts:
            part.positions_m = part.positions_m - middle
        return [f"moved the origin by ({at}) m, to the middle of the box about the model"]
    off_box = float(np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0)))
    if off_box > FARTHEST * extent:
        raise UserError(
            f"{model.path} is {off_box:.4g} m away from its origin, too far for single precision to hold a shape of "
            f"{extent:.4g} m; add --recentre to move the origin to its middle"
        )
    if off_box <= OFF * extent:
        return []
    distance = float(np.linalg.norm(middle))
    line = (
        f"the file's origin is {distance:.4g} m from the middle of a craft {extent:.4g} m across (at ({at}) m): "
        "poses, and the range of recipes, are the origin's; add --recentre to move it to the middle"
    )
    return [line]


def _check_size(model: RawModel, extent: float, *, said: bool) -> None:
    low, high = (SMALLEST_SAID_M, LARGEST_SAID_M) if said else (SMALLEST_M, LARGEST_M)
    if low <= extent <= high:
        return
    if said or extent == 0:
        raise UserError(
            f"{model.path} would be {extent:.4g} m across, which is no spacecraft; correct --units or --scale"
        )
    # the unit under which it is likeliest a craft: the largest that makes it one
    fits = [u for u in ("cm", "in", "mm") if SMALLEST_M <= extent * UNITS_M[u] <= 30.0]
    if extent > high and fits:
        unit = "mm" if "mm" in fits else fits[0]
        hint = f"say --units {unit} if it is in {UNIT_NAMES[unit]} ({extent * UNITS_M[unit]:.3g} m)"
    elif extent > high:
        hint = "say --scale with the factor to metres"
    else:
        hint = (
            "say --units m if it is that small, or --scale with the factor to metres "
            f"(--scale {1 / extent:.3g} makes it 1 m)"
        )
    raise UserError(
        f"{model.path} is {extent:.4g} m across, not the size of a spacecraft "
        f"({SMALLEST_M:g} to {LARGEST_M:g} m); {hint}"
    )


def bounds(model: RawModel) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner of the vertices that triangles use."""
    used = [p.positions_m[used_vertices(p.triangles, len(p.positions_m))] for p in model.parts]
    return (
        np.min([u.min(axis=0) for u in used], axis=0),
        np.max([u.max(axis=0) for u in used], axis=0),
    )


def z_up_from_y_up(v: FloatArray) -> FloatArray:
    """A quarter turn about x: y becomes z, z becomes -y."""
    return np.stack([v[:, 0], -v[:, 2], v[:, 1]], axis=1)
