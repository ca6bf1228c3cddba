"""film: a flight as a film, H.264 in an mp4 file."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from flyaround.cli.run_options import with_run_options
from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.terminal import progress_bar, say
from flyaround.runs.document import write_run
from flyaround.runs.flights import FilmRun
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.plan import Plan, plan_flight

if TYPE_CHECKING:
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

MAX_FRAMES = 1_000_000
"""Largest number of images of a film."""


@dataclass(frozen=True)
class SizedPlan:
    """A plan whose camera has another number of pixels."""

    plan: Plan
    width_px: int | None

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return self.plan.n_frames

    @property
    def target(self) -> Target:
        """The model to draw."""
        return self.plan.target

    def scene(self, k: int) -> SceneState:
        """Return the scene of frame k; the blur keeps its angle."""
        scene = self.plan.scene(k)
        width_px = self.width_px or scene.camera.width_px
        sigma_px = scene.sensor.blur_sigma_px * width_px / scene.camera.width_px
        return replace(
            scene,
            camera=scene.camera.resized(width_px),
            sensor=replace(scene.sensor, blur_sigma_px=sigma_px),
        )


@with_run_options
def film(
    run: FilmRun,
    as_json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Render a flight, or a part of it, as a film; a film that is interrupted leaves no file."""
    scenario = load_flyable(run.scenario, "film")
    end_s = scenario.duration_s if run.to_s is None else run.to_s
    if end_s > scenario.duration_s:
        raise UserError(f"{run.scenario} lasts {scenario.duration_s:g} s; choose --to within it")
    count = int((end_s - run.from_s) * run.fps / run.speed + 1e-9) + 1
    if end_s <= run.from_s or not 2 <= count <= MAX_FRAMES:
        raise UserError(
            f"from {run.from_s:g} to {end_s:g} s at {run.fps:g} images per second and speed {run.speed:g} the film has "
            f"{max(count, 0)} images, allowed: 2 to {MAX_FRAMES}; change --from, --to, --fps or --speed"
        )
    times_s = run.from_s + np.arange(count) * (run.speed / run.fps)
    plan = plan_flight(
        scenario,
        times=tuple(times_s.tolist()),
        seed=run.seed,
        bands="rgb" if run.rgb else None,
        quality=run.quality,
    )
    _write(SizedPlan(plan, run.width_px), run, as_json=as_json)
    write_run(Path(run.output), run)
    if as_json:
        typer.echo(json.dumps({"film": run.output, "images": count, "seconds": round(count / run.fps, 3)}))
    else:
        say(f"{run.output}: {count} images, {count / run.fps:.1f} s")


def _write(plan: SizedPlan, run: FilmRun, *, as_json: bool) -> None:
    """Render all frames into the film."""
    # the encoder is optional, and OpenGL slow to import
    from flyaround.gui.picture.screen import screen_picture  # noqa: PLC0415
    from flyaround.gui.picture.video import Film  # noqa: PLC0415
    from flyaround.simulator.loop import open_frames, run_frames, whole_frame  # noqa: PLC0415

    count = plan.n_frames
    film = Film(Path(run.output), rate_hz=run.fps)
    try:
        with (
            progress_bar("film", quiet=as_json) as progress,
            open_frames(
                whole_frame, device_index=run.gpu, first=plan.scene(0), target=plan.target
            ) as producer,
        ):
            for k, frame in enumerate(run_frames(plan, producer, labels=False)):
                film.add(round(1000 * k / run.fps), screen_picture(frame), waits=True)
                if film.trouble is not None:
                    break
                progress(k + 1, count)
                # a program that waits for the end reads this
                if as_json and 100 * (k + 1) // count > 100 * k // count:
                    say(f"{k + 1} of {count}", stderr=True)
    except BaseException:
        film.close(keep=False)
        raise
    film.close()
    if film.trouble is not None:
        raise UserError(film.trouble)
