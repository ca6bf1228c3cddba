"""convert: data sets of others into ours."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flyaround.commands.terminal import progress_bar, say
from simulator.dataset.formats.registry import formats, read_foreign
from simulator.dataset.importing import camera_of, write_imported
from simulator.errors import UserError
from simulator.runtime.files import empty_folder
from simulator.targets.library import load_target

READ = ", ".join(form.name for form in formats().values() if form.read is not None)


def convert(
    source: Annotated[
        Path, typer.Argument(help="A data set of others: its folder, or the list of its labels within.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the data set: new or empty.")],
    source_format: Annotated[
        str | None, typer.Option("--from", help=f"Its format, found out unless given: {READ}.")
    ] = None,
    target: Annotated[
        str | None, typer.Option("--target", help="The craft in its pictures (of SPEED's kin: tango).")
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option("--camera", help="Built-in camera or file, instead of the one that comes with it."),
    ] = None,
) -> None:
    """Make a data set of another's pictures and poses, with masks, keypoints and boxes by the model, for evaluate."""
    found, form = read_foreign(source, source_format)
    name = target or found.usual_target
    if not name:
        raise UserError(f"{source} does not say what craft it shows; name it with --target")
    craft = load_target(name)
    lens = camera_of(found, camera)
    empty_folder(output)
    with progress_bar("convert") as progress:
        write_imported(found, output, lens, craft, form, progress)
    say(f"{len(found.pictures)} pictures of {found.labels} ({form}, {name}) written to {output}")
