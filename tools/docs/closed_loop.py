"""Plot for docs/hil_closed_loop.md: an approach in its corridor and its errors; prints the attitude forecast.

    python -m tools.docs.closed_loop LEDGER -o docs/images

LEDGER is a folder of ``hil host --closed-loop --log``; the forecast is simulated anew, without images.
"""

from __future__ import annotations

import argparse
import csv
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from flyaround.hil.host.attitude_forecast import Forecasts, fly_forecasts
from flyaround.hil.host.closed_loop_run import STEPS_CSV
from flyaround.simulator.reports.plots import BLUE, DIM, GREEN, ORANGE, VERMILION, figure_with_axes
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

SCENARIOS = {"steady": "tango-vbar-closed-loop", "tumbling": "tango-vbar-closed-loop-tumble"}
# keep-out sphere, half angle of the corridor, end of the approach
SPHERE_M, CORRIDOR_DEG, HOLD_M = 12.0, 15.0, 3.0
HORIZON_S, RUNS = 60.0, 8  # horizon of the attitude forecast, and number of flights


def read_steps(folder: Path) -> dict[str, list[str]]:
    """Return the columns of a run's ``closed_loop.csv``."""
    with (folder / STEPS_CSV).open() as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in rows[0]}


def numbers(column: list[str]) -> np.ndarray:
    """Return a column as floats, empty cells as NaN."""
    return np.array([float(cell) if cell else np.nan for cell in column])


def approach_picture(steps: dict[str, list[str]]) -> Figure:
    """Plot the approach with the corridor and the keep-out sphere, and the errors along it."""
    figure, (way, position, attitude) = figure_with_axes(1, 3, 3.6, width=13, widths=(1.2, 1, 1))
    along, radial, cross_track = (
        numbers(steps[f"{name}_m"]) for name in ("along_track", "radial", "cross_track")
    )
    out = np.linspace(0, 19, 2)
    for side in (-1, 1):
        way.plot(out, side * out * np.tan(np.radians(CORRIDOR_DEG)), color=VERMILION, lw=1)
    turn = np.linspace(np.radians(CORRIDOR_DEG), np.pi / 2, 60)
    for side in (-1, 1):
        way.plot(SPHERE_M * np.cos(turn), side * SPHERE_M * np.sin(turn), color=VERMILION, lw=1)
    way.plot(along, radial, color=BLUE, label="radial")
    way.plot(along, cross_track, color=GREEN, label="cross-track")
    way.plot([HOLD_M], [0], "o", color=ORANGE, label="hold point")
    way.set(xlim=(0, 19), ylim=(-6, 6), xlabel="along-track [m]", ylabel="off the axis [m]")
    way.legend(frameon=False, fontsize=8)
    t = numbers(steps["t_s"])
    error = np.sqrt(
        sum(numbers(steps[f"{n}_error_m"]) ** 2 for n in ("radial", "along_track", "cross_track"))
    )
    two_curves(position, t, 1e3 * error, 1e3 * numbers(steps["position_sigma_m"]), "position [mm]")
    two_curves(
        attitude,
        t,
        numbers(steps["attitude_error_deg"]),
        numbers(steps["attitude_sigma_deg"]),
        "attitude [deg]",
    )
    return figure


def two_curves(ax: Axes, t: np.ndarray, error: np.ndarray, sigma: np.ndarray, title: str) -> None:
    """Plot an error of the estimate and the maximum sigma of the filter."""
    ax.plot(t, error, color=BLUE, label="error")
    ax.plot(t, sigma, color=DIM, lw=1, label="sigma")
    ax.set(xlabel="time [s]", ylabel=title, yscale="log")
    ax.legend(frameon=False, fontsize=8)


def forecasts() -> list[tuple[str, Forecasts]]:
    """Return the forecast errors over the horizon, for each motion of the target."""
    return [
        (name, fly_forecasts(plan_flight(load_scenario(scenario), n=1), runs=RUNS, horizon_s=HORIZON_S))
        for name, scenario in SCENARIOS.items()
    ]


def save(figure: Figure, path: Path) -> None:
    """Save as JPEG, which is smaller than PNG."""
    data = BytesIO()
    figure.savefig(data, format="jpeg", dpi=110, pil_kwargs={"quality": 88})
    path.write_bytes(data.getvalue())


def main() -> None:
    """Write the plot and print the table of forecast errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("ledger", type=Path)
    parser.add_argument("-o", "--out", type=Path, required=True)
    options = parser.parse_args()
    save(approach_picture(read_steps(options.ledger)), options.out / "closed_loop.jpg")
    for name, errors in forecasts():
        for model, of_model in (("rigid body", errors.rigid_body), ("constant rate", errors.constant_rate)):
            cells = " | ".join(f"{e.rms_deg:.2f} ({e.p95_deg:.2f})" for e in of_model[:: len(of_model) // 6])
            print(f"| {name}, {model} | {cells} |")
        sigmas = " | ".join(f"{e.sigma_deg:.2f}" for e in errors.rigid_body[:: len(errors.rigid_body) // 6])
        print(f"| {name}, one sigma predicted | {sigmas} |")


if __name__ == "__main__":
    main()
