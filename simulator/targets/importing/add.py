"""Import of a mesh file as a target: reads, places, checks, repairs and shades it, and proposes labels."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.decimation import decimate, deviation
from flyaround.simulator.targets.check_target import check_target
from flyaround.simulator.targets.convert import content_sha256
from flyaround.simulator.targets.glb.read import holds_target, load_glb
from flyaround.simulator.targets.importing.propose.keypoints import propose_keypoints
from flyaround.simulator.targets.importing.propose.mass import mass_properties
from flyaround.simulator.targets.importing.propose.near_symmetries import near_symmetries
from flyaround.simulator.targets.importing.propose.occluders import propose_occluders
from flyaround.simulator.targets.importing.propose.wireframe import propose_wireframe
from flyaround.simulator.targets.importing.read.mesh_file import read_mesh
from flyaround.simulator.targets.importing.read.raw_model import unique_names
from flyaround.simulator.targets.importing.read.textures import bake_textures
from flyaround.simulator.targets.importing.repair.cleanup import (
    RepairCounts,
    check_surface,
    drop_slivers,
    orient_body,
    weld_body,
)
from flyaround.simulator.targets.importing.repair.coincident_faces import coincidence_lines
from flyaround.simulator.targets.importing.repair.holes import cap_solids
from flyaround.simulator.targets.importing.repair.materials import replace_missing_textures, used_materials
from flyaround.simulator.targets.importing.repair.normals import (
    file_normals,
    normals_fit,
    smooth_normals,
    split_by_material,
)
from flyaround.simulator.targets.importing.repair.placement import (
    MAX_TRIANGLES,
    MIN_TRIANGLES,
    bounds,
    check_count,
    check_numbers,
    check_parts,
    place_model,
)
from flyaround.simulator.targets.model import Target

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.geometry.topology import MeshBody
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.importing.read.raw_model import RawModel
    from flyaround.simulator.targets.model import Material, Part


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """A user's options for importing a mesh.

    Parameters
    ----------
    scale : float, optional
        Factor from the file's unit to metres.
    units : str, optional
        Unit of the file instead of ``scale``: mm, cm, m or in.
    up : str, optional
        y or z.
    recentre : bool, optional
        True to move the origin to the centre of the bounding box.
    any_size : bool, optional
        True to accept any size, even one that is implausible for a spacecraft.
    decimate : int, optional
        Largest number of triangles, to which the mesh is reduced.
    strict : bool, optional
        True to refuse missing textures, and open, non-manifold or one-sided surfaces, unless an option allows them.
    fill_holes : bool, optional
        True to fill holes; by default they are filled if the result is a solid.
    keep_holes : bool, optional
        True to keep open surfaces.
    keep_non_manifold : bool, optional
        True to keep non-manifold surfaces.
    new_normals : bool, optional
        True to recompute normals even if the file's are consistent.
    mass_kg : float, optional
        Mass of the uniform solid.
    density_kg_m3 : float, optional
        Density of the uniform solid, instead of its mass.
    """

    scale: float | None = None
    units: str | None = None
    up: str | None = None
    recentre: bool = False
    any_size: bool = False
    decimate: int | None = None
    strict: bool = False
    fill_holes: bool = False
    keep_holes: bool = False
    keep_non_manifold: bool = False
    new_normals: bool = False
    mass_kg: float | None = None
    density_kg_m3: float | None = None


@dataclass
class Findings:
    """Messages about an import by severity: one line each, with the option that changes the outcome.

    Parameters
    ----------
    shape : list of str, optional
        Findings that affect poses, masks and labels.
    look : list of str, optional
        Findings that affect only images.
    repairs : list of str, optional
        Repairs that lose nothing.
    """

    shape: list[str] = field(default_factory=list)
    look: list[str] = field(default_factory=list)
    repairs: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        """Return all lines, the most severe first."""
        return [*self.shape, *self.look, *self.repairs]


def import_mesh(path: Path, name: str, options: ImportOptions | None = None) -> tuple[Target, list[str], str]:
    """Import a target from a mesh file.

    Parameters
    ----------
    path : Path
        Mesh file.
    name : str
        Name of the target.
    options : ImportOptions, optional
        Options of the user.

    Returns
    -------
    tuple
        The target; one line each on assumptions, repairs and losses; and a line that sums the target up.

    Raises
    ------
    UserError
        If the file cannot become a target; the message states reason and remedy.
    """
    options = options or ImportOptions()
    _check_weights(options)
    target_file = _target_file(path, name, options)
    if target_file is not None:
        note = "already a target file: geometry, keypoints, wireframe and mass taken as they are"
        return target_file, [note], _summary(target_file)
    model, bodies, extent, materials, parts, lines = read_surface(path, options)
    mass, derivation = mass_properties(bodies, options.mass_kg, options.density_kg_m3)
    keypoints = propose_keypoints(bodies, extent)
    wireframe, n_omitted = propose_wireframe(bodies, extent, materials)
    occluders = propose_occluders(bodies, extent)
    lines += _proposals(len(keypoints), len(wireframe), n_omitted, len(occluders.triangles))
    turns = near_symmetries(bodies)
    if turns:
        lines.append(
            f"the shape coincides with itself after {', or '.join(turns)}: hybrid compares shapes, not paint, and "
            "declines most poses of it as ambiguous"
        )
    lines.append(derivation)
    names_in_use = {p.material for p in parts}
    materials_in_use = tuple(m for m in materials if m.name in names_in_use)
    texture_names = {name for m in materials_in_use for name in m.textures if name}
    pictures = tuple(p for p in model.pictures.values() if p.name in texture_names)
    if pictures:
        lines.append(
            f"took {len(pictures)} texture{'s' * (len(pictures) > 1)}: {', '.join(p.name for p in pictures)}"
        )
    target = Target(
        name=name,
        title=f"{path.name}, imported",
        sha256=content_sha256(materials_in_use, parts, keypoints, wireframe, occluders, pictures),
        materials=materials_in_use,
        parts=tuple(parts),
        keypoints=keypoints,
        wireframe=wireframe,
        mass=mass,
        notes="Imported mesh. " + "; ".join(lines) + ".",
        occluders=occluders,
        pictures=pictures,
    )
    check_target(target, str(path))
    return target, lines, _summary(target, model.openings)


def read_surface(
    path: Path, options: ImportOptions
) -> tuple[RawModel, list[MeshBody], float, list[Material], list[Part], list[str]]:
    """Read a mesh file and place, check, repair and shade it: an import without labels and mass.

    Returns
    -------
    tuple
        The file's model, its bodies, the craft's extent [m], materials in use, parts, and lines for the user.

    Raises
    ------
    UserError
        As in `import_mesh`.
    """
    model = read_mesh(path)
    if options.strict and model.faults:
        raise UserError(f"{path}: {'; '.join(model.faults)}")
    check_numbers(model)
    check_count(model, options.decimate)
    check_parts(model)
    findings = Findings()
    findings.shape += place_model(
        model, options.scale, options.units, options.up, recentre=options.recentre, any_size=options.any_size
    )
    if options.decimate is not None and model.triangle_count > options.decimate:
        bake_textures(model)  # texture coordinates do not survive the reduction
    bodies, extent = _bodies(model, options, findings)
    findings.look += model.faults + model.notes
    all_materials, notes = replace_missing_textures(bodies, model.materials, model.pictures)
    findings.look += notes
    materials, notes = used_materials(bodies, all_materials)
    findings.look += notes
    parts = _parts(bodies, materials, options, findings.repairs)
    return model, bodies, extent, materials, parts, findings.lines()


def _check_weights(options: ImportOptions) -> None:
    for option, value in (("--mass", options.mass_kg), ("--density", options.density_kg_m3)):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise UserError(
                f"{option} {value:g} is not a positive number; give it in {'kg' if option == '--mass' else 'kg/m3'}"
            )


def _target_file(path: Path, name: str, options: ImportOptions) -> Target | None:
    """Return the target of a target file, if no option changes it; None for other files.

    A damaged target file is refused, because as a plain mesh it would silently lose its keypoints.
    """
    is_unchanged = replace(options, strict=False, any_size=False) == ImportOptions()
    if not is_unchanged or path.suffix.lower() != ".glb" or not holds_target(path):
        return None
    try:
        return replace(load_glb(path), name=name)
    except UserError as error:
        raise UserError(f"{error}; or add --units m to take it as a plain mesh with new keypoints") from error


def _bodies(model: RawModel, options: ImportOptions, findings: Findings) -> tuple[list[MeshBody], float]:
    """Return welded, reduced, filled and outward-facing bodies, and the craft's extent [m]."""
    low, high = bounds(model)
    extent = float((high - low).max())
    tally = RepairCounts()
    bodies = []
    for part in model.parts:
        body = weld_body(part, low, extent, tally)
        if len(body.triangles):
            bodies.append(body)
        else:
            findings.shape.append(f"part {part.name!r} has no face with area: left out")
    if not bodies:
        raise UserError(f"{model.path} has no face with area; export the model again")
    reduced = options.decimate is not None and sum(len(b.triangles) for b in bodies) > options.decimate
    if reduced and options.decimate is not None:
        n_before = sum(len(b.triangles) for b in bodies)
        original, bodies = bodies, decimate(bodies, options.decimate)
        deviation_m = deviation(original, bodies)
        bodies = [drop_slivers(b, extent, RepairCounts()) for b in bodies]
        bodies = [b for b in bodies if len(b.triangles)]
        n_after = sum(len(b.triangles) for b in bodies)
        if n_after > options.decimate:
            raise UserError(
                f"{model.path} cannot be reduced below {n_after:,} triangles: use --decimate {n_after} or more, or "
                "reduce it in the modelling tool"
            )
        findings.shape.append(
            f"reduced {n_before:,} triangles to {n_after:,}: {deviation_m.rms_m * 1e3:.3g} mm off in the mean (rms), "
            f"{deviation_m.largest_m * 1e3:.3g} mm at most"
        )
    if options.fill_holes:
        capped = cap_solids(bodies, extent)
        tally.filled_holes, tally.open_holes = capped.filled, capped.left
        bodies = [drop_slivers(b, extent, tally) for b in capped.bodies]
        n_capped = sum(len(b.triangles) for b in bodies)
        limit = MAX_TRIANGLES if options.decimate is None else options.decimate
        if n_capped > limit:
            findings.shape.append(
                f"the caps of its holes make {n_capped:,} triangles, more than {limit:,}"
                f" (--decimate {max(2 * limit - n_capped, MIN_TRIANGLES)} leaves room for them)"
            )
    oriented = _check_surfaces(model, bodies, options, tally, findings, reduced=reduced)
    findings.repairs += tally.lines()
    findings.shape += coincidence_lines(oriented, extent)
    return oriented, extent


