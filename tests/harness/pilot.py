"""A pilot of the tests: switches held for some seconds."""

from __future__ import annotations

from flyaround.simulator.piloting.control_laws import COARSE_GAIN, FINE_GAIN
from flyaround.simulator.piloting.orders import PilotCommand
from flyaround.simulator.piloting.session import FlightSession

TICK_S = 0.02
GAINS = {"coarse": COARSE_GAIN, "fine": FINE_GAIN}


def holding(*names: str) -> PilotCommand:
    """The command of closed switches; ``coarse`` and ``fine`` are gains."""
    gain = 1.0
    for name in names:
        gain *= GAINS.get(name, 1.0)
    return PilotCommand(switches=frozenset(names) - set(GAINS), gain=gain)


def fly(session: FlightSession, seconds: float, *names: str) -> list[tuple[str, str]]:
    """Hold them, tick by tick, and return the news."""
    command = holding(*names)
    return [news for _ in range(round(seconds / TICK_S)) for news in session.step(command, TICK_S).news]
