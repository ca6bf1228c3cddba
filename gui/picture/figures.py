"""Figures of the flight for people: titles with units, formats and hover texts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.texts import texts
from flyaround.simulator.piloting.readouts import SPEED_DECIMALS

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.piloting.telemetry import Telemetry

OLD_S = 3.0
"""Age beyond which a view tells that of its picture, and marks it at 1x; further views are drawn seldom."""
AGE_TIP = "simulated time between this picture and the clock"


def age_text(session: FlightSession, t_s: float, told_s: float = OLD_S) -> tuple[str, style.Rgba]:
    """Return the age of a picture of this time, empty below ``told_s``, with its colour at the present rate."""
    age_s = abs(session.t_s - t_s)
    colour = style.WARN if age_s > OLD_S * max(session.clock.rate, 1.0) else style.INK
    old = "s old" if session.clock.rate == 1.0 else "s old (sim)"
    return f"{age_s:.1f} {old}" if age_s >= told_s else "", colour


def flown_colour(session: FlightSession, by_hand: style.Rgba) -> style.Rgba:
    """Return the colour of the controller's name, which under manual control is ``by_hand``."""
    steering = session.craft.steering
    return style.OUTSIDE if steering.aborting else style.ACCENT if steering.doing else by_hand


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
    "Closing": (f"{{:+z9.{SPEED_DECIMALS}f}} m/s", lambda r: (r.closing_m_s,)),
    "Across": (f"{{:9.{SPEED_DECIMALS}f}} m/s", lambda r: (r.lateral_m_s,)),
    "Position [m]": ("{:+z8.3f}", lambda r: r.position_lvlh_m),
    "Velocity [m/s]": (f"{{:+z8.{SPEED_DECIMALS}f}}", lambda r: r.velocity_lvlh_m_s),
    "Target [°/s]": ("{:+z8.3f}", lambda r: r.relative_rate_deg_s),
    "Camera [°/s]": ("{:+z8.3f}", lambda r: r.camera_rate_deg_s),
    "Off boresight": ("{:.2f}°", lambda r: (r.off_boresight_deg,)),
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
