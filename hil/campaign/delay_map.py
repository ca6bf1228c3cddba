"""Delay map: success rate of an approach over latency, jitter and loss of its poses, and the 50 % latency."""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import asdict
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.campaign.delay_map_page import write_delay_map_page
from flyaround.hil.campaign.map_flights import Cell, MapFlight, fly_cells
from flyaround.hil.campaign.map_results import (
    CellResult,
    CheckedCell,
    DelayMapOutcome,
    HalfLatency,
    MapSettings,
)
from flyaround.hil.evaluate.metrics import wilson_interval
from flyaround.hil.host.closed_loop_run import frame_every
from flyaround.hil.navigation.closed_loop import check_closed_loop
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder, write_atomic, write_document
from flyaround.simulator.runtime.folder_lock import lock_name, only_writer
from flyaround.simulator.runtime.table_text import table_bytes
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

SETTINGS_JSON, OUTCOME_JSON = "settings.json", "delay_map.json"
FLIGHTS_CSV, CHECKS_CSV, CELLS_CSV = "flights.csv", "checks.csv", "cells.csv"

# Maximum size of accepted settings [bytes].
MAX_BYTES = 1 << 20

# Maximum number of flights of a map, against typing errors.
MAX_FLIGHTS = 1_000_000

EXTENSIONS = 4
"""Largest number of latencies added while more than half of the approaches succeed at the last one."""

REFINED_TO_S = 0.1
"""Resolution of the 50 % latency for the first jitter and the first loss rate [s]."""


def map_delays(
    settings: MapSettings,
    folder: Path,
    *,
    board_command: tuple[str, ...],
    workers: int = 1,
    progress: Callable[[str, int, int], None] = lambda _stage, _done, _total: None,
) -> DelayMapOutcome:
    """Fly every cell, and write ``delay_map.json``, ``cells.csv`` and ``index.html`` with the image.

    The flights render no images: their poses are the truth with errors as measured for the estimator. All cells use the
    same seeds. The same settings give the same bytes, even after interruptions.

    Parameters
    ----------
    settings : MapSettings
        Settings from `settings_for`.
    folder : Path
        New or empty folder, or that of a map with the same settings.
    board_command : tuple of str
        Command that starts a board, for the cells that are verified.
    workers : int, optional
        Number of processes.
    progress : callable, optional
        Called with a label of the flights, the number done and the total.

    Returns
    -------
    DelayMapOutcome
        Success of every cell with its interval.

    Raises
    ------
    UserError
        If the folder holds something else, or cannot be written.
    """
    other_checks = _open_folder(folder, settings)
    with only_writer(folder, "delay-map"):
        if other_checks:
            (folder / CHECKS_CSV).unlink(missing_ok=True)
        write_document(folder / SETTINGS_JSON, settings)
        outcome = _Map(settings, folder, board_command, workers, progress).outcome()
        _write_cells(folder, outcome)
        write_delay_map_page(folder, outcome)
        write_document(folder / OUTCOME_JSON, outcome)
    return outcome


def settings_for(
    scenario: str,
    *,
    latencies_s: Sequence[float],
    jitters_s: Sequence[float],
    drops: Sequence[float],
    flights: int,
    first_seed: int = 1,
    every_s: float | None = None,
    check: int = 0,
    check_flights: int = 5,
) -> MapSettings:
    """Return the validated settings of a map over a scenario.

    Returns
    -------
    MapSettings
        The settings, with the hash of the scenario as it was read.

    Raises
    ------
    UserError
        If the scenario cannot be used, or the levels do not increase.
    """
    for name, levels in (("--latency", latencies_s), ("--jitter", jitters_s), ("--drops", drops)):
        if any(b <= a for a, b in pairwise(levels)):
            raise UserError(f"the levels of {name} must increase, got {', '.join(f'{x:g}' for x in levels)}")
    n_cells = len(latencies_s) * len(jitters_s) * len(drops)
    if n_cells * flights > MAX_FLIGHTS:
        raise UserError(f"{n_cells * flights} flights exceed the limit of {MAX_FLIGHTS}: choose fewer levels")
    if check > n_cells:
        raise UserError(f"--check {check} is more than the map's {n_cells} cells; choose fewer")
    loaded = load_scenario(scenario)
    plan = plan_flight(loaded, n=1)
    check_closed_loop(plan.flight, f"scenario {plan.scenario_name}")
    frame_every(every_s, plan)
    return MapSettings(
        scenario=scenario,
        inputs=hashlib.sha256(msgspec.json.encode(loaded, order="sorted", enc_hook=str)).hexdigest(),
        latencies_s=tuple(latencies_s),
        jitters_s=tuple(jitters_s),
        drops=tuple(drops),
        flights=flights,
        first_seed=first_seed,
        every_s=every_s,
        check=check,
        check_flights=check_flights,
    )


