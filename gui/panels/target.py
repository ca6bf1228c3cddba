"""The target with its materials, and the lights on it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.commands.camera import MOST_GAIN
from flyaround.gui.widgets import Panel
from flyaround.simulator.targets.library import list_targets

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface


class TargetPanel(Panel):
    """The craft, its materials, and the lights on it."""

    name, title, place, shown = "target", "Target", "right-low", True

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._names: tuple[str, ...] = ()

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui, target = self._w, self._w.imgui, console.session.plan.target
        if not self._names:
            self._names = list_targets()
        names = self._names if target.name in self._names else (target.name, *self._names)
        w.choice(console, "scenario.target", target.name, names)
        triangles = sum(len(part.triangles) for part in target.parts)
        w.text(
            f"{len(target.parts)} parts, {triangles:,} triangles, {len(target.keypoints)} keypoints",
            style.QUIET,
            "of the target's model: meshes, faces, and the points that labels name",
        )
        w.section("Lights")
        self._lights(console)
        w.section("Materials")
        for m in target.materials:
            at = imgui.get_cursor_screen_pos()
            side = imgui.get_font_size()
            colour = (*(max(c, 0.0) ** (1 / 2.2) for c in m.base_color), 1.0)
            imgui.get_window_draw_list().add_rect_filled(at, w.vec(at.x + side, at.y + side), w.color(colour))
            imgui.dummy(w.vec(side, side))
            imgui.same_line()
            coat = f", coat {m.clearcoat:.2g}" if m.clearcoat else ""
            w.text(
                f"{m.name}: metal {m.metallic:.2g}, rough {m.roughness:.2g}{coat}",
                tip="material: metal from 0 (none) to 1, roughness from 0 (a mirror) to 1 (matt), clear coat 0 to 1",
            )

    def _lights(self, console: Console) -> None:
        w, imgui, scene = self._w, self._w.imgui, console.session.scene()
        w.text(
            f"Sun {100 * scene.sun_visible_fraction:.0f} % of its disc",
            tip="what the target sees of the Sun past the Earth and the Moon",
        )
        if scene.lamp is not None:
            w.text("a lamp on the chaser")
        gains = console.options.settings.light_gains
        for k, light in enumerate(scene.area_lights):
            size = f"{light.width_m:g} x {light.height_m:g} m"
            w.text(
                f"{k}: {size}, {light.radiance_w_m2_sr:.3g} W/m2 sr, in {light.frame} axes",
                tip="area light: number, size, radiance, and the axes in which it stays",
            )
            imgui.set_next_item_width(-1)
            gain = gains.get(k, 1.0)
            logarithmic = imgui.SliderFlags_.logarithmic
            changed, value = imgui.slider_float(f"##light{k}", gain, 0.0, MOST_GAIN, "x %.2f", logarithmic)
            w.command_tip(console, "light.gain", argument="gain")
            if changed:
                console.do("light.gain", k, round(min(max(value, 0.0), MOST_GAIN), 3))
