"""render: one image and its truth.

The Earth maps are prefetched before the renderer's packages are imported, so that both run in parallel.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.table import Table
from rich.text import Text

from flyaround.cli.run_options import with_run_options
from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.terminal import progress_bar, say, terminal
from flyaround.runs.document import write_run
from flyaround.runs.pictures import RenderRun
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.request import LabelRequest, parse_labels
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.render.earth.map_textures import EarthMaps, prefetch_earth_maps, prefetch_maps
from flyaround.simulator.scenario.document import with_image_options
from flyaround.simulator.scenario.poses import PosePlan, read_poses
from flyaround.simulator.scene.environments import environment_section
from flyaround.simulator.scene.illumination.bands import Bands
from flyaround.simulator.scene.state import SceneState
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.targets.model import Target


@with_run_options
def render(
    run: RenderRun,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the truth record (with --timings: and stage_ms).")
    ] = False,
) -> None:
    """Render one frame and its truth, or one for each pose of a list."""
    if (run.scenario is None) == (run.from_truth is None):
        raise UserError("render needs either a SCENARIO or --from-truth FILE: see flyaround render --help")
    view = _recorded_view(Path(run.from_truth)) if run.from_truth is not None else _flown_view(run)
    if run.labels is not None:
        view = replace(view, labels=LabelRequest(layers=parse_labels(run.labels), flow=view.labels.flow))
    if run.poses is not None:
        _render_poses(run, view, as_json=as_json)
        return
    from flyaround.simulator.dataset.clipping import measure_clipping, summarise_clipping  # noqa: PLC0415 - slow to import: maps are prefetched first
    from flyaround.simulator.dataset.single_frames import (  # noqa: PLC0415 - slow to import: maps are prefetched first
        check_picture_path,
        render_scene,
        save_picture,
        time_passes,
    )

    output = Path(run.output)
    check_picture_path(output)
    frame = render_scene(
        view.scene, view.target, labels=view.labels, device_index=run.gpu, prefetched=view.prefetched
    )
    truth_path = save_picture(frame, output)
    stage_ms = time_passes(view.scene, view.target, device_index=run.gpu) if run.timings else {}
    if as_json:
        text = truth_path.read_text()
        typer.echo(json.dumps({**json.loads(text), "stage_ms": stage_ms}) if run.timings else text)
    else:
        say(f"{output} and {truth_path} ({frame.stage_ms['render'] + frame.stage_ms['sensor']:.0f} ms)")
        clipping = summarise_clipping([measure_clipping(frame)], view.document) if view.document else None
        if clipping is not None and clipping.advice:
            what = (
                "dark" if clipping.dark_frames else f"saturated in {100 * clipping.share:.0f} % of its pixels"
            )
            say(Text(f"the target is {what}: {clipping.advice}", "yellow"))
        if run.timings:
            terminal().print(_times_table(stage_ms))


@dataclass(frozen=True, eq=False)
class _View:
    """Scene to render, its prefetched Earth maps, and its scenario (empty for a record)."""

    scene: SceneState
    target: Target
    labels: LabelRequest
    prefetched: dict[Bands, EarthMaps]
    document: dict[str, Any]


def _recorded_view(path: Path) -> _View:
    """Return the view that a truth record describes."""
    record = read_truth(path)
    prefetched = prefetch_maps(record.scene)
    request = LabelRequest(layers=record.layers, flow=record.flow)
    return _View(record.scene, load_target(record.scene.target.name), request, prefetched, {})


def _flown_view(run: RenderRun) -> _View:
    """Return the view of the scenario at the requested time."""
    bands: Bands | None = "rgb" if run.rgb else None
    scenario = load_flyable(run.scenario or "", "render")
    if run.environment is not None:
        scenario = msgspec.structs.replace(scenario, environment=environment_section(run.environment))
    scenario = with_image_options(scenario, run.encoding, auto_exposure=run.auto_exposure)
    prefetched: dict[Bands, EarthMaps] = {}
    if scenario.environment.layers().earth:
        # two at a time: an empty cache is filled while the target is loaded and the flight propagated
        in_bands = bands or scenario.output.bands
        prefetched[in_bands] = prefetch_earth_maps(
            in_bands, scenario.environment.layers(), scenario.epoch_utc
        )
    from flyaround.simulator.scenario.plan import plan_flight  # noqa: PLC0415 - slow to import: maps are prefetched first

    plan = plan_flight(scenario, times=(run.time_s,), seed=run.seed, bands=bands, quality=run.quality)
    return _View(plan.scene(0), plan.target, LabelRequest(), prefetched, plan.scenario_document)


def _times_table(stage_ms: dict[str, float]) -> Table:
    """Return a table of the time of each stage; passes are indented under their stage."""
    table = Table("stage", "ms", title="median of five, with a wait after each pass")
    table.columns[1].justify = "right"
    for stage in (name for name in stage_ms if "." not in name):
        table.add_row(stage, f"{stage_ms[stage]:.2f}")
        for name, ms in stage_ms.items():
            if name.startswith(f"{stage}."):
                table.add_row(f"  {name.removeprefix(stage + '.')}", f"{ms:.2f}")
    return table


def _render_poses(run: RenderRun, view: _View, *, as_json: bool) -> None:
    """Render one image per row: OUT-000000.png and so on."""
    from flyaround.simulator.dataset.single_frames import NumberedPictures  # noqa: PLC0415 - slow to import: maps are prefetched first
    from flyaround.simulator.loop import open_frames, run_frames, whole_frame  # noqa: PLC0415 - slow to import: maps are prefetched first

    plan = PosePlan(view.scene, view.target, read_poses(Path(run.poses or "")))
    output = Path(run.output)
    sink = NumberedPictures(output, plan.n_frames)
    with (
        progress_bar("render", quiet=as_json) as progress,
        open_frames(
            whole_frame, device_index=run.gpu, prefetched=view.prefetched, target=view.target
        ) as producer,
    ):
        for k, _ in enumerate(run_frames(plan, producer, [sink], labels=view.labels)):
            progress(k + 1, plan.n_frames)
    write_run(output, run)
    if as_json:
        files = [{"image": str(image), "truth": str(truth)} for image, truth in sink.written]
        typer.echo(json.dumps({"frames": files}))
    else:
        say(f"{plan.n_frames} images and their truth: {sink.written[0][0]} and on")
