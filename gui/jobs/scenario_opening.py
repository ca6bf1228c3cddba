"""Opening a scenario beside the flight: it is read and propagated in a thread."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario

if TYPE_CHECKING:
    from flyaround.simulator.scenario.scenario import Scenario


class ScenarioOpener:
    """A loader of scenarios, one at a time, in a thread of its own."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="scenario")
        self._pending: Future[FlightSession] | None = None
        self.name = ""
        self.scenario: str | Scenario = ""
        self.source = ""
        """Built-in name or file of the scenario opened last; empty if it is in no file."""

    def is_busy(self) -> bool:
        """Return True while a scenario is being opened."""
        return self._pending is not None

    def open(self, scenario: str | Scenario, *, flies: bool = False) -> None:
        """Start opening a scenario, given by name, file or object.

        A recorded flight is paused and can be sought through; with ``flies`` it is flown, as any other scenario.

        Raises
        ------
        UserError
            If another one is being opened.
        """
        if self._pending is not None:
            raise UserError(f"{self.name} is still being opened")
        self.scenario, self.name = scenario, scenario if isinstance(scenario, str) else scenario.name
        self.source = scenario if isinstance(scenario, str) else ""
        self._pending = self._pool.submit(_open, scenario, flies)

    def abandon(self) -> None:
        """Discard the scenario that is being opened; its thread ends by itself."""
        self._pending = None
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="scenario")

    def take(self) -> FlightSession | None:
        """Return the opened flight, once.

        Raises
        ------
        UserError
            If it could not be opened; the message says why.
        """
        if self._pending is None or not self._pending.done():
            return None
        pending, self._pending = self._pending, None
        try:
            return pending.result()
        except (ValueError, OSError, MemoryError) as error:
            raise UserError(f"{self.name} could not be opened: {error}") from error


def _open(scenario: str | Scenario, flies: bool) -> FlightSession:  # noqa: FBT001 - positional in a private call
    session = FlightSession.of(load_scenario(scenario) if isinstance(scenario, str) else scenario)
    if not flies:
        session.show_recording()
        session.clock.paused = session.look_back.active
    return session
