"""Panel of the timeline: steps through the recorded flight, bookmarks with notes, and exports of the flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.icons import labelled
from flyaround.gui.usable import is_usable
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.simulator.piloting.flight_history import Timeline


BUTTONS = ["begin", "back", "step-back", "forward", "end", "fly-on", "other-future", "keep", "dataset", "hil"]


class TimelinePanel(Panel):
    """Steps and bookmarks. The slider seeks back, Space replays, steering or Ctrl+Enter flies on from there."""

    name, title, place, shown = "timeline", "Timeline", "bottom", False
    keys = ("ctrl+t",)

    _note = ""

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, session = self._w, console.session
        timeline = session.look_back.timeline
        back = session.look_back.active
        looking_back = "looking back: steering or Fly on continues the flight from here"
        w.text(*(looking_back, style.WARN) if back else ("at the end of the flight", style.QUIET))
        for k, name in enumerate(f"timeline.{button}" for button in BUTTONS):
            w.flow(w.button_width(labelled(name, console.table[name].title)), first=k == 0)
            # a disabled button stays in place
            w.button(console, name, enabled=is_usable(console, name))
        self._bookmarks(console, timeline)

    def _bookmarks(self, console: Console, timeline: Timeline) -> None:
        imgui, w = self._w.imgui, self._w
        w.section("Bookmarks")
        imgui.set_next_item_width(max(min(w.width - 110 * w.window.scale, 320 * w.window.scale), 60.0))
        enter, hint = imgui.InputTextFlags_.enter_returns_true, "a note, and Enter"
        entered, self._note = imgui.input_text_with_hint("##note", hint, self._note, enter)
        w.command_tip(console, "timeline.bookmark", argument="note")
        imgui.same_line()
        if imgui.button("Bookmark##add") or entered:
            console.do("timeline.bookmark", self._note)
            self._note = ""
        w.command_tip(console, "timeline.bookmark")
        removed_t_s = None
        for k, mark in enumerate(timeline.bookmarks):
            if imgui.small_button(f"x##{k}"):
                removed_t_s = mark.t_s
            w.command_tip(console, "timeline.unbookmark", mark.t_s)
            imgui.same_line()
            # Dear ImGui ends a label at two number signs
            title = w.elided(f"{mission_time(mark.t_s)}  {mark.note}", w.width).replace("##", "# #")
            if imgui.selectable(f"{title}##mark{k}", False)[0]:
                console.do("timeline.seek", mark.t_s)
            w.tip(f"{mark.note or 'bookmark'}: a click goes there")
        if removed_t_s is not None:
            console.do("timeline.unbookmark", removed_t_s)
