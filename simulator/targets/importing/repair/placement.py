"""Placement of a mesh: scale, axes, and plausibility of its size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.topology import used_vertices
from flyaround.simulator.runtime.arrays import FloatArray, vec3
from flyaround.simulator.targets.importing.read.raw_model import RawModel

UNITS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
UNIT_NAMES = {"mm": "millimetres", "cm": "centimetres", "m": "metres", "in": "inches"}
MIN_SIZE_M, MAX_SIZE_M = 0.05, 150.0
"""Sizes accepted without ``--yes``: from a PocketQube (50 mm) to beyond the International Space Station (109 m)."""
MIN_DRAWABLE_M, MAX_DRAWABLE_M = 0.005, 10_000.0
"""Sizes that the depth buffer and the ranges of the cameras support [m]."""
MAX_PROPOSED_SIZE_M = 30.0
"""Largest size for which a unit is proposed."""
MIN_TRIANGLES, MAX_TRIANGLES, MAX_PARTS = 500, 500_000, 4000
"""Largest number of triangles, and of parts, of a target. They bound memory and the time to draw a frame."""
ORIGIN_OFFSET_WARNING, MAX_ORIGIN_OFFSET = 0.1, 100.0
"""Distance of the origin from the model, in extents, that is reported; and that loses too much precision."""


def check_numbers(model: RawModel) -> None:
    """Check that vertices are finite, and that triangles refer to existing ones.

    Raises
    ------
    UserError
        If there are some; the message names the part, the number, and the first.
    """
    for part in model.parts:
        source = f"{model.path}, part {part.name!r}"
        bad = np.asarray(~np.isfinite(part.positions_m).all(axis=1))
        if bad.any():
            raise UserError(
                f"{source}: {int(bad.sum())} of {len(bad)} vertices are not finite (the first is vertex "
                f"{int(np.argmax(bad))}); delete them in the modelling tool and export again"
            )
        wrong = ((part.triangles < 0) | (part.triangles >= len(part.positions_m))).any(axis=1)
        if wrong.any():
            face = int(np.argmax(wrong))
            raise UserError(
                f"{source}: {int(wrong.sum())} triangles use vertices that are not there (the first, triangle {face}, "
                f"uses {int(part.triangles[face].max())} of {len(part.positions_m)}); export it again"
            )


def check_count(model: RawModel, decimate: int | None) -> None:
    """Check that there are not more triangles than can be drawn and labelled, unless they will be reduced.

    Raises
    ------
    UserError
        If there are; the message states the count and the option.
    """
    # fewer than 500 triangles hold no spacecraft's shape
    if decimate is not None and not MIN_TRIANGLES <= decimate <= MAX_TRIANGLES:
        raise UserError(
            f"--decimate {decimate} is out of range; choose {MIN_TRIANGLES} to {MAX_TRIANGLES} triangles"
        )
    if decimate is None and model.triangle_count > MAX_TRIANGLES:
        raise UserError(
            f"{model.path} has {model.triangle_count:,} triangles and at most {MAX_TRIANGLES:,} are taken; add "
            "--decimate 200000, or reduce it in the modelling tool"
        )


def check_parts(model: RawModel) -> None:
    """Check that there are not too many parts, each of which is a body with labels of its own.

    Raises
    ------
    UserError
        If there are; the message states the count.
    """
    if len(model.parts) > MAX_PARTS:
        raise UserError(
            f"{model.path} has {len(model.parts):,} parts and at most {MAX_PARTS:,} are taken; join them in the "
            "modelling tool"
        )


def place_model(
    model: RawModel,
    scale: float | None,
    units: str | None,
    up: str | None,
    *,
    recentre: bool = False,
    any_size: bool = False,
) -> list[str]:
    """Convert the model to metres and z up, in place; return the assumptions.

    Parameters
    ----------
    model : RawModel
        Model to convert.
    scale : float or None
        Metres per unit of the file.
    units : str or None
        Name of the file's unit, instead of ``scale``.
    up : str or None
        Up axis, ``y`` or ``z``; by default the format's.
    recentre : bool, optional
        True to move the origin to the centre of the bounding box.
    any_size : bool, optional
        True to accept a size that no spacecraft has.

    Raises
    ------
    UserError
        If the result is not the size of a spacecraft (the message proposes a unit), or so far from its origin that
        float32 cannot hold its shape.
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
    is_stated = scale is not None or units is not None
    low, high = bounds(model)
    extent = float((high - low).max()) * factor
    unusual = _check_size(model, extent, factor, is_stated=is_stated, any_size=any_size)
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
    if is_stated:
        scale_note = f"scaled by {factor:g}"
    else:
        scale_note = (
            ("glTF is in metres" if model.kind == "gltf" else f"by the unit that the {model.kind} file names")
            if model.in_metres
            else "taken as metres, because the file names no unit: --units mm, cm or in if it is not"
        )
    axes_note = "y turned to z (up)" if axis == "y" else "axes as in the file, z up"
    axes_note += "" if up else f" (--up {'z' if axis == 'y' else 'y'} if that is wrong)"
    return [
        *unusual,
        f"size {size} m ({scale_note}); {axes_note}",
        *_origin_lines(model, low, high, recentre=recentre),
    ]


