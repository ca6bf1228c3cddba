"""A console without a window, whose flight alone counts."""

from __future__ import annotations

from flyaround.gui.app import command_table, options_of
from flyaround.gui.command_table import CommandTable
from flyaround.gui.console import Console
from flyaround.gui.picture.feed import Feed
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.scenario import Scenario
from tests.harness.no_renderer import NoRenderer


def console_flying(
    scenario: str | Scenario = "tango-flyaround", table: CommandTable | None = None
) -> Console:
    """A console that flies a scenario, by name or as it is; no picture of it is drawn."""
    session = FlightSession.of(load_scenario(scenario) if isinstance(scenario, str) else scenario)
    return Console(session, Feed(NoRenderer()), options_of(session), table or command_table())
