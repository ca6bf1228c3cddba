"""Results of docs/hil_closed_loop.md: share of flights that arrive, and consistency of the filter's covariance.

    python -m tools.studies.loop_figures --seeds 3000-3049   # on noisy poses and on the truth, without images
    python -m tools.studies.loop_figures --drawn OUT         # flights of tools.studies.drawn_loop

The table is printed in Markdown. NEES is computed over the twelve states of the covariance: position and velocity of
the chaser, attitude and rate of the target, without the biases of the poses; it is averaged over flights and over times
from the 20th period on.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.hil.evaluate.metrics import wilson_interval
from flyaround.hil.host.closed_loop_run import fly_without_pictures
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
from flyaround.hil.navigation.consistency import nees_band
from tools.studies.drawn_loop import SCENARIOS, planned, seeds_of

if TYPE_CHECKING:
    from collections.abc import Sequence

STATES, SETTLED = 12, 20  # states of the NEES, and steps before the filter has settled
HEAD = (
    "| flights | arrived (95 % interval) | gave up | inside | largest error | delta-v "
    "| NEES, mean; band; times inside |\n"
    "|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True, eq=False)
class Flight:
    """Results of one flight; ``nees`` by period, NaN without an estimate."""

    outcome: str
    error_m: float
    error_deg: float
    delta_v_m_s: float
    violations: int
    nees: np.ndarray

    @property
    def arrived(self) -> bool:
        """True if the flight meets the hold point's requirements and enters the sphere only inside the corridor."""
        near = self.error_m <= 0.2 and self.error_deg <= 2.0
        return self.outcome == "arrived" and near and self.violations == 0


def flown(scenario: str, seeds: Sequence[int], pose: Literal["noisy", "truth"]) -> list[Flight]:
    """Return flights on noisy or true poses, without images."""
    plan = planned(scenario, 0, any_view=False)
    results = [fly_without_pictures(plan, ClosedLoopConfig(seed=seed), pose) for seed in seeds]
    return [
        Flight(
            r.outcome,
            r.final_error_m,
            r.final_error_deg,
            r.delta_v_m_s,
            r.keep_out_violations,
            np.array([np.nan if s.nees is None else s.nees for s in r.steps]),
        )
        for r in results
    ]


def drawn(paths: Sequence[Path]) -> list[Flight]:
    """Return the flights recorded by `tools.studies.drawn_loop`."""
    flights = []
    for path in paths:
        with np.load(path) as file:
            final = file["final"]
            flights.append(
                Flight(
                    str(file["outcome"]), final[0], final[1], final[3], int(file["violations"]), file["nees"]
                )
            )
    return flights


def row(name: str, flights: Sequence[Flight]) -> str:
    """Return a row of the table."""
    arrived = [f for f in flights if f.arrived]
    low, high = wilson_interval(len(arrived), len(flights)) or (0.0, 1.0)
    counted = arrived or flights
    shortest = min(len(f.nees) for f in counted)
    by_time = np.nanmean(np.array([f.nees[SETTLED:shortest] for f in counted]), axis=0)
    least, most = nees_band(len(counted), STATES)
    inside = np.mean((by_time > least) & (by_time < most))
    return (
        f"| {name}: {len(flights)} | {len(arrived)} ({low:.0%} to {high:.0%}) "
        f"| {sum(f.outcome == 'aborted' for f in flights)} | {sum(f.violations > 0 for f in flights)} "
        f"| {1e3 * max(f.error_m for f in counted):.0f} mm, {max(f.error_deg for f in counted):.2f} deg "
        f"| {np.mean([f.delta_v_m_s for f in flights]):.2f} m/s "
        f"| {np.mean(by_time):.1f}; {least:.1f} to {most:.1f}; {inside:.0%} |"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", help="FIRST-LAST")
    parser.add_argument("--drawn", type=Path, nargs="*", default=[])
    options = parser.parse_args()
    print(HEAD)
    for folder in options.drawn:
        for scenario in SCENARIOS:
            paths = sorted(folder.glob(f"{scenario}-[0-9]*.npz"))
            if paths:
                print(row(f"{scenario}, drawn", drawn(paths)), flush=True)
    if options.seeds:
        for pose in ("noisy", "truth"):
            for scenario in SCENARIOS:
                print(row(f"{scenario}, {pose}", flown(scenario, seeds_of(options.seeds), pose)), flush=True)


if __name__ == "__main__":
    main()