class _Map:
    """Map in progress, flown level by level; the next flights depend on earlier ones."""

    def __init__(
        self,
        settings: MapSettings,
        folder: Path,
        board_command: tuple[str, ...],
        workers: int,
        progress: Callable[[str, int, int], None],
    ) -> None:
        self._settings, self._folder, self._board_command = settings, folder, board_command
        self._workers, self._progress = workers, progress
        self._tasks: list[MapFlight] = []

    def outcome(self) -> DelayMapOutcome:
        """Fly the whole map."""
        s = self._settings
        latencies = list(s.latencies_s)
        cells = self._fly(_grid(latencies, s))
        while len(latencies) < len(s.latencies_s) + EXTENSIONS and self._is_above_half(cells, latencies[-1]):
            step = latencies[-1] - latencies[-2] if len(latencies) > 1 else latencies[-1]
            latencies.append(round(latencies[-1] + step, 6))
            cells |= self._fly(_grid(latencies[-1:], s))
        refined = self._refine_half_latency(cells, latencies)
        half = []
        for drops in s.drops:
            for jitter_s in s.jitters_s:
                between = refined if (jitter_s, drops) == (s.jitters_s[0], s.drops[0]) else {}
                row = [r for c, r in (cells | between).items() if (c.jitter_s, c.drops) == (jitter_s, drops)]
                half.append(HalfLatency.from_row(sorted(row, key=lambda r: r.latency_s)))
        return DelayMapOutcome(
            settings=s,
            half=tuple(half),
            extended=tuple(latencies[len(s.latencies_s) :]),
            cells=tuple(cells[c] for c in sorted(cells, key=_order)),
            refined=tuple(refined[c] for c in sorted(refined, key=_order)),
            checked=self._verify(list(cells.values())),
        )

    def _fly(self, cells: Iterable[Cell]) -> dict[Cell, CellResult]:
        """Return the results of some cells, flown after all earlier ones."""
        new_cells = list(cells)
        self._tasks += self._flights(new_cells, self._settings.flights)
        results = self._simulate(FLIGHTS_CSV, "flights", self._tasks)
        return {cell: results[cell] for cell in new_cells}

    def _flights(
        self, cells: Iterable[Cell], n: int, board_command: tuple[str, ...] | None = None
    ) -> list[MapFlight]:
        s = self._settings
        return [
            MapFlight(s.scenario, cell, s.first_seed + k, s.every_s, board_command)
            for cell in cells
            for k in range(n)
        ]

    def _simulate(self, table: str, label: str, tasks: Sequence[MapFlight]) -> dict[Cell, CellResult]:
        """Fly the flights missing in a table, and return the results of all its cells."""
        progress = partial(self._progress, label)
        outcomes = fly_cells(self._folder / table, tasks, self._workers, progress)
        n, n_successes = (
            Counter(cell for cell, _ in outcomes),
            Counter(cell for cell, success in outcomes if success),
        )
        results = {}
        for cell, flights in n.items():
            low, high = wilson_interval(n_successes[cell], flights) or (0.0, 1.0)
            results[cell] = CellResult(
                **asdict(cell),
                flights=flights,
                successes=n_successes[cell],
                low=round(low, 6),
                high=round(high, 6),
            )
        return results

    def _is_above_half(self, cells: dict[Cell, CellResult], latency_s: float) -> bool:
        """Return True if more than half still succeed for some jitter and loss rate."""
        return any(r.share > 0.5 for cell, r in cells.items() if cell.latency_s == latency_s)

    def _refine_half_latency(
        self, cells: dict[Cell, CellResult], latencies: Sequence[float]
    ) -> dict[Cell, CellResult]:
        """Refine the 50 % latency by bisection between its two neighbours."""
        s = self._settings
        refined: dict[Cell, CellResult] = {}
        shares = [cells[Cell(x, s.jitters_s[0], s.drops[0])].share for x in latencies]
        k = next((k for k, share in enumerate(shares) if share <= 0.5), 0)
        if k == 0:
            return refined
        low, high = latencies[k - 1], latencies[k]
        while high - low > REFINED_TO_S:
            cell = Cell(round(0.5 * (low + high), 6), s.jitters_s[0], s.drops[0])
            refined |= self._fly([cell])
            if refined[cell].share > 0.5:
                low = cell.latency_s
            else:
                high = cell.latency_s
        return refined

    def _verify(self, cells: Sequence[CellResult]) -> tuple[CheckedCell, ...]:
        """Verify some cells with rendered images and a board."""
        s = self._settings
        selected = {Cell(r.latency_s, r.jitter_s, r.drops): r for r in select_cells(cells, s.check)}
        tasks = self._flights(selected, s.check_flights, self._board_command)
        rendered = self._simulate(CHECKS_CSV, "drawn flights", tasks) if tasks else {}
        return tuple(
            CheckedCell(without_pictures=r, drawn=check, agree=check.low <= r.high and r.low <= check.high)
            for r, check in ((selected[cell], check) for cell, check in rendered.items())
        )


