"""Statistics behind `hil.navigation.measurement.PoseNoise`: sizes of pose errors and their correlation in time.

    python -m tools.studies.drawn_loop OUT --seeds 9000-9006 --pose truth --any-view
    python -m tools.studies.pose_errors OUT

The two tables are printed in Markdown. An error counts as wrong if one of its parts exceeds five sigma, where sigma is
computed without the wrong errors, because a filter's gate excludes those.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from flyaround.simulator.world.frames.rotation import matrix_from_quat, rotvec_between

# intervals of range, farthest first
RANGES_M = ((15.0, 19.0), (10.0, 15.0), (6.0, 10.0), (4.0, 6.0), (2.0, 4.0))
LAGS_S = (1, 2, 5, 10, 20, 30, 45, 60, 90, 120)  # time lags of the correlation
WRONG_SIGMAS = 5.0  # number of standard deviations beyond which a pose is wrong
# components of an error vector
PARTS = {"across": slice(0, 2), "along": slice(2, 3), "tilt": slice(3, 5), "roll": slice(5, 6)}


@dataclass(frozen=True, eq=False)
class FlightErrors:
    """Errors of one flight's accepted poses, one row per image.

    Parameters
    ----------
    t_s : (n,) array
        Time since the start of the flight.
    range_m : (n,) array
        Range of the target.
    turn_rad : (n,) array
        Rotation of the target in the camera frame since the start.
    errors : (n, 6) array
        Position errors along the camera axes right, down, forward [m] and rotation errors about them [rad]; NaN
        where no pose is accepted.
    """

    t_s: np.ndarray
    range_m: np.ndarray
    turn_rad: np.ndarray
    errors: np.ndarray


def read_flight(path: Path) -> FlightErrors:
    """Return the errors of the poses in a file of `tools.studies.drawn_loop`."""
    with np.load(path) as file:
        accepted, true_q, true_t = file["accepted"], file["true_q"], file["true_t"]
        q, t, t_s = file["q"], file["t"], file["look_s"]
    errors = np.full((len(t_s), 6), np.nan)
    for k in np.flatnonzero(accepted):
        errors[k, :3] = t[k] - true_t[k]
        errors[k, 3:] = matrix_from_quat(true_q[k]) @ rotvec_between(true_q[k], q[k])
    turns = [float(np.linalg.norm(rotvec_between(a, b))) for a, b in pairwise(true_q)]
    return FlightErrors(t_s, np.linalg.norm(true_t, axis=1), np.cumsum([0.0, *turns]), errors)


def normalised(flights: list[FlightErrors]) -> list[np.ndarray]:
    """Return the errors divided by the sigma of their range, wrong errors as NaN."""
    shares = [f.errors / np.column_stack([*[f.range_m] * 3, *[np.ones(len(f.range_m))] * 3]) for f in flights]
    all_shares = np.vstack(shares)
    sigma = 1.4826 * np.nanmedian(np.abs(all_shares), axis=0)
    for _ in range(20):
        right = np.all(np.abs(all_shares) <= WRONG_SIGMAS * sigma, axis=1)
        sigma = np.sqrt(np.mean(all_shares[right] ** 2, axis=0))
    result = []
    for share in shares:
        wrong = ~np.all(np.abs(share) <= WRONG_SIGMAS * sigma, axis=1)
        result.append(np.where(wrong[:, None], np.nan, share / sigma))
    return result


def by_range(flights: list[FlightErrors], normalised_errors: list[np.ndarray]) -> str:
    """Return the RMS of each part of the errors by range, without wrong errors."""
    ranges = np.concatenate([f.range_m for f in flights])
    errors = np.vstack([f.errors for f in flights])
    right = np.isfinite(np.vstack(normalised_errors)[:, 0])
    lines = [
        "| range [m] | poses | across [mm] | along [mm] | tilt [deg] | roll [deg] |",
        "|---|---|---|---|---|---|",
    ]
    for low, high in RANGES_M:
        rows = errors[right & (ranges >= low) & (ranges < high)]
        across, along, tilt, roll = (float(np.sqrt(np.mean(rows[:, part] ** 2))) for part in PARTS.values())
        lines.append(
            f"| {low:g}-{high:g} | {len(rows)} | {1e3 * across:.2f} | {1e3 * along:.1f} | {np.degrees(tilt):.3f} | "
            f"{np.degrees(roll):.3f} |"
        )
    accepted = np.isfinite(errors[:, 0])
    wrong = 1 - right.sum() / accepted.sum()
    lines.append(f"\nOf {len(errors)} images {accepted.mean():.1%} accepted, of those {wrong:.1%} wrong.")
    return "\n".join(lines)


def by_lag(flights: list[FlightErrors], errors: list[np.ndarray]) -> str:
    """Return the autocorrelation of the normalised errors over the lag, averaged over all parts."""
    head = " | ".join(str(lag) for lag in LAGS_S)
    lines = [f"| lag [s] | {head} |", "|---" * (len(LAGS_S) + 1) + "|"]
    turning = [f.turn_rad[-1] / f.t_s[-1] > np.radians(0.5) for f in flights]
    for name, is_tumbling in (("steady", False), ("tumbling", True)):
        chosen = [
            (f, x) for f, x, turns in zip(flights, errors, turning, strict=True) if bool(turns) is is_tumbling
        ]
        variance = np.nanmean(np.vstack([x for _, x in chosen]) ** 2)
        cells, turned, nearer = [], [], []
        for lag in LAGS_S:
            products = np.concatenate([(x[lag:] * x[:-lag]).ravel() for _, x in chosen])
            cells.append(f"{np.nanmean(products) / variance:.2f}")
            turned.append(
                np.degrees(np.mean([np.mean(f.turn_rad[lag:] - f.turn_rad[:-lag]) for f, _ in chosen]))
            )
            nearer.append(np.mean([np.mean(f.range_m[:-lag] / f.range_m[lag:]) for f, _ in chosen]))
        lines.append(f"| {name}: correlation | {' | '.join(cells)} |")
        lines.append(f"| turned meanwhile [deg] | {' | '.join(f'{x:.1f}' for x in turned)} |")
        lines.append(f"| ratio of the ranges | {' | '.join(f'{x:.2f}' for x in nearer)} |")
    return "\n".join(lines)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("flights", type=Path)
    flights = [read_flight(path) for path in sorted(parser.parse_args().flights.glob("*.npz"))]
    errors = normalised(flights)
    print(f"{len(flights)} flights\n")
    print(by_range(flights, errors))
    print()
    print(by_lag(flights, errors))


if __name__ == "__main__":
    main()
