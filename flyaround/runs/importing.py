"""Options of ``flyaround targets add``."""

from __future__ import annotations

from typing import Annotated, ClassVar

import typer

from flyaround.runs.document import NOT_RECORDED, Only, Run
from flyaround.runs.fields import File
from flyaround.simulator.runtime.sections import Section


class MeshFrame(Section, frozen=True, kw_only=True):
    """Unit, axes and origin of the mesh."""

    scale: Annotated[float | None, typer.Option(help="Factor from the file's unit to metres.")] = None
    units: Annotated[str | None, typer.Option(help="The file's unit: mm, cm, m or in.")] = None
    up: Annotated[str | None, typer.Option(help="The file's up axis: y or z (default: y for glTF).")] = None
    recentre: Annotated[
        bool,
        typer.Option("--recentre", help="Move the origin, to which poses refer, to the centre of the mesh."),
    ] = False
    any_size: Annotated[
        bool, typer.Option("--yes", help="Accept an implausible size, below 0.05 m or above 150 m.")
    ] = False


class Surface(Section, frozen=True, kw_only=True):
    """Repair options of the surface."""

    decimate: Annotated[int | None, typer.Option(help="Largest number of triangles.")] = None
    strict: Annotated[
        bool,
        typer.Option(
            "--strict", help="Refuse missing files, open outlines, branching and one-sided surfaces."
        ),
    ] = False
    fill_holes: Annotated[
        bool, typer.Option("--fill-holes", help="Cap openings if the result is a solid.")
    ] = False
    keep_holes: Annotated[
        bool,
        typer.Option("--keep-holes", help="With --strict: allow open surfaces, as two-sided sheets."),
    ] = False
    keep_non_manifold: Annotated[
        bool, typer.Option("--keep-non-manifold", help="With --strict: allow edges with three or more faces.")
    ] = False
    new_normals: Annotated[
        bool, typer.Option("--new-normals", help="Compute normals even if those in the file are consistent.")
    ] = False


class Craft(Section, frozen=True, kw_only=True):
    """Mass and parts of the craft."""

    classes: Annotated[
        File | None, typer.Option(help="TOML file that sets the classes of parts by their names.")
    ] = None
    mass_kg: Annotated[float | None, typer.Option("--mass", help="Mass of the craft [kg].")] = None
    density_kg_m3: Annotated[
        float | None,
        typer.Option(
            "--density", help="Mean density of the craft, if it is solid, instead of its mass [kg/m3]."
        ),
    ] = None


class ImportRun(Run, frozen=True, kw_only=True, tag="flyaround.run.targets-add"):
    """Options of ``flyaround targets add``: import a mesh as a target."""

    file: Annotated[
        File,
        typer.Argument(
            help="A mesh: .glb .gltf .obj .stl, with the extra meshes also .ply .off .dae .3mf .step."
        ),
    ]
    name: Annotated[str | None, typer.Option(help="Name of the target (default: the file name).")] = None
    replace: Annotated[
        bool, typer.Option("--replace", help="Overwrite a target of this name."), NOT_RECORDED
    ] = False
    sheet: Annotated[
        bool,
        typer.Option("--sheet/--no-sheet", help="Render a contact sheet next to the target."),
        NOT_RECORDED,
    ] = True
    RULES: ClassVar[tuple[Only, ...]] = (
        Only(
            "craft.density_kg_m3",
            "craft.mass_kg",
            (None,),
            "--density gives the mass of solids, so it cannot be combined with --mass; leave one out",
        ),
    )
    frame: MeshFrame = MeshFrame()
    surface: Surface = Surface()
    craft: Craft = Craft()
