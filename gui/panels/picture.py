"""Panel of the view's settings: exposure, detail, overlays and layers of the world."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.commands.display import MOST_STOPS
from flyaround.gui.picture.view_settings import DETAILS, LAYERS, OVERLAYS, exposure_text
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console


class PicturePanel(Panel):
    """Exposure, colour, noise, detail, layers of the world; save the picture."""

    name, title, place, shown = "picture", "Picture", "right-low", True

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, settings = self._w, console.options.settings
        imgui = w.imgui
        if console.shown.get("stage") and "camera" in console.help.behind:
            w.text("The view shows a stage of the estimator.", style.WARN)
            w.button(console, "panel.camera", label="Show the camera", width=w.width)
        exposure_s = console.session.plan.scenario.sensor.exposure_s * 2.0**settings.exposure_stops
        tip = "exposure time, and its difference from the scenario's in powers of two"
        w.field(f"Exposure {exposure_text(exposure_s)} [stops]", tip, 0.3)
        now = settings.exposure_stops
        w.entry("stops", f"{now:+.1f}", lambda text: console.attempt("picture.exposure", text), tip)
        imgui.set_next_item_width(-1)
        typed_above = imgui.SliderFlags_.no_input
        changed, stops = imgui.slider_float("##exposure", now, -MOST_STOPS, MOST_STOPS, "", typed_above)
        w.tip(f"{console.table['picture.exposure'].hover_text()}\nright-click to reset")
        if imgui.is_item_clicked(imgui.MouseButton_.right):
            changed, stops = True, 0.0
        if changed:
            console.do("picture.exposure", round(stops, 2))
        w.buttons(console, ("picture.meter", "panel.lights"), 2)
        w.field("Detail", console.table["picture.detail"].hover_text(), 0.6)
        w.choice(console, "picture.detail", settings.detail, DETAILS)
        overlays = [f"overlay.{name}" for name in OVERLAYS]
        w.switches(console, ("picture.colour", "picture.noise"), overlays)
        w.button(console, "picture.save", label="Saving ..." if console.feed.saving else None, width=w.width)
        w.section("Over the view")
        w.switches(console, overlays)
        w.section("World")
        w.text("Omitted from the console's pictures; the scenario is unchanged.", style.QUIET)
        w.switches(console, [f"world.{name.replace('_', '-')}" for name in LAYERS], overlays)
