"""fly, scenarios, cameras: flights without images, and lists of built-in scenarios and cameras."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.table import Table
from rich.text import Text

from flyaround.cli.run_options import with_run_options
from flyaround.cli.scenario_argument import load_flyable, refuse_recipe
from flyaround.cli.terminal import say, terminal
from flyaround.runs.document import RUN_TOML, run_toml
from flyaround.runs.flights import FlyRun
from flyaround.simulator.camera.lens.files import list_cameras, load_camera, read_camera_file
from flyaround.simulator.camera.lens.formats.registry import CAMERA_FORMATS, WRITABLE_FORMATS, camera_text
from flyaround.simulator.contact_sheets.scenario_sheet import write_contact_sheets
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder, write_atomic
from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from flyaround.simulator.scenario.messages import ephemeris_sentences
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scenario.show import show_scenario
from flyaround.simulator.scenario.write import replay_scenario
from flyaround.simulator.world.flight.export import flight_messages, fly_table, summarise_flight
from flyaround.simulator.world.flight.flight import record


@with_run_options
def fly(
    run: FlyRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Propagate without images: states of both craft as a table, with phases, thrust, events and delta-v."""
    plan = plan_flight(load_flyable(run.scenario, "fly"), every_s=run.every_s)
    output = Path(run.output)
    earlier = _earlier_flight(output) if run.overwrite else ()
    if not earlier:
        empty_folder(output, advice="replace an earlier flight with --overwrite")
    rows = fly_table(plan.flight, plan.times_s)
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    contents = {
        "states.csv": text.getvalue().encode(),
        "scenario.json": msgspec.json.format(msgspec.json.encode(plan.scenario_document), indent=1),
        RUN_TOML: run_toml(run),
    }
    for name, message in flight_messages(plan.flight, plan.times_s, oem=run.oem, aem=run.aem).items():
        contents[name] = message.encode()
    if run.record:
        contents["flight.npz"] = record(plan.flight, plan.times_s).to_bytes()
        contents["replay.toml"] = replay_scenario(plan.scenario, "flight.npz").encode()
    for name, content in contents.items():
        write_atomic(output / name, content)
    # an earlier flight is kept until the new one is written
    for file in earlier:
        if file.name not in contents:
            file.unlink()
    summary = {"states": str(output / "states.csv"), **summarise_flight(plan.flight, rows)}
    summary["followed"] = ephemeris_sentences(plan.scenario)
    if as_json:
        typer.echo(json.dumps(summary))
    else:
        _print_flight(summary)


def _earlier_flight(folder: Path) -> tuple[Path, ...]:
    """Return the files of an earlier flight in a folder.

    Raises
    ------
    UserError
        If the folder holds something else.
    """
    files = tuple(sorted(folder.iterdir())) if folder.is_dir() else ()
    foreign = [p.name for p in files if p.name not in FLIGHT_FILES or not p.is_file()]
    if foreign:
        raise UserError(
            f"{folder} holds {foreign[0]}, which is not a file of fly: name another folder with -o"
        )
    return files


def _print_flight(summary: dict[str, Any]) -> None:
    """Print a flight's summary: folder, phases, events and delta-v."""
    say(f"{summary['rows']} states in {summary['states']}")
    for sentence in summary["followed"]:
        say(sentence)
    phases = (f"{p['phase']} {p['from_s']:g} to {p['to_s']:g} s" for p in summary["phases"])
    say(f"phases: {', '.join(phases)}")
    if summary["delta_v_m_s"] is None:
        say("delta-v: unknown, because the path is followed exactly; add [chaser.thrusters] to the scenario")
    else:
        propellant_kg = summary["propellant_kg"]
        mass = (
            ""
            if propellant_kg is None
            else f", {propellant_kg:.4g} kg of propellant from {summary['mass_kg'][0]:g} kg"
        )
        say(f"delta-v: {summary['delta_v_m_s']:.4g} m/s{mass}")
    say(f"nearest: {summary['min_range_m']:.2f} m at {summary['min_range_s']:g} s")
    for event in summary["events"]:
        say(Text(f"at {event['t_s']:g} s: {event['what']}", "red" if event["kind"] == "abort" else ""))


