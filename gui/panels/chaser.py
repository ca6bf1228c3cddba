"""Who flies the chaser, and its figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console


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
        )
        millimetres = tuple(1e3 * v for v in r.velocity_lvlh_m_s)
        w.row("  mm/s", millimetres, "{:+8.2f}", "speed in the same axes, which turn with the orbit [mm/s]")
        w.row(
            "Rel. °/s",
            r.relative_rate_deg_s,
            "{:+8.3f}",
            "how the target turns before the camera [deg/s]: about its x (right), y (down), z (ahead)",
        )
        w.row(
            "Cam. °/s",
            r.camera_rate_deg_s,
            "{:+8.3f}",
            "how the camera turns against the stars [deg/s]: about its x (right), y (down), z (ahead)",
        )
        w.row(
            "Off axis",
            (r.off_boresight_deg,),
            "{:.2f}°",
            "from the middle of the view to the target's centre of mass [deg]",
        )
        w.row(
            "Altitude", (r.altitude_km,), "{:.1f} km", "of the target above a sphere of the equatorial radius"
        )
