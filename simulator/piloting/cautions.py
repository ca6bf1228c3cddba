"""What a flight meets that an operator must know of: each is told once, when it begins."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from flyaround.simulator.piloting.session import Session

QUIET_S = 5.0
"""A keep-out sphere that lets go for less than this has not let go."""
FUEL_SHARE = 0.04
"""Of the chaser's mass at the start; the tanks of small craft hold some 5 %."""

Caution = tuple[Literal["note", "caution", "warning"], str]


class CautionWatch:
    """Compares a flight with what it was at the last look; another flight is begun anew."""

    def __init__(self) -> None:
        self._session: Session | None = None
        self._guarded_s = -QUIET_S
        self._lit = True
        self._fuel_low = False

    def news(self, session: Session) -> list[Caution]:
        """What has begun since the last look; nothing while one looks back."""
        if session.look_back.active:
            return []
        lit = session.moment.world.sun_visible_fraction > 0.0
        propellant = session.steering.propellant
        fuel_low = propellant.used_kg >= FUEL_SHARE * propellant.thrusters.mass_kg
        told: list[Caution] = []
        if session is self._session:
            if session.guarded and not self._guarded_s <= session.t_s < self._guarded_s + QUIET_S:
                told.append(("caution", "keep-out sphere: the steering is overruled, the chaser turned away"))
            if lit != self._lit:
                told.append(
                    ("note", "the target is in sunlight again")
                    if lit
                    else ("caution", "eclipse: the target has lost the Sun")
                )
            if fuel_low and not self._fuel_low:
                told.append(("caution", f"fuel is low: {propellant.used_kg:.1f} kg of propellant are burnt"))
        else:
            self._guarded_s = -QUIET_S
        if session.guarded:
            self._guarded_s = session.t_s
        self._session, self._lit, self._fuel_low = session, lit, fuel_low
        return told
