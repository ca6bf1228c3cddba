"""Figures of the flight for people: titles with units, formats and hover texts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.gui.texts import texts

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.piloting.telemetry import Telemetry

OLD_S = 3.0
"""Age beyond which a picture's age stands beside its figures, at 1x; labels are drawn seldom."""
AGE_TIP = "simulated time between the picture and now; these figures are of the picture"


def age_text(session: FlightSession, t_s: float) -> str:
    """Return the age of a picture of this time, or an empty text if it is new at the present rate."""
    age_s = abs(session.t_s - t_s)
    return f"{age_s:.0f} s old" if age_s > OLD_S * max(session.clock.rate, 1.0) else ""


@dataclass(frozen=True)
class Figure:
    """A figure of the flight for people.

    Parameters
    ----------
    title : str
        Title with unit.
    form : str
        Format of each value.
    tip : str
        Hover text.
    values : callable
        Function that returns the number, or three components.
    """

    title: str
    form: str
    tip: str
    values: Callable[[Telemetry], tuple[float, ...]]


VALUES: dict[str, tuple[str, Callable[[Telemetry], tuple[float, ...]]]] = {
    "Range": ("{:9.3f} m", lambda r: (r.range_m,)),
    "Closing": ("{:+z9.4f} m/s", lambda r: (r.closing_m_s,)),
    "Across": ("{:9.4f} m/s", lambda r: (r.lateral_m_s,)),
    "Position m": ("{:+z8.3f}", lambda r: r.position_lvlh_m),
    "Velocity mm/s": ("{:+z8.2f}", lambda r: tuple(1e3 * v for v in r.velocity_lvlh_m_s)),
    "Target °/s": ("{:+z8.3f}", lambda r: r.relative_rate_deg_s),
    "Camera °/s": ("{:+z8.3f}", lambda r: r.camera_rate_deg_s),
    "Off axis": ("{:.2f}°", lambda r: (r.off_boresight_deg,)),
    "Altitude": ("{:.1f} km", lambda r: (r.altitude_km,)),
    "Phase": ("{:9.1f} °", lambda r: (r.phase_deg,)),
    "Sun": ("{:9.0f} %", lambda r: (100.0 * r.sun_visible_fraction,)),
}
"""Format and values of each figure."""
FIGURES = {
    name: Figure(title, form, tip, values)
    for (name, (form, values)), (title, tip) in zip(VALUES.items(), texts("figures").values(), strict=True)
}
"""Figures by their names on the screen."""
