"""capture, check: labelled data sets, and the verification of their labels."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.text import Text

from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import progress_bar, say
from flyaround.runs.capture import CapturedPictures, CaptureRun
from flyaround.runs.document import RUN_TOML, run_toml
from flyaround.simulator.camera.lens.files import read_camera_file
from flyaround.simulator.dataset.capture import CaptureSummary
from flyaround.simulator.dataset.capture import capture as capture_plan
from flyaround.simulator.dataset.check.redraw import SHARE as REDRAWN_SHARE
from flyaround.simulator.dataset.check.verify import CheckReport, check_dataset
from flyaround.simulator.dataset.clipping import ClippingSummary
from flyaround.simulator.dataset.formats.registry import parse_formats
from flyaround.simulator.dataset.ray_frames import RayCluster
from flyaround.simulator.dataset.sensors import parse_sensors
from flyaround.simulator.dataset.split import parse_split
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.request import parse_labels
from flyaround.simulator.recipes.plan import RecipePlan, plan_recipe
from flyaround.simulator.scenario.document import with_image_options
from flyaround.simulator.scenario.load import is_recipe, list_scenarios, load_recipe, load_scenario, load_vary
from flyaround.simulator.scenario.plan import Plan, plan_flight, varied_plan
from flyaround.simulator.scene.environments import environment_preset, environment_section
from flyaround.simulator.scene.illumination.bands import Bands


@with_run_options
def capture(
    run: CaptureRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Take labelled images of a flight or a recipe; every frame's labels are verified as it is written."""
    data_set, drawing = run.data_set, run.drawing
    cluster = None if drawing.ray is None else RayCluster(drawing.ray, drawing.gpu_share)
    names = parse_formats(data_set.formats)
    plans = _choose_plans(run.scenario, run.pictures)
    if run.pictures.vary is not None:
        vary = run.pictures.vary
        plans = {member: varied_plan(plan, load_vary(vary, plan.vary)) for member, plan in plans.items()}
    shares = None if data_set.split is None else parse_split(data_set.split)
    output = run.output.rstrip("/") or run.output
    summaries = {}
    for member, plan in plans.items():
        layers = ",".join(plan.labels) if data_set.labels is None else data_set.labels
        with progress_bar(member or "capture", quiet=as_json) as progress:
            summaries[member] = capture_plan(
                plan,
                output if not member else f"{output}/{member}",
                formats=names,
                labels=parse_labels(layers),
                sensors=parse_sensors(data_set.sensors),
                split=shares,
                extra_files={RUN_TOML: run_toml(run)},
                resume=run.resume,
                workers=drawing.workers,
                cluster=cluster,
                device_index=drawing.gpu,
                progress=progress,
                tell=lambda sentence: say(sentence, stderr=True),
            )
        if not as_json:
            _print_capture(summaries[member])
    if as_json:
        reports = {member: _report(summary) for member, summary in summaries.items()}
        typer.echo(json.dumps(reports.get("", {"members": reports})))
    if any(s.quarantined or (s.second and s.second.quarantined) for s in summaries.values()):
        raise typer.Exit(1)


def _report(summary: CaptureSummary) -> dict[str, Any]:
    return {
        "folder": str(summary.folder),
        "written": summary.n_written,
        "kept": summary.n_kept,
        "feasible": summary.n_feasible,
        "quarantined": [{"frame": k, "reason": r} for k, r in summary.quarantined],
        "clipping": None if summary.clipping is None else asdict(summary.clipping),
        "redraws": summary.redraws,
        "damaged": list(summary.damaged),
        "second": None if summary.second is None else _report(summary.second),
    }


def _print_capture(summary: CaptureSummary) -> None:
    say(
        f"{summary.n_written} frames written to {summary.folder} ({summary.n_kept} existed, "
        f"{summary.n_feasible} of the new ones feasible, {len(summary.quarantined)} quarantined)"
    )
    if summary.damaged:
        say(
            f"{len(summary.damaged)} frames were damaged and are rendered again: {_first_numbers(summary.damaged)}"
        )
    for name, count in summary.redraws.items():
        say(f"{count} poses sampled again for {name}")
    if summary.clipping is not None:
        _print_clipping(summary.clipping)
    if summary.second is not None:
        _print_capture(summary.second)


def _first_numbers(frames: tuple[int, ...], most: int = 10) -> str:
    """Return the first numbers as text, with an ellipsis if there are more."""
    return ", ".join(str(k) for k in frames[:most]) + (", ..." if len(frames) > most else "")


def _print_clipping(clipping: ClippingSummary) -> None:
    """Report the share of the target that is saturated before noise, and the remedy."""
    shares = f"{100 * clipping.share:.1f} % of the target's pixels are saturated"
    if clipping.advice and clipping.dark_frames:
        say(Text(f"the target is dark in {clipping.dark_frames} frames: {clipping.advice}", "yellow"))
    elif clipping.advice:
        worst = f"{100 * clipping.worst_share:.0f} % in the worst frame"
        say(Text(f"{shares} ({worst}): {clipping.advice}", "yellow"))
    else:
        say(shares)


