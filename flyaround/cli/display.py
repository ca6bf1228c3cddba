"""hil display, hil display-calibrate, hil display-match: the optical loop through a screen."""

from __future__ import annotations

import csv
import io
import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.size_option import parse_size
from flyaround.cli.terminal import say
from flyaround.hil.corner_code import CodePlace, read_code
from flyaround.hil.display.calibration import SCREEN_PX, calibrate, read_calibration, write_calibration
from flyaround.hil.display.patterns import calibration_patterns
from flyaround.hil.display.predistort import Predistorter
from flyaround.hil.display.screen_sink import ScreenSink
from flyaround.simulator.dataset.formats.native import encode_png, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import Frame
from flyaround.simulator.loop import open_frames, run_frames
from flyaround.simulator.runtime.files import empty_folder, write_atomic
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from flyaround.gui.full_screen import FullScreen
    from flyaround.simulator.runtime.arrays import FloatArray


def display(
    scenario: Annotated[str | None, typer.Argument(help="Built-in name or TOML file.")] = None,
    monitor: Annotated[int, typer.Option(min=0, help="Number of the monitor, from 0.")] = 0,
    calibration: Annotated[
        Path | None,
        typer.Option(help="File written by display-calibrate: frames are pre-distorted for that camera."),
    ] = None,
    n: Annotated[int | None, typer.Option("-n", min=1, help="Frames, evenly in time (default 30).")] = None,
    hold_s: Annotated[
        float, typer.Option("--hold", min=0.0, help="Seconds for which each picture is shown.")
    ] = 0.5,
    code: Annotated[
        bool, typer.Option(help="Draw a time code into a corner, to identify grabbed pictures.")
    ] = True,
    patterns: Annotated[
        bool, typer.Option("--patterns", help="Show the calibration patterns instead of a flight.")
    ] = False,
    step: Annotated[
        bool,
        typer.Option("--step", help="Proceed at each line of standard input; print the picture's name."),
    ] = False,
    save: Annotated[
        Path | None,
        typer.Option(help="New or empty folder: also write the shown patterns, or shown.csv of a flight."),
    ] = None,
) -> None:
    """Show a flight full screen to a real camera that views the monitor.

    First use --patterns, which your own program grabs one by one, then display-calibrate, then show the flight with
    --calibration.
    """
    if (scenario is None) != patterns:
        raise UserError("name a scenario, or give --patterns")
    if patterns and not (n is None and calibration is None and code):
        raise UserError("--patterns shows no flight: leave out -n, --calibration and --no-code")
    if save is not None:
        empty_folder(save, option="--save")
    from flyaround.gui.full_screen import FullScreen  # noqa: PLC0415 - optional dependency

    if patterns:
        with FullScreen(monitor) as screen:
            _show_patterns(screen, hold_s, save, step=step)
        return
    plan = plan_flight(load_flyable(str(scenario), "hil display"), n=n or 30)
    predistorter = None if calibration is None else Predistorter(read_calibration(calibration))
    # the window's context and the renderer's must not share a thread: frames come from another process
    with (
        FullScreen(monitor) as screen,
        open_frames(Frame.image_and_truth, processes=1, first=plan.scene(0)) as producer,
    ):
        sink = ScreenSink(screen, predistorter, code=code, hold_s=0.0 if step else hold_s)
        for k, _ in enumerate(run_frames(plan, producer, [sink], labels=False)):
            _announce(f"frame {k}", step=step)
            if not screen.open:
                break
    if save is not None:
        text = io.StringIO()
        table = csv.writer(text)
        table.writerow(("frame_id", "time_ns", "shown_ns"))
        table.writerows((f.frame_id, f.time_ns, f.shown_ns) for f in sink.shown)
        write_atomic(save / "shown.csv", text.getvalue().encode())
    say(f"{len(sink.shown)} of {plan.n_frames} frames shown on monitor {monitor}", stderr=True)


