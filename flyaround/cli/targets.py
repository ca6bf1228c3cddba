"""targets: list the targets, render their contact sheet, add or remove a user's mesh."""

from __future__ import annotations

import json
from dataclasses import replace as changed
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.table import Table

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.hil.board_model.outer_faces import MAX_TRIANGLES
from flyaround.hil.board_model.write import write_board_model
from flyaround.runs.document import write_run
from flyaround.runs.importing import ImportRun
from flyaround.simulator.contact_sheets.targets_page import write_contact_sheet
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.part_classes import class_report, classes_from_file, target_classes
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.scenario.load import toml_table
from flyaround.simulator.targets.glb.write import write_glb
from flyaround.simulator.targets.importing.add import ImportOptions, import_mesh
from flyaround.simulator.targets.installed import check_name, install, sheet_folder, user_targets
from flyaround.simulator.targets.installed import remove as remove_target
from flyaround.simulator.targets.library import built_in_targets, list_targets, load_target
from flyaround.simulator.targets.model import PartClass, Target

# Maximum size of an accepted file of part classes [bytes].
LARGEST_CLASSES_BYTES = 1 << 20


def overview(
    context: typer.Context,
    export: Annotated[
        Path | None, typer.Option(help="Write NAME.glb and NAME.board.json of every target to this folder.")
    ] = None,
    contact_sheet: Annotated[
        Path | None,
        typer.Option(
            "--contact-sheet", help="Render every target: a page index.html with pictures in this folder."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the targets, export them, or render their contact sheet."""
    if context.invoked_subcommand is not None:
        return
    if export is not None:
        empty_folder(export, option="--export")
    rows = _load_targets()
    if export is not None:
        for t in rows:
            write_glb(t, export / f"{t.name}.glb")
            write_board_model(t, export / f"{t.name}.board.json")
    if contact_sheet is not None:
        folder = contact_sheet.parent if contact_sheet.suffix == ".html" else contact_sheet
        page = "index.html" if folder == contact_sheet else contact_sheet.name
        with progress_bar("contact sheet", quiet=as_json) as progress:
            page_path = write_contact_sheet(rows, folder, page=page, progress=progress)
        say(f"{page_path}", stderr=as_json)
    if as_json:
        typer.echo(json.dumps([_summary(t) for t in rows]))
    elif contact_sheet is None:
        _print_table(rows)


@with_run_options
def add(
    run: ImportRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print a report as JSON.")] = False,
) -> None:
    """Import a mesh as a target: check it, repair it if safe, propose keypoints and a wireframe."""
    file, craft = Path(run.file), run.craft
    name = run.name if run.name is not None else _target_name(file)
    check_name(name, built_in_targets(), replace=run.replace)
    options = ImportOptions(
        **msgspec.structs.asdict(run.frame),
        **msgspec.structs.asdict(run.surface),
        mass_kg=craft.mass_kg,
        density_kg_m3=craft.density_kg_m3,
    )
    target, findings, summary = import_mesh(file, name, options)
    if craft.classes is not None:
        part_classes = _read_classes(Path(craft.classes), target)
        target = changed(target, part_classes={**target.part_classes, **part_classes})
    findings += class_report(target)
    warning = _missing_network_warning(target)
    path = install(target)
    write_run(path, run)
    page = _write_sheet(target) if run.sheet else None
    if as_json:
        document = _summary(target) | {
            "path": str(path),
            "report": [*findings, summary],
            "part_classes": dict(zip((p.name for p in target.parts), target_classes(target), strict=True)),
            "contact_sheet": str(page) if page else None,
            "estimator": warning or "",
        }
        typer.echo(json.dumps(document))
        return
    for line in findings:
        say(f"- {line}")
    say(f"target {name!r} in {path}")
    if page is not None:
        say(f"look at it: {page}")
    say("exposure: [sensor] exposure_s of your scenario; capture reports the saturated share of the craft")
    say(f"{summary}; estimator: {warning or 'a trained network is shipped'}")


def _read_classes(path: Path, target: Target) -> dict[str, PartClass]:
    try:
        content = read_regular(path, LARGEST_CLASSES_BYTES)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}: name a file of part classes") from error
    return classes_from_file(toml_table(content, str(path)), str(path), [p.name for p in target.parts])


def _missing_network_warning(target: Target) -> str | None:
    """Return a warning that no keypoint network is trained for a target; None if one is shipped."""
    from flyaround.hil.board.hybrid.propose.keypoints.network import has_shipped_head  # noqa: PLC0415 - slow to import, and rarely needed

    if has_shipped_head(target.name):
        return None
    n = sum(len(p.triangles) for p in target.parts)
    heavy = f"its {n:,} triangles are too many for it to render: use --decimate {MAX_TRIANGLES}; "
    return (heavy if n > MAX_TRIANGLES else "") + (
        "no keypoint network is trained for it: expect fewer correct poses, and few accepted; "
        f"train one with flyaround train --craft {target.name} (pip install 'flyaround[train]')"
    )


def remove(
    name: Annotated[str, typer.Argument(help="Name of an added target.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Remove an added target."""
    path = remove_target(name, built_in_targets())
    if as_json:
        typer.echo(json.dumps({"removed": name, "path": str(path)}))
    else:
        say(f"removed {name!r} ({path})")


def _target_name(file: Path) -> str:
    """Return a target name for a file: lower case, other characters replaced by hyphens."""
    plain = "".join(c if c.isalnum() and c.isascii() else "-" for c in file.stem.lower())
    return "-".join(piece for piece in plain.split("-") if piece) or "mesh"


def _write_sheet(target: Target) -> Path | None:
    """Render the target's contact sheet next to its file; if it cannot be rendered or written, print why."""
    try:
        return write_contact_sheet([target], sheet_folder(target.name))
    except UserError as error:
        say(f"no contact sheet: {error}", stderr=True)
        return None


def _load_targets() -> list[Target]:
    """Return all targets; a user's target that cannot be read is reported and skipped."""
    rows = []
    for name in list_targets():
        try:
            rows.append(load_target(name))
        except UserError as error:
            if name not in user_targets():
                raise
            say(f"target {name!r} is skipped: {error}", stderr=True)
    return rows


def _summary(t: Target) -> dict[str, Any]:
    return {
        "name": t.name,
        "title": t.title,
        "sha256": t.sha256,
        "origin": "built-in" if t.name in built_in_targets() else "user",
        "triangles": sum(len(p.triangles) for p in t.parts),
        "keypoints": [k.name for k in t.keypoints],
        "mass_kg": t.mass.mass_kg,
    }


def _print_table(rows: list[Target]) -> None:
    table = Table("name", "title", "parts", "triangles", "keypoints", "edges", "kg")
    for t in rows:
        triangles = sum(len(p.triangles) for p in t.parts)
        counts = (len(t.parts), triangles, len(t.keypoints), len(t.wireframe))
        table.add_row(t.name, t.title, *(str(c) for c in counts), f"{t.mass.mass_kg:.1f}")
    terminal().print(table)


app = typer.Typer(
    name="targets",
    help="List the targets, add a mesh as a target, export or render them.",
    invoke_without_command=True,
)
app.callback()(overview)
app.command()(add)
app.command()(remove)
