"""Camera and sensor: lens, every noise term, and the picture's histogram."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.commands.camera import SCENARIO
from flyaround.gui.picture.sensor_terms import BINS, Histogram, SensorTerm, histogram_of, terms_of
from flyaround.gui.picture.view_settings import changed_sensor
from flyaround.gui.texts import NOTES
from flyaround.gui.widgets import Panel
from flyaround.simulator.camera.lens.files import list_cameras

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.picture.feed import Picture


class SensorPanel(Panel):
    """The camera, the terms of its sensor, and the histogram of the picture."""

    name, title, place, shown = "sensor", "Sensor", "right-low", True

    _counted: Picture | None = None
    _histogram: Histogram | None = None
    _camera = SCENARIO

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, settings = self._w, console.options.settings
        self._draw_histogram(console)
        w.section("Camera")
        self._camera = SCENARIO if settings.camera is None else self._camera
        self._camera = w.choice(console, "camera.use", self._camera, (SCENARIO, *list_cameras()))
        scene = console.session.scene()
        c = settings.camera or scene.camera
        sizes = (c.width_px / c.fx_px, c.height_px / c.fy_px)
        across, up = (2 * math.degrees(math.atan(size / 2)) for size in sizes)
        lens = "no distortion" if c.distortion.is_none else c.distortion.model.replace("_", " ")
        field = f"{across:.1f}° x {up:.1f}° at the axis"
        w.text(f"{c.width_px} x {c.height_px} px, f {c.fx_px:.0f} px, {field}, {lens}", tip=NOTES["camera"])
        w.section("Sensor")
        sensor = changed_sensor(scene.sensor, settings.sensor_changes)
        photons = ", photon noise" if sensor.detector else ""
        w.text(f"{sensor.preset}, {sensor.bits} bit{photons}", style.QUIET, NOTES["sensor"])
        w.switch(console, "picture.noise")
        changed = bool(settings.sensor_changes or settings.camera or not settings.noise)
        w.button(console, "sensor.reset", width=w.width, enabled=changed)
        w.tip("Changes are seen at once; data sets of this flight take the camera, boards take neither.")
        for term in terms_of(sensor):
            self._term(console, term)

    def _term(self, console: Console, term: SensorTerm) -> None:
        w, name, text, value = self._w, term.name, term.text, term.value
        is_changed = name in console.options.settings.sensor_changes
        about = f"{text}: {term.effect}\nsensor.set {name} VALUE"
        w.field(text, about, 0.45, style.WARN if is_changed else style.INK)
        w.entry(name, f"{value:.5g}", lambda new: console.attempt("sensor.set", name, new), about)

    def _draw_histogram(self, console: Console) -> None:
        w, implot, picture = self._w, self._w.implot, console.feed.newest
        if picture is None:
            w.text("no picture yet", style.QUIET)
            return
        bits = picture.frame.scene.sensor.bits
        if picture is not self._counted or self._histogram is None:
            self._counted, self._histogram = picture, histogram_of(picture.frame.image, bits)
        h = self._histogram
        with w.plot("histogram", 110, NOTES["histogram"], ("level [DN]", "log pixels")) as is_open:
            if is_open:
                top = max(float(np.log10(1 + h.counts).max()), 1.0)
                implot.setup_axes_limits(0, BINS * h.width_dn, 0, 1.05 * top, w.imgui.Cond_.always)
                levels = (np.arange(BINS) + 0.5) * h.width_dn
                for k, counts in enumerate(h.counts):
                    line = w.curve(style.AXIS_COLORS[k] if len(h.counts) == 3 else style.ACCENT)
                    implot.plot_line(f"band {k}", levels, np.log10(1.0 + counts), line)
        text = f"levels {h.least_dn} to {h.most_dn} of {2**bits - 1}, median {h.median_dn:.0f}, "
        text += f"saturated {100 * h.saturated:.2f} % (pixels on a log scale)"
        w.text(text, style.WARN if h.saturated > 0.01 else style.QUIET, NOTES["levels"])
