"""Panel of a scenario's text: edit, check, save and fly it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.scenario_draft import ScenarioDraft


MARGIN = 4.0  # added to the height of a framed line


class EditorPanel(Panel):
    """Editor of a scenario's TOML, with its errors."""

    name, title, place, shown = "editor", "Scenario text", "left", False

    _path, _marked = "mine.toml", ""

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui, draft = self._w, self._w.imgui, console.draft
        if not draft.text:
            w.text("No scenario is being edited.", style.QUIET)
            w.button(console, "scenario.edit", label="Edit the one that flies")
            return
        changed = " (changed)" if draft.changed else ""
        w.text(f"{draft.name}{changed}", style.ACCENT, "the scenario that is edited")
        if draft.replacement is not None:
            other = draft.replacement or "the scenario that flies"
            w.text(f"Discard this changed text, and edit {other}?", style.WARN)
            words = filter(None, [draft.replacement])
            w.button(console, "scenario.edit", *words, label="Discard the changes", fill=style.GUARDED)
            imgui.same_line()
            if w.filled_button("Keep it", 0, style.PRIMARY):
                draft.replacement = None
        primary = "scenario.fly" * (draft.replacement is None)
        w.buttons(console, ("scenario.check", "scenario.fly"), 2, primary)
        imgui.set_next_item_width(max(w.width - 8 * imgui.get_font_size(), 6 * imgui.get_font_size()))
        _, self._path = imgui.input_text("##path", self._path)
        w.command_tip(console, "scenario.save", argument="path")
        w.flow(6 * imgui.get_font_size(), first=False)
        w.button(console, "scenario.save", self._path, label="Save as")
        right = "no mistake was found" if draft.text == draft.right_text else "not checked yet"
        w.text(draft.problem or right, style.BAD if draft.problem else style.QUIET)
        with w.ctx.push_font(w.window.figure_font, 0.0):
            if draft.problem_line is not None:
                wrong = draft.text.splitlines()[draft.problem_line - 1 : draft.problem_line]
                w.text("".join(f"{draft.problem_line} | {text.strip()}" for text in wrong), style.WARN)
            flags = imgui.InputTextFlags_.allow_tab_input
            changed, text = imgui.input_text_multiline("##text", draft.text, w.vec(-1, -1), flags)
            self._mark(draft)
        w.tip("the scenario's file; every key with its unit in its name. Leaving the field checks it")
        # Dear ImGui's Escape takes back what was typed
        if changed and not imgui.is_key_pressed(imgui.Key.escape, False):
            draft.text, draft.changed = text, True
        if imgui.is_item_deactivated_after_edit():
            console.do("scenario.check")

    def _mark(self, draft: ScenarioDraft) -> None:
        """Frame the wrong line in the text, the last item, which scrolls to it once."""
        imgui, line, tall = self._w.imgui, draft.problem_line, self._w.imgui.get_font_size()
        # the name that Dear ImGui gives the scrolled area of a text
        name = f"{imgui.internal.get_current_window().name}/##text_{imgui.get_id('##text'):08X}"
        area = imgui.internal.find_window_by_name(name)
        if line is None or area is None:
            self._marked = ""
            return
        below = (line - 1) * tall
        if self._marked != draft.problem:
            self._marked = draft.problem
            imgui.internal.set_scroll_y(area, max(below - area.size.y / 3, 0.0))
        top = area.pos.y + imgui.get_style().frame_padding.y + below - area.scroll.y
        if area.pos.y <= top <= area.pos.y + area.size.y - tall:
            corners = area.pos.x + 1, top + 1, area.pos.x + area.size.x - 1, top + tall + MARGIN - 1
            self._w.frame(style.BAD, corners, area)
