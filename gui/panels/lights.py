"""Panel of the lights on the target: the Sun's share, the lamp on the chaser, and luminous boxes."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from flyaround.gui import style
from flyaround.gui.picture.light_settings import NEW_LIGHTS, SwitchedLight, lights_of
from flyaround.gui.picture.screen import DARK
from flyaround.gui.picture.view_settings import apply_view_settings
from flyaround.gui.texts import NOTES, texts
from flyaround.gui.widgets import Panel
from flyaround.simulator.imaging.metering import light_signal
from flyaround.simulator.scene.illumination.lamp import Profile

if TYPE_CHECKING:
    from flyaround.gui.console import Console

PLACES = frozenset({"offset_m", "position_m", "direction"})
AXES = {"camera": "right, down, ahead", "target": "x, y, z"}
"""Axes of each frame of a light."""
CHOICES = {"frame": tuple(AXES), "profile": get_args(Profile)}
FIELDS = texts("lights")
"""Name and hover text of each field of a light."""


class LightsPanel(Panel):
    """Controls that switch, move, brighten, add and remove lamps and boxes."""

    name, title, place, shown = "lights", "Lights", "left", False

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, settings = self._w, console.options.settings
        scene, lights = apply_view_settings(console.session.scene(), settings), settings.lights
        w.text(f"Sun: {100 * scene.sun_visible_fraction:.0f} % of its disc", tip=NOTES["sun"])
        for k, switched in enumerate(lights_of(scene) if lights is None else lights):
            self._light(console, k, switched)
            faint = (share := light_signal(scene, switched.light)) < DARK
            text = f"white at the target: {100 * share:.1f} % of full scale{', too faint to see' * faint}"
            w.lines(text, style.WARN if faint and switched.on else style.QUIET, NOTES["light"])
        w.imgui.separator()
        for kind, width in zip(NEW_LIGHTS, w.grid(2, 100), strict=True):
            w.button(console, "light.add", kind, label=f"Add a {kind}", width=width)
        if lights is not None:
            w.section("Changed here")
            w.text("Seen at once, and in data sets of this flight. Boards need a new flight.")
            w.buttons(console, ("light.fly", "light.reset"), 1)

    def _light(self, console: Console, k: int, switched: SwitchedLight) -> None:
        w, imgui = self._w, self._w.imgui
        with w.ctx.push_id(k):
            w.section(switched.title)
            changed, on = imgui.checkbox("On", switched.on)
            w.command_tip(console, "light.switch", k)
            imgui.same_line(imgui.get_cursor_pos_x() + w.width - w.button_width("Remove"))
            removed = imgui.button("Remove")
            w.command_tip(console, "light.remove", k)
            imgui.begin_disabled(not switched.on)
            frame = getattr(switched.light, "frame", "camera")
            for name in switched.light.__struct_fields__:
                self._field(console, k, name, getattr(switched.light, name), frame)
            imgui.end_disabled()
        if changed:
            console.do("light.switch", k, on)
        if removed:
            console.do("light.remove", k)

    def _field(self, console: Console, k: int, name: str, value: Any, frame: str) -> None:  # noqa: ANN401 - of a typed file
        w, imgui = self._w, self._w.imgui
        text, about = FIELDS[name]
        tip = f"{text}: {about}\nlight.set {k} {name} VALUE"
        if name in CHOICES:
            names = CHOICES[name]
            w.field(text, tip, 0.45)
            changed, at = imgui.combo(f"##{name}", names.index(value), list(names))
            w.tip(tip)
            if changed:
                console.do("light.set", k, name, names[at])
        elif name in PLACES:
            numbers = [f"{x:.6g}" for x in value or (0.0, 0.0, 0.0)]

            def place(axis: int, new: str) -> str:
                words = [*numbers[:axis], new, *numbers[axis + 1 :]]
                return console.attempt("light.set", k, name, ",".join(words))

            w.text(f"{text}, {frame}: {AXES[frame]}", tip=tip)
            for axis, width in enumerate(w.grid(3, np.inf, 3)):
                imgui.set_next_item_width(width)
                w.entry(f"{name}{axis}", numbers[axis], partial(place, axis), tip, k, numbers)
        else:
            w.field(text, tip, 0.45)
            w.entry(name, f"{value:.6g}", lambda new: console.attempt("light.set", k, name, new), tip, k)