def _origin_lines(model: RawModel, low: FloatArray, high: FloatArray, *, recentre: bool) -> list[str]:
    """Move the origin on request; otherwise return a warning if it is off the model."""
    middle = (low + high) / 2
    extent = float((high - low).max())
    middle_text = ", ".join(f"{x:.4g}" for x in middle)
    if recentre:
        for part in model.parts:
            part.positions_m = part.positions_m - middle
        return [f"moved the origin by ({middle_text}) m, to the middle of the box about the model"]
    off_box = float(np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0)))
    if off_box > MAX_ORIGIN_OFFSET * extent:
        raise UserError(
            f"{model.path} is {off_box:.4g} m away from its origin, too far for single precision to hold a shape of "
            f"{extent:.4g} m; add --recentre to move the origin to its middle"
        )
    if off_box <= ORIGIN_OFFSET_WARNING * extent:
        return []
    distance = float(np.linalg.norm(middle))
    line = (
        f"the file's origin is {distance:.4g} m from the middle of a craft {extent:.4g} m across (at ({middle_text}) "
        "m): poses, and the range of recipes, are the origin's; add --recentre to move it to the middle"
    )
    return [line]


def _check_size(
    model: RawModel, extent_m: float, factor: float, *, is_stated: bool, any_size: bool
) -> list[str]:
    """Raise for a size that no spacecraft has, or return a line about it if the user confirms it."""
    if MIN_SIZE_M <= extent_m <= MAX_SIZE_M:
        return []
    if not MIN_DRAWABLE_M <= extent_m <= MAX_DRAWABLE_M and (any_size or extent_m == 0):
        raise UserError(
            f"{model.path} would be {extent_m:.4g} m across, which cannot be drawn ({MIN_DRAWABLE_M:g} to "
            f"{MAX_DRAWABLE_M:,.0f} m can); correct --units or --scale"
        )
    if any_size:
        return [
            f"{extent_m:.4g} m across, outside the sizes of spacecraft ({MIN_SIZE_M:g} to {MAX_SIZE_M:g} m): confirmed"
        ]
    across = f"{extent_m:.4g} m across" + (f" (scaled by {factor:g})" if is_stated else "")
    confirm = (
        "--yes if it is that size"
        if MIN_DRAWABLE_M <= extent_m <= MAX_DRAWABLE_M
        else "--scale with the factor to metres"
    )
    raise UserError(
        f"{model.path} is {across}, not the size of a spacecraft ({MIN_SIZE_M:g} to {MAX_SIZE_M:g} m); "
        f"{_proposed_unit(extent_m / factor, units_in_metres=factor)}{confirm}"
    )


def _proposed_unit(extent: float, units_in_metres: float) -> str:
    """Return advice on the most plausible unit for a craft of ``extent`` units, if there is one."""
    fits = [
        u
        for u, m in UNITS_M.items()
        if m != units_in_metres and MIN_SIZE_M <= extent * m <= MAX_PROPOSED_SIZE_M
    ]
    if not fits:
        return (
            f"add --scale with the factor to metres (--scale {1 / extent:.3g} makes it 1 m), or "
            if extent
            else ""
        )
    unit = next(u for u in ("mm", "m", "cm", "in") if u in fits)
    other_units = "".join(f", --units {u} ({extent * UNITS_M[u]:.3g} m)" for u in fits if u != unit)
    return f"add --units {unit} if it is in {UNIT_NAMES[unit]} ({extent * UNITS_M[unit]:.3g} m){other_units}, or "


def bounds(model: RawModel) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest corner of the vertices in use."""
    vertices = [p.positions_m[used_vertices(p.triangles, len(p.positions_m))] for p in model.parts]
    return (
        np.min([u.min(axis=0) for u in vertices], axis=0),
        np.max([u.max(axis=0) for u in vertices], axis=0),
    )


def z_up_from_y_up(v: FloatArray) -> FloatArray:
    """Rotate by a quarter turn about x: y becomes z, z becomes -y."""
    return np.stack([v[:, 0], -v[:, 2], v[:, 1]], axis=1)
