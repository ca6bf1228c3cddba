"""Who flies the chaser, and its figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.panels.plots import FIGURES
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console


NUMBER = {name: k for k, name in enumerate(FIGURES)}


class ChaserPanel(Panel):
    """Guidance or steering by hand; position, speeds and rates of the picture's moment."""

    name, title, place, shown = "chaser", "Chaser", "right-upper", True

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w = self._w
        w.buttons(console, ("steer.toggle", "steer.track", "steer.centre", "steer.stop", "steer.reset"), 3)
        picture = console.feed.newest
        w.section("State")
        if picture is None:
            w.text("no picture yet", style.QUIET)
            return
        r = picture.telemetry
        w.row(
            "LVLH m",
            r.position_lvlh_m,
            "{:+8.3f}",
            "place beside the target [m]: radial (outward), along-track, cross-track",
            figure=NUMBER["LVLH m"],
        )
        millimetres = tuple(1e3 * v for v in r.velocity_lvlh_m_s)
        w.row(
            "  mm/s",
            millimetres,
            "{:+8.2f}",
            "speed in the same axes, which turn with the orbit [mm/s]",
            figure=NUMBER["  mm/s"],
        )
        w.row(
            "Rel. °/s",
            r.relative_rate_deg_s,
            "{:+8.3f}",
            "how the target turns before the camera [deg/s]: about its x (right), y (down), z (ahead)",
            figure=NUMBER["Rel. °/s"],
        )
        w.row(
            "Cam. °/s",
            r.camera_rate_deg_s,
            "{:+8.3f}",
            "how the camera turns against the stars [deg/s]: about its x (right), y (down), z (ahead)",
            figure=NUMBER["Cam. °/s"],
        )
        w.row(
            "Off axis",
            (r.off_boresight_deg,),
            "{:.2f}°",
            "from the middle of the view to the target's centre of mass [deg]",
            figure=NUMBER["Off axis"],
        )
        w.row(
            "Altitude",
            (r.altitude_km,),
            "{:.1f} km",
            "of the target above a sphere of the equatorial radius",
            figure=NUMBER["Altitude"],
        )