FLIGHT_FILES = (
    "states.csv",
    "scenario.json",
    "target.oem",
    "chaser.oem",
    "target.aem",
    "chaser.aem",
    "flight.npz",
    "replay.toml",
    RUN_TOML,
)
"""Files that `fly` writes into its folder."""


def scenarios(
    show: Annotated[
        str | None,
        typer.Option(
            "--show",
            help="Print this scenario as a TOML template that contains every key, unused ones as comments.",
        ),
    ] = None,
    sheets: Annotated[
        Path | None, typer.Option("--contact-sheet", help="Draw six frames of each into this folder.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the built-in scenarios, or print one to start from; `flyaround recipes` lists the recipes."""
    if show is not None:
        refuse_recipe(show, "scenarios --show", "`flyaround recipes --show NAME` prints a recipe")
        text = show_scenario(show)
        typer.echo(json.dumps({"name": show, "toml": text}) if as_json else text, nl=as_json)
        return
    rows = [load_scenario(name) for name in list_scenarios()]
    if sheets is not None:
        empty_folder(sheets, option="--contact-sheet")
        write_contact_sheets(rows, sheets)
    if as_json:
        typer.echo(json.dumps([{"name": s.name, "title": s.title, "duration_s": s.duration_s} for s in rows]))
        return
    table = Table("name", "title", "seconds")
    for s in rows:
        table.add_row(s.name, s.title, f"{s.duration_s:g}")
    terminal().print(table)
    say(
        "your own: flyaround scenarios --show tango-flyaround > mine.toml, then name mine.toml instead\n"
        "independent samples for a data set: flyaround recipes"
    )


def cameras(
    camera: Annotated[
        str | None,
        typer.Argument(help=f"Built-in name or a file: {', '.join(form.title for form in CAMERA_FORMATS)}."),
    ] = None,
    export: Annotated[
        Path | None,
        typer.Option("--export", help="Write the camera to this file; an existing one is replaced."),
    ] = None,
    form: Annotated[
        str | None,
        typer.Option(
            "--format", help=f"Format of the written file: {', '.join(WRITABLE_FORMATS)} (default native)."
        ),
    ] = None,
    width_px: Annotated[
        int | None, typer.Option("--width", min=1, help="Required image width in pixels.")
    ] = None,
    height_px: Annotated[
        int | None, typer.Option("--height", min=1, help="Required image height in pixels.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the built-in cameras, or read one of any format, check it, and write it in another."""
    if camera is None:
        if export is not None:
            raise UserError("cameras --export needs a camera: give a built-in name or a file")
        rows = {name: load_camera(name) for name in list_cameras()}
    else:
        camera_file = read_camera_file(camera)
        model = camera_file.camera(camera)
        size = (width_px or model.width_px, height_px or model.height_px)
        if size != (model.width_px, model.height_px):
            raise UserError(
                f"{camera} is for images of {model.width_px} x {model.height_px} pixels, required are "
                f"{size[0]} x {size[1]}: calibrate at that size, or use [sensor] roi_px and binning"
            )
        if export is not None:
            write_atomic(export, camera_text(camera_file, form or "native", camera).encode())
        rows = {camera_file.name or Path(camera).stem: model}
    if as_json:
        typer.echo(msgspec.json.encode(rows).decode())
        return
    table = Table("name", "pixels", "fx fy [px]", "cx cy [px]", "distortion")
    for name, c in rows.items():
        table.add_row(
            name,
            f"{c.width_px} x {c.height_px}",
            f"{c.fx_px:.2f} {c.fy_px:.2f}",
            f"{c.cx_px:g} {c.cy_px:g}",
            c.distortion.model,
        )
    terminal().print(table)