def _show_patterns(screen: FullScreen, hold_s: float, save: Path | None, *, step: bool) -> None:
    for pattern in calibration_patterns(*screen.size_px):
        screen.show(pattern.image)
        if save is not None:
            write_atomic(save / f"{pattern.name}.png", encode_png(pattern.image))
        _announce(pattern.name, step=step)
        if not step:
            time.sleep(hold_s)
        if not screen.open:
            raise UserError("the screen was closed before all patterns were shown: start again")


def _announce(name: str, *, step: bool) -> None:
    """Print the name of the shown picture; with ``step`` wait for a line on standard input."""
    if step:
        typer.echo(name)
        sys.stdout.flush()
        if not sys.stdin.readline():
            raise UserError(f"standard input ended at {name}, and --step needs a line for each picture")


def display_calibrate(
    grabs: Annotated[
        Path,
        typer.Argument(
            help="Folder with a picture of each pattern, NAME.png, or NAME_0.png and so on, which are averaged."
        ),
    ],
    screen: Annotated[str, typer.Option(help="Resolution of the monitor, e.g. 1920x1200.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write.")] = Path("calibration.json"),
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Calibrate the screen from images of the patterns: pixel map between camera and screen, and brightness."""
    size = parse_size(screen, "--screen", SCREEN_PX, "1920x1200")
    screen_map = calibrate(_read_grabs(grabs, size), size)
    write_calibration(screen_map, output)
    figures = {
        "geometry_rms_px": screen_map.geometry_rms_px,
        "black_dn": screen_map.black_dn,
        "white_dn": screen_map.white_dn,
        "code_left_px": screen_map.code_left_px,
        "code_top_px": screen_map.code_top_px,
    }
    if as_json:
        typer.echo(json.dumps(figures))
    else:
        say(
            f"{output}: map to {screen_map.geometry_rms_px:.3f} px rms; black {screen_map.black_dn:.0f}, white"
            f" {screen_map.white_dn:.0f} DN above it where the screen is darkest"
        )


def _read_grabs(folder: Path, screen_px: tuple[int, int]) -> dict[str, FloatArray]:
    if not folder.is_dir():
        raise UserError(f"{folder} is not a folder: name the one with the grabbed pictures")
    grabs: dict[str, FloatArray] = {}
    for pattern in calibration_patterns(*screen_px):
        paths = sorted([*folder.glob(f"{pattern.name}.png"), *folder.glob(f"{pattern.name}_[0-9]*.png")])
        if not paths:
            raise UserError(f"{pattern.name}.png is missing in {folder}: grab every pattern")
        total = _read_grey(paths[0])
        for path in paths[1:]:
            image = _read_grey(path)
            if image.shape != total.shape:
                raise UserError(f"{path} and {paths[0].name} differ in size: grab both again")
            total = total + image
        grabs[pattern.name] = total / len(paths)
    return grabs


def _read_grey(path: Path) -> FloatArray:
    image = read_png(path).astype(np.float64)
    return image if image.ndim == 2 else image.mean(axis=2)


def display_match(
    grabs: Annotated[list[Path], typer.Argument(help="Pictures of the screen.")],
    calibration: Annotated[
        Path | None,
        typer.Option(
            help="File written by display-calibrate (default: the code is at the upper left, undistorted)."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a list as JSON.")] = False,
) -> None:
    """Identify the frame that each grabbed image shows by its time code; exit 1 if one has none."""
    code_place = CodePlace() if calibration is None else read_calibration(calibration).code_place
    rows = []
    for path in grabs:
        code = read_code(_read_grey(path), code_place)
        rows.append(
            {
                "path": str(path),
                "frame_id": None if code is None else code.frame_id,
                "time_ns": None if code is None else code.time_ns,
            }
        )
    if as_json:
        typer.echo(json.dumps(rows))
    else:
        for row in rows:
            say(
                f"{row['path']}: "
                + ("no code" if row["frame_id"] is None else f"frame {row['frame_id']}, {row['time_ns']} ns")
            )
    if any(row["frame_id"] is None for row in rows):
        raise typer.Exit(1)