def check(
    folder: Annotated[Path, typer.Argument(help="Data set written by capture.")],
    redraw: Annotated[
        float,
        typer.Option(
            "--redraw",
            min=0.0,
            max=1.0,
            help="Share of the images to render again from their records and compare, at least three; 0: none, 1: all. "
            "In the others only manifest.sha256 detects a change of a few pixels in a layer.",
        ),
    ] = REDRAWN_SHARE,
    redraw_seed: Annotated[
        int | None,
        typer.Option(
            "--redraw-seed",
            min=0,
            max=2**53 - 1,
            help="Re-render the same images as a check that printed this seed; by default others in each check.",
        ),
    ] = None,
    whole_exports: Annotated[
        bool,
        typer.Option(
            "--all", help="Compare all frames of COCO, BOP and other exports, not a sample of them."
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    """Verify every label of a data set again, and re-render some images; exit 1 if one is wrong."""
    with progress_bar("check", quiet=as_json) as progress:
        report = check_dataset(
            folder, progress, redraw=redraw, redraw_seed=redraw_seed, whole_exports=whole_exports
        )
    if as_json:
        typer.echo(json.dumps(_check_report(report)))
    else:
        _print_check(report)
    if report.faults:
        raise typer.Exit(1)


def _check_report(report: CheckReport) -> dict[str, Any]:
    return {
        "frames": report.n_frames,
        "labels": report.n_labels,
        "redrawn": report.n_redrawn,
        "redraw_seed": report.redraw_seed,
        "exported": report.n_exported,
        "not_checked": report.not_checked,
        "faults": [{"frame": f.frame, "what": f.what} for f in report.faults],
    }


def _print_check(report: CheckReport) -> None:
    for fault in report.faults:
        where = "set" if fault.frame is None else f"frame {fault.frame}"
        say(Text.assemble((where, "red"), f": {fault.what}"))
    if report.not_redrawn:
        say(f"no image was re-rendered: {report.not_redrawn}")
    for reason in report.not_checked:
        say(f"not checked: {reason}")
    say(
        f"{report.n_frames} frames, {report.n_labels} labels, {report.n_redrawn} images re-rendered, "
        f"{len(report.faults)} faults"
    )
    if 0 < report.n_redrawn < report.n_frames:
        say(
            f"the same images are re-rendered with --redraw-seed {report.redraw_seed}; in the others only "
            "manifest.sha256 detects a change of a few pixels in a layer (--redraw 1 re-renders all)"
        )
    if 0 < report.n_exported < report.n_frames:
        say(f"exports were compared in {report.n_exported} frames; --all compares all")


def _choose_plans(name: str, pictures: CapturedPictures) -> dict[str, Plan | RecipePlan]:
    """Return the plan under the key ``""``, or, for a recipe of several data sets, their plans by folder.

    ``n`` frames are distributed over all of them; each plan has its own seed.

    Raises
    ------
    UserError
        If the scenario or recipe cannot be used, or there are fewer frames than data sets.
    """
    members = [] if name in list_scenarios() or not is_recipe(name) else load_recipe(name).members
    if not members:
        return {"": _choose_plan(name, pictures)}
    n, seed = pictures.n, pictures.seed
    if pictures.target is not None:
        raise UserError(f"recipe {name} consists of data sets of {len(members)} craft: leave out --target")
    if n is not None and n < len(members):
        raise UserError(f"recipe {name} consists of {len(members)} data sets: give -n {len(members)} or more")
    shares = [None if n is None else (n + i) // len(members) for i in reversed(range(len(members)))]
    return {
        member: _choose_plan(
            member,
            msgspec.structs.replace(pictures, n=share, seed=None if seed is None else seed + i),
        )
        for i, (member, share) in enumerate(zip(members, shares, strict=True))
    }


def _choose_plan(name: str, pictures: CapturedPictures) -> Plan | RecipePlan:
    """Return the plan of a recipe or scenario, with the given options applied.

    Raises
    ------
    UserError
        If there is no such scenario or recipe, or ``every_s`` is used with a recipe.
    """
    bands: Bands | None = "rgb" if pictures.rgb else None
    if name not in list_scenarios() and is_recipe(name):
        if pictures.every_s is not None:
            raise UserError(f"recipe {name} has no time axis, so --every does not apply: use -n")
        layers = None if pictures.environment is None else environment_preset(pictures.environment)
        recipe = load_recipe(name)
        return plan_recipe(
            with_image_options(recipe, pictures.encoding, auto_exposure=pictures.auto_exposure),
            pictures.n,
            seed=pictures.seed,
            target=pictures.target,
            bands=bands,
            quality=pictures.quality,
            camera=pictures.camera,
            environment=layers,
        )
    scenario = load_scenario(name)
    if pictures.camera is not None:
        scenario = msgspec.structs.replace(scenario, camera=read_camera_file(pictures.camera))
    if pictures.target is not None:
        scenario = msgspec.structs.replace(scenario, target=pictures.target)
    if pictures.environment is not None:
        scenario = msgspec.structs.replace(scenario, environment=environment_section(pictures.environment))
    scenario = with_image_options(scenario, pictures.encoding, auto_exposure=pictures.auto_exposure)
    return plan_flight(
        scenario,
        n=None if pictures.every_s is not None else pictures.n or 20,
        every_s=pictures.every_s,
        seed=pictures.seed,
        bands=bands,
        quality=pictures.quality,
    )
