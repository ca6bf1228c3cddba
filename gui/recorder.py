"""The operator's flight on file: states at even times, and the scenario that flies them again."""

from __future__ import annotations

from typing import TYPE_CHECKING

from simulator.files import empty_folder, write_atomic
from simulator.scenario_write import replay_scenario
from simulator.world.recording import Recording

if TYPE_CHECKING:
    from pathlib import Path

    from simulator.scenario import Scenario
    from simulator.world.state import WorldState

EVERY_S = 0.1
"""Simulated time between the states that are kept; at higher rates each step of the session is one."""


class Recorder:
    """Keeps the states of a session from its start; `write` makes the replay."""

    def __init__(self) -> None:
        self.states: list[WorldState] = []

    def wants(self, t_s: float) -> bool:
        """Whether the state at a time is due."""
        # half a millisecond for the sums of steps
        return not self.states or t_s >= self.states[-1].t_s + EVERY_S - 5e-4

    def add(self, state: WorldState) -> None:
        """Keep a state, later than the last."""
        self.states.append(state)

    def clear(self) -> None:
        """Begin again."""
        self.states.clear()

    def write(self, folder: Path, scenario: Scenario) -> Path:
        """Write ``flight.npz`` and ``replay.toml`` into a folder, if `long_enough`; the latter's path.

        Raises
        ------
        UserError
            If the folder is not empty or cannot be written.
        """
        empty_folder(folder, option="--record")
        recording = Recording.of(self.states)
        write_atomic(folder / "flight.npz", recording.to_bytes())
        path = folder / "replay.toml"
        write_atomic(path, replay_scenario(scenario, "flight.npz", recording.duration_s).encode())
        return path

    @property
    def long_enough(self) -> bool:
        """Whether there is something to replay."""
        return len(self.states) > 1