def select_cells(cells: Sequence[CellResult], n: int) -> list[CellResult]:
    """Return cells to verify, from full to no success, each as close to the transition as possible."""

    def edge(result: CellResult) -> float:
        burden = result.latency_s + result.jitter_s + 10 * result.drops
        return -burden if result.share > 0.5 else burden

    remaining, selected = list(cells), []
    for target_share in np.linspace(1.0, 0.0, n) if n > 1 else [0.5] * n:
        best = min(remaining, key=lambda r: (abs(r.share - target_share), edge(r), r.latency_s, r.jitter_s))
        remaining.remove(best)
        selected.append(best)
    return selected


def _grid(latencies_s: Iterable[float], s: MapSettings) -> list[Cell]:
    return [Cell(a, b, c) for a in latencies_s for c in s.drops for b in s.jitters_s]


def _order(cell: Cell) -> tuple[float, float, float]:
    return cell.drops, cell.jitter_s, cell.latency_s


def _open_folder(folder: Path, settings: MapSettings) -> bool:
    """Create the folder, or check that it holds this map; return True if its checks have other settings.

    Raises
    ------
    UserError
        If the folder holds something else.
    """
    path = folder / SETTINGS_JSON
    if not path.is_file():
        leftovers = (".part", lock_name("delay-map"))
        if not folder.is_dir() or not all(p.name.endswith(leftovers) for p in folder.iterdir()):
            empty_folder(folder)
        return False
    try:
        former = msgspec.json.decode(read_regular(path, MAX_BYTES), type=MapSettings)
    except msgspec.DecodeError as error:
        raise UserError(f"{path} is damaged ({error}): name another folder with -o") from error
    # other cells may be verified than before
    renewed = msgspec.structs.replace(former, check=settings.check, check_flights=settings.check_flights)
    if renewed != settings:
        raise UserError(f"{folder} has a map of other settings: name another folder with -o")
    return (former.check, former.check_flights) != (settings.check, settings.check_flights)


def _write_cells(folder: Path, outcome: DelayMapOutcome) -> None:
    """Write ``cells.csv``: the cells of the map and the refined latencies."""
    names = (*CellResult.__struct_fields__, "share")
    rows = (
        [*(f"{getattr(r, name):.6g}" for name in names), where]
        for where, results in (("map", outcome.cells), ("between", outcome.refined))
        for r in results
    )
    write_atomic(folder / CELLS_CSV, table_bytes((*names, "where"), rows=rows))
