"""Figures of the flight for people: titles with units, formats and hover texts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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


FIGURES: dict[str, Figure] = {
    "Range": Figure(
        "range [m]", "{:9.3f} m", "from the camera to the target's centre of mass", lambda r: (r.range_m,)
    ),
    "Closing": Figure(
        "closing speed [m/s]",
        "{:+z9.4f} m/s",
        "how fast the range shrinks; minus: it grows",
        lambda r: (r.closing_m_s,),
    ),
    "Across": Figure(
        "speed across the line of sight [m/s]",
        "{:9.4f} m/s",
        "speed across the line of sight, in the target's LVLH frame",
        lambda r: (r.lateral_m_s,),
    ),
    "LVLH m": Figure(
        "radial, along, cross [m]",
        "{:+z8.3f}",
        "place beside the target [m]: radial (outward), along-track, cross-track",
        lambda r: r.position_lvlh_m,
    ),
    "LVLH mm/s": Figure(
        "speed radial, along, cross [mm/s]",
        "{:+z8.2f}",
        "speed in the same axes, which turn with the orbit [mm/s]",
        lambda r: tuple(1e3 * v for v in r.velocity_lvlh_m_s),
    ),
    "Rel. °/s": Figure(
        "target's rate x, y, z [°/s]",
        "{:+z8.3f}",
        "how the target turns before the camera [°/s]: about its x (right), y (down), z (ahead)",
        lambda r: r.relative_rate_deg_s,
    ),
    "Cam. °/s": Figure(
        "camera's rate x, y, z [°/s]",
        "{:+z8.3f}",
        "how the camera turns against the stars [°/s]: about its x (right), y (down), z (ahead)",
        lambda r: r.camera_rate_deg_s,
    ),
    "Off axis": Figure(
        "off the boresight [°]",
        "{:.2f}°",
        "from the middle of the view to the target's centre of mass [°]",
        lambda r: (r.off_boresight_deg,),
    ),
    "Altitude": Figure(
        "altitude [km]",
        "{:.1f} km",
        "of the target above a sphere of the equatorial radius",
        lambda r: (r.altitude_km,),
    ),
    "Phase": Figure(
        "phase angle [°]",
        "{:9.1f} °",
        "angle Sun, target, camera: at 0 the Sun stands behind the camera",
        lambda r: (r.phase_deg,),
    ),
    "Sun": Figure(
        "share of the Sun's disc [%]",
        "{:9.0f} %",
        "share of the Sun's disc that the target sees past the Earth and the Moon",
        lambda r: (100.0 * r.sun_visible_fraction,),
    ),
}
"""Figures by their names on the screen."""