def _check_surfaces(
    model: RawModel,
    bodies: list[MeshBody],
    options: ImportOptions,
    tally: RepairCounts,
    findings: Findings,
    *,
    reduced: bool,
) -> list[MeshBody]:
    """Orient the bodies outwards. Open and non-manifold edges are reported or, with ``strict``, refused."""
    holes = rims = non_manifold = one_sided = 0
    is_lenient = not options.strict or reduced  # reducing may open seams and merge edges
    oriented_bodies = []
    for body in bodies:
        source = f"{model.path}, part {body.name!r}"
        counts = check_surface(
            body,
            source,
            keep_holes=options.keep_holes or is_lenient,
            keep_non_manifold=options.keep_non_manifold or is_lenient,
            tried_to_fill=options.fill_holes,
        )
        holes, rims, non_manifold = holes + counts[0], rims + counts[1], non_manifold + counts[2]
        oriented_body, twisted = orient_body(
            body, source, tally, lenient=options.keep_non_manifold or is_lenient
        )
        oriented_bodies.append(oriented_body)
        one_sided += twisted
    model.openings = holes
    if holes:
        findings.shape.append(
            f"kept {holes:,} open outlines ({rims:,} open edges) as sheets seen from both sides"
            + (" (--fill-holes caps those that then bound a solid)" if not options.fill_holes else "")
        )
    if non_manifold:
        advice = "" if options.keep_non_manifold else " (--strict refuses them and names the first)"
        findings.shape.append(f"kept {non_manifold:,} edges of three or more faces{advice}")
    if one_sided:
        findings.shape.append(
            f"kept {one_sided:,} faces of one-sided surfaces (--strict refuses them and names the first)"
        )
    return oriented_bodies


