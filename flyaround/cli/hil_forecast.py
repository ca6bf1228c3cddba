"""hil forecast: accuracy of the predicted attitude over the prediction horizon."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.host.attitude_forecast import FORECAST_PNG, fly_forecasts, write_forecasts
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.scenario.plan import plan_flight


def forecast(
    scenario: Annotated[str, typer.Argument(help="Built-in name or TOML file of a closed loop.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="New or empty folder for forecast.csv and forecast.png.")
    ],
    horizon_s: Annotated[
        float, typer.Option("--horizon", min=1.0, max=3600.0, help="Longest prediction horizon [s].")
    ] = 60.0,
    runs: Annotated[int, typer.Option(min=1, max=1000, help="Number of flights, with one seed each.")] = 8,
    seed: Annotated[int | None, typer.Option(min=0, help="First seed (default: the scenario's).")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Fly closed loops on noisy poses and measure the error of the predicted attitude over the horizon.

    Horizon 0 is the filtered attitude itself. The filter's predicted sigma is shown next to the error
    (docs/hil_closed_loop.md).
    """
    plan = plan_flight(load_flyable(scenario, "hil forecast"), n=1, seed=seed)
    empty_folder(output, option="--output")
    with progress_bar("flights", quiet=as_json) as progress:
        errors = fly_forecasts(plan, runs=runs, horizon_s=horizon_s, progress=progress)
    write_forecasts(output, errors, plan.scenario_name)
    if as_json:
        typer.echo(msgspec.json.encode(asdict(errors)).decode())
        return
    for error in errors.rigid_body:
        say(
            f"{error.horizon_s:5g} s ahead: {error.rms_deg:.3f} deg RMS, 95 % below {error.p95_deg:.3f} deg, "
            f"predicted sigma {error.sigma_deg:.3f} deg"
        )
    say(f"of {errors.rigid_body[0].count} forecasts: {output / FORECAST_PNG}")
