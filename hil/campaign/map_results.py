"""Settings and results of a delay map, delay_map.json, with the latency at which half of the flights fail."""

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
    inputs : str
        SHA-256 of the scenario.
    flights : int
        Flights of each cell, with the seeds from ``first_seed`` on.
    check, check_flights : int
        Cells flown again, drawn and with a board, and flights of each.
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
    """Latency at which half of the approaches fail, for a jitter and a share of drops.

    ``latency_s`` is null where no latency was flown at which half fail; ``above_s`` and ``below_s`` are the nearest
    latencies whose success is more, and less, than a half by its 95 % interval.
    """

    jitter_s: float
    drops: Share
    latency_s: float | None
    above_s: float | None
    below_s: float | None
    words: str

    @staticmethod
    def of(row: Sequence[CellResult]) -> HalfLatency:
        """Interpolate the latency of 50 % success, in cells of one jitter and share of drops.

        The shares are fitted by isotonic regression, so that they never rise with latency.

        Parameters
        ----------
        row : sequence of CellResult
            Cells by rising latency.
        """
        levels = [r.latency_s for r in row]
        fit = isotonic_regression([r.share for r in row], weights=[r.flights for r in row], increasing=False)
        shares = np.asarray(fit.x)
        # the first level at which at most half succeed
        k = next((k for k, share in enumerate(shares) if share <= 0.5), len(levels))
        above = max((r.latency_s for r in row[:k] if r.low > 0.5), default=None)
        below = min((r.latency_s for r in row[k:] if r.high < 0.5), default=None)
        at = None
        if 0 < k < len(levels):
            step = (shares[k - 1] - 0.5) / (shares[k - 1] - shares[k])
            at = float(levels[k - 1] + step * (levels[k] - levels[k - 1]))
            low = "?" if above is None else f"{above:.3g}"
            high = "?" if below is None else f"{below:.3g}"
            words = f"{at:.3g} s ({low} to {high})"
        elif above is not None:
            words = f"above {above:g} s"
        else:
            words = "not found" if below is None else f"below {below:g} s"
        return HalfLatency(
            jitter_s=row[0].jitter_s,
            drops=row[0].drops,
            latency_s=at,
            above_s=above,
            below_s=below,
            words=words,
        )


class CheckedCell(msgspec.Struct, frozen=True, kw_only=True):
    """Cell flown again with rendered frames and a board; ``agree`` if the two intervals overlap."""

    without_pictures: CellResult
    drawn: CellResult
    agree: bool


class DelayMapOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """Result of a delay map: delay_map.json.

    Attributes
    ----------
    half : tuple of HalfLatency
        Result for each jitter and share of drops.
    extended : tuple of float
        Latencies beyond those requested, because success was.
    not yet
        rare there. refined : cells between two latencies, for the first jitter and the first share of drops alone.
    """

    schema: Literal["flyaround.delay_map"] = "flyaround.delay_map"
    version: Literal[1] = 1
    settings: MapSettings
    half: tuple[HalfLatency, ...]
    extended: tuple[float, ...]
    cells: tuple[CellResult, ...]
    refined: tuple[CellResult, ...]
    checked: tuple[CheckedCell, ...]