def _parts(
    bodies: list[MeshBody], materials: list[Material], options: ImportOptions, lines: list[str]
) -> list[Part]:
    parts: list[Part] = []
    n_taken = n_flat = n_wrong = 0
    for body in bodies:
        if not options.new_normals and normals_fit(body):
            normals: FloatArray = file_normals(body)
            n_taken += 1
        else:
            n_flat += body.corner_normals is None
            n_wrong += body.corner_normals is not None
            normals = smooth_normals(body)
        parts += split_by_material(body, normals, materials)
    if n_flat:
        lines.append(
            f"computed normals of {n_flat} part{'s' * (n_flat > 1)} that had none, creased at 32 degrees"
        )
    if n_wrong:
        why = "as requested" if options.new_normals else "that pointed inwards or were no unit vectors"
        lines.append(
            f"computed normals anew of {n_wrong} part{'s' * (n_wrong > 1)} {why}, creased at 32 degrees"
        )
    names = unique_names((p.name for p in parts), "part")
    return [replace(p, name=n) for p, n in zip(parts, names, strict=True)]


def _summary(target: Target, openings: int | None = None) -> str:
    """Return a summary of the target: size, parts, triangles and, if counted, openings."""
    size = np.ptp(np.concatenate([p.positions_m for p in target.parts]), axis=0)
    triangles, parts = sum(len(p.triangles) for p in target.parts), len(target.parts)
    size_text = (
        f"{' x '.join(f'{s:.4g}' for s in size)} m, {parts} part{'s' * (parts != 1)}, "
        f"{triangles:,} triangle{'s' * (triangles != 1)}"
    )
    if openings is not None:
        size_text += f", {openings:,} open outline{'s' * (openings != 1)}" if openings else ", closed"
    return f"{target.name}: {size_text}"


def _proposals(keypoints: int, edges: int, n_omitted: int, occluders: int) -> list[str]:
    line = f"proposed {keypoints} keypoints, {edges} edges of the wireframe, {occluders} occluder triangles"
    if n_omitted:
        line += f" ({n_omitted} edges that show less left out)"
    lines = [line]
    if edges < 8:  # a box has 12, of which 9 are visible
        lines.append(
            f"only {edges} sharp edges: the built-in estimator looks for edges and will hardly find this shape"
        )
    if keypoints < 12:  # of the N_KEYPOINTS that are proposed where a shape has as many
        lines.append(f"only {keypoints} keypoints: the shape has no more distinct corners")
    return lines
