"""Settings and results of a delay map, delay_map.json, with the latency of 50 % success."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import numpy as np
from scipy.optimize import isotonic_regression

if TYPE_CHECKING:
    from collections.abc import Sequence

Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Count = Annotated[int, msgspec.Meta(ge=0)]


class MapSettings(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of a delay map, ``settings.json``, which identify it.

    Attributes
    ----------
    schema : str
        Name of the format.
    version : int
        Version of the format.
    scenario : str
        Name of the scenario.
    inputs : str
        SHA-256 of the scenario.
    latencies_s : tuple of float
        Latencies of the poses.
    jitters_s : tuple of float
        Largest additional random latencies.
    drops : tuple of float
        Shares of lost poses.
    flights : int
        Flights per cell, with seeds starting at ``first_seed``.
    first_seed : int
        Seed of the first flight of each cell.
    every_s : float or None
        Time between poses; None for the thrusters' control period.
    check : int
        Number of cells that are verified with rendered images and a board.
    check_flights : int
        Flights in each of these.
    """

    schema: Literal["flyaround.delay_map_settings"] = "flyaround.delay_map_settings"
    version: Literal[1] = 1
    scenario: str
    inputs: str
    latencies_s: tuple[float, ...]
    jitters_s: tuple[float, ...]
    drops: tuple[float, ...]
    flights: int
    first_seed: int
    every_s: float | None
    check: int
    check_flights: int


class CellResult(msgspec.Struct, frozen=True, kw_only=True):
    """Cell of the map: flights, successes, and Wilson's 95 % interval of their share."""

    latency_s: float
    jitter_s: float
    drops: Share
    flights: Count
    successes: Count
    low: Share
    high: Share

    @property
    def share(self) -> float:
        """Share of flights that succeeded."""
        return self.successes / self.flights


class HalfLatency(msgspec.Struct, frozen=True, kw_only=True):
    """Latency of 50 % success, for one jitter and loss rate.

    ``latency_s`` is null if the success rate does not fall to one half. ``above_s`` and ``below_s`` are the nearest
    latencies whose success is above, and below, one half by its 95 % interval.
    """

    jitter_s: float
    drops: Share
    latency_s: float | None
    above_s: float | None
    below_s: float | None
    words: str

    @staticmethod
    def from_row(row: Sequence[CellResult]) -> HalfLatency:
        """Interpolate the latency of 50 % success from cells of one jitter and loss rate.

        The shares are fitted by isotonic regression, so that they do not increase with latency.

        Parameters
        ----------
        row : sequence of CellResult
            Cells by increasing latency.
        """
        levels = [r.latency_s for r in row]
        fit = isotonic_regression([r.share for r in row], weights=[r.flights for r in row], increasing=False)
        shares = np.asarray(fit.x)
        # first level at which at most half succeed
        k = next((k for k, share in enumerate(shares) if share <= 0.5), len(levels))
        above = max((r.latency_s for r in row[:k] if r.low > 0.5), default=None)
        below = min((r.latency_s for r in row[k:] if r.high < 0.5), default=None)
        latency_s = None
        if 0 < k < len(levels):
            step = (shares[k - 1] - 0.5) / (shares[k - 1] - shares[k])
            latency_s = float(levels[k - 1] + step * (levels[k] - levels[k - 1]))
            low = "?" if above is None else f"{above:.3g}"
            high = "?" if below is None else f"{below:.3g}"
            text = f"{latency_s:.3g} s ({low} to {high})"
        elif above is not None:
            text = f"above {above:g} s"
        else:
            text = "not found" if below is None else f"below {below:g} s"
        return HalfLatency(
            jitter_s=row[0].jitter_s,
            drops=row[0].drops,
            latency_s=latency_s,
            above_s=above,
            below_s=below,
            words=text,
        )


class CheckedCell(msgspec.Struct, frozen=True, kw_only=True):
    """Cell verified with rendered frames and a board; ``agree`` if the two intervals overlap."""

    without_pictures: CellResult
    drawn: CellResult
    agree: bool


class DelayMapOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a delay map: delay_map.json.

    Attributes
    ----------
    schema : str
        Name of the format.
    version : int
        Version of the format.
    settings : MapSettings
        Settings of the map.
    half : tuple of HalfLatency
        Result for each jitter and loss rate.
    extended : tuple of float
        Latencies beyond those requested, added because success was not yet rare there.
    cells : tuple of CellResult
        Result of each combination of latency, jitter and loss.
    refined : tuple of CellResult
        Cells between two latencies, for the first jitter and the first loss rate only.
    checked : tuple of CheckedCell
        Cells that were flown again with rendered images and a board.
    """

    schema: Literal["flyaround.delay_map"] = "flyaround.delay_map"
    version: Literal[1] = 1
    settings: MapSettings
    half: tuple[HalfLatency, ...]
    extended: tuple[float, ...]
    cells: tuple[CellResult, ...]
    refined: tuple[CellResult, ...]
    checked: tuple[CheckedCell, ...]
