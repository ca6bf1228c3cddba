"""The state at one time of an orbit ephemeris message."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.world.messages.oem import read_oem

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant


def oem_state(text: str, where: str, epoch: Instant, centre: str = "EARTH") -> tuple[FloatArray, FloatArray]:
    """Position [m] and velocity [m s-1] in GCRS at ``epoch``."""
    ephemeris = read_oem(text, where, epoch, centre=centre)
    ephemeris.require_span(0.0)
    return ephemeris(0.0)[:2]
