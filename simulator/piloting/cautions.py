"""Cautions of a flight, each given once when it begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flyaround.simulator.piloting.docking_watch import News
    from flyaround.simulator.piloting.propellant import Propellant
    from flyaround.simulator.world.flight.world_state import WorldState

QUIET_S = 5.0
"""A keep-out sphere that lets go for less than this has not let go."""
FUEL_SHARE = 0.04
"""Share of the chaser's mass at the start; the tanks of small craft hold some 5 %."""


class CautionWatch:
    """Compares a flight with its last state."""

    def __init__(self) -> None:
        self._guarded_s = -QUIET_S
        self._before: tuple[bool, bool] | None = None

    def news(self, world: WorldState, propellant: Propellant, *, guarded: bool) -> list[News]:
        """Return what has begun since the last call; nothing at the first."""
        t_s = world.t_s
        lit = world.sun_visible_fraction > 0.0
        fuel_low = propellant.used_kg >= FUEL_SHARE * propellant.thrusters.mass_kg
        was_lit, was_low = self._before or (lit, fuel_low)
        news: list[News] = []
        if guarded and not self._guarded_s <= t_s < self._guarded_s + QUIET_S:
            news.append(("caution", "keep-out sphere: the steering is overruled, the chaser turned away"))
        if lit and not was_lit:
            news.append(("note", "the target is in sunlight again"))
        if was_lit and not lit:
            news.append(("caution", "eclipse: the target has lost the Sun"))
        if fuel_low and not was_low:
            news.append(("caution", f"fuel is low: {propellant.used_kg:.1f} kg of propellant are burnt"))
        if guarded:
            self._guarded_s = t_s
        self._before = lit, fuel_low
        return news
