"""recipes, backgrounds: recipes of independent samples, their poses as a table, and their backgrounds."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec import UnsetType
from rich.table import Table

from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.simulator.errors import UserError
from flyaround.simulator.recipes.plan import RecipePlan, plan_recipe
from flyaround.simulator.runtime.files import empty_folder, write_atomic
from flyaround.simulator.scenario.load import list_recipes, load_recipe
from flyaround.simulator.scenario.poses import COLUMNS
from flyaround.simulator.scenario.show import show_recipe

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from flyaround.simulator.scene.state import SceneState

# Columns of an imported sample's raw pose, as in its file.
RAW = ("x", "y", "z", "rx", "ry", "rz", "q1", "q2", "q3", "q4")
SAMPLE_COLUMNS = ("sample", *RAW, *COLUMNS, "background", "redraws", "epoch_utc")


def recipes(
    name: Annotated[str | None, typer.Argument(help="Recipe name or file, for --samples.")] = None,
    show: Annotated[
        str | None,
        typer.Option(
            "--show",
            help="Print this recipe as a TOML template that contains every key, unused ones as comments.",
        ),
    ] = None,
    samples: Annotated[
        Path | None,
        typer.Option(
            "--samples",
            help="Write the poses of its samples to this CSV file without rendering; an existing one is replaced.",
        ),
    ] = None,
    sheets: Annotated[
        Path | None,
        typer.Option(
            "--contact-sheet", help="Render six samples of each recipe, or of NAME, into this folder."
        ),
    ] = None,
    axes: Annotated[
        bool,
        typer.Option("--axes", help="Draw the craft's axes into contact sheets: x red, y green, z blue."),
    ] = False,
    n: Annotated[
        int | None, typer.Option("-n", min=1, help="Samples (default: the recipe's number).")
    ] = None,
    target: Annotated[
        str | None, typer.Option("--target", help="Target instead of the recipe's own.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Seed of every random choice (default: the scenario's).")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the built-in recipes, print one to start from, or write the poses that it samples."""
    if show is not None:
        text = show_recipe(show)
        typer.echo(json.dumps({"name": show, "toml": text}) if as_json else text, nl=as_json)
    elif samples is not None:
        if name is None:
            raise UserError("recipes --samples needs a recipe: give a name or a file")
        _write_samples(plan_recipe(name, n, seed=seed, target=target), samples, as_json=as_json)
    elif sheets is not None:
        _write_sheets(list_recipes() if name is None else [name], sheets, axes=axes, quiet=as_json)
    elif name is not None:
        raise UserError(
            f"recipes lists them all; for {name} alone: --show {name}, or --samples FILE.csv for its poses"
        )
    else:
        _list_recipes(as_json=as_json)


def _write_samples(plan: RecipePlan, path: Path, *, as_json: bool) -> None:
    with progress_bar("samples", quiet=as_json) as progress:
        write_atomic(path, _samples_csv(plan, progress).encode())
    if as_json:
        typer.echo(json.dumps({"samples": str(path), "n": plan.n_frames}))
    else:
        say(f"{plan.n_frames} samples of {plan.scenario_name} in {path}")


def _write_sheets(names: Iterable[str], folder: Path, *, axes: bool, quiet: bool) -> None:
    from flyaround.simulator.contact_sheets.scenario_sheet import write_recipe_sheets  # noqa: PLC0415 - slow to import

    recipes = [load_recipe(name) for name in names]
    empty_folder(folder, option="--contact-sheet")
    with progress_bar("sheets", quiet=quiet) as progress:
        write_recipe_sheets(recipes, folder, axes=axes, progress=progress)


def _list_recipes(*, as_json: bool) -> None:
    rows = [load_recipe(name) for name in list_recipes()]
    if as_json:
        fields = ("name", "title", "target", "frames", "members")
        typer.echo(json.dumps([{field: getattr(r, field) for field in fields} for r in rows]))
        return
    table = Table("name", "title", "target", "images")
    for r in rows:
        table.add_row(r.name, r.title, "" if r.members else r.target, f"{r.frames:,}")
    terminal().print(table)
    say(
        "another craft: flyaround capture eval-black --target dragon -o DIR (eval-black-dragon is the same)\n"
        "your own: flyaround recipes --show eval-earth > mine.toml, then name mine.toml instead"
    )


def _samples_csv(plan: RecipePlan, progress: Callable[[int, int], None]) -> str:
    """Return one row per sample, with full precision.

    ``x`` to ``q4`` are raw samples as in the paper (left-handed: metres, degrees, quaternion), empty unless Euler
    angles were sampled; ``q_w`` to ``t_z_m`` are the pose label, as read by `render --poses`.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(SAMPLE_COLUMNS)
    for k in range(plan.n_frames):
        writer.writerow(_row(k, plan.scene(k)))
        progress(k + 1, plan.n_frames)
    return text.getvalue()


def _row(k: int, scene: SceneState) -> list[object]:
    sample = None if isinstance(scene.sample, UnsetType) else scene.sample
    raw: tuple[object, ...] = ("",) * len(RAW)
    background, redraws = "", 0
    if sample is not None:
        if sample.raw is not None:
            raw = (*sample.raw.position_m, *sample.raw.euler_deg, *sample.raw.q_wxyz)
        if sample.background is not None:
            background = f"{sample.background.body}-{sample.background.id:04d}"
        redraws = sum(sample.redraws.values())
    pose = (*scene.q_camera_from_target_wxyz, *scene.t_camera_from_target_m)
    return [k, *raw, *pose, background, redraws, scene.epoch_utc]


def backgrounds(
    recipe: Annotated[str, typer.Argument(help="Recipe with a [background], such as paper-dragon.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="New or empty folder for the library.")],
    n: Annotated[
        int | None, typer.Option("-n", min=1, help="Number of views, from the first (default: all).")
    ] = None,
    gpu: Annotated[
        int | None, typer.Option(min=0, help="EGL device to render on (default: the driver's choice).")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Render the background library of a recipe, without the craft."""
    from flyaround.simulator.dataset.backgrounds import write_library  # noqa: PLC0415 - slow to import

    plan = plan_recipe(recipe, 1)
    if plan.recipe.background is None:
        raise UserError(
            f"recipe {recipe} has no section [background], so it needs no library: name another recipe"
        )
    empty_folder(output)
    with progress_bar("backgrounds", quiet=as_json) as progress:
        count = write_library(plan, output, n, device_index=gpu, progress=progress)
    if as_json:
        typer.echo(json.dumps({"folder": str(output), "views": count}))
    else:
        say(f"{count} views in {output}: images/NNNNNN.png, and views.csv with the camera poses")
