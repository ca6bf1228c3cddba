"""The target with its materials."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.texts import NOTES
from flyaround.gui.widgets import Panel
from flyaround.simulator.targets.library import list_targets

if TYPE_CHECKING:
    from flyaround.gui.console import Console


class TargetPanel(Panel):
    """Choice of the craft, which starts a new flight, and its materials."""

    name, title, place, shown = "target", "Target", "right-low", True

    _names: tuple[str, ...] = ()

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui, target = self._w, self._w.imgui, console.session.plan.target
        if not self._names:
            self._names = list_targets()
        names = self._names if target.name in self._names else (target.name, *self._names)
        w.choice(console, "scenario.target", target.name, names)
        triangles = sum(len(part.triangles) for part in target.parts)
        text = f"{len(target.parts)} parts, {triangles:,} triangles, {len(target.keypoints)} keypoints"
        w.text(text, style.QUIET, NOTES["model"])
        w.section("Materials")
        for m in target.materials:
            at = imgui.get_cursor_screen_pos()
            side = imgui.get_font_size()
            colour = (*(max(c, 0.0) ** (1 / 2.2) for c in m.base_color), 1.0)
            imgui.get_window_draw_list().add_rect_filled(at, w.vec(at.x + side, at.y + side), w.color(colour))
            imgui.dummy(w.vec(side, side))
            imgui.same_line()
            coat = f", coat {m.clearcoat:.2g}" if m.clearcoat else ""
            w.text(f"{m.name}: metal {m.metallic:.2g}, rough {m.roughness:.2g}{coat}", tip=NOTES["material"])
