"""The timeline: steps along what was flown, bookmarks with notes, and what can be made of the flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.commands.timeline import clock
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.flight_history import Timeline


class TimelinePanel(Panel):
    """Drag the strip's slider to look back; Space plays what was flown, steering or Ctrl+Enter flies on from there."""

    name, title, place, shown = "timeline", "Timeline", "bottom", False
    keys = ("ctrl+t",)

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._note = ""

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, session = self._w, console.session
        timeline = session.look_back.timeline
        end_s = max(timeline.end_s, session.t_s)
        back = session.look_back.active
        where = f"{clock(session.t_s)} of {clock(end_s)[2:]}"
        w.text(
            f"{where}   LOOKING BACK" if back else f"{where}   at the end",
            style.WARN if back else style.INK,
            "where one is, and the end of what was flown [h:min:s since the start]",
        )
        labels = {"back": "- 10 s", "step-back": "- 0.1 s", "forward": "+ 10 s", "end": "End"}
        for k, (name, label) in enumerate(labels.items()):
            self._button(console, f"timeline.{name}", label, first=k == 0)
        if back:
            self._button(console, "timeline.fly-on", "Fly on from here")
        if timeline.left_s is not None:
            self._button(console, "timeline.other-future", "Other future")
        self._button(console, "timeline.keep", "Keep flight")
        self._button(console, "timeline.dataset", "Data set ...")
        self._button(console, "timeline.hil", "HIL run ...")
        self._bookmarks(console, timeline)

    def _button(self, console: Console, name: str, label: str, *, first: bool = False) -> None:
        w = self._w
        width = w.imgui.calc_text_size(label).x + 2 * w.imgui.get_style().frame_padding.x
        w.flow(width, first=first)
        w.button(console, name, label=label)

    def _bookmarks(self, console: Console, timeline: Timeline) -> None:
        imgui, w = self._w.imgui, self._w
        w.section("Bookmarks")
        imgui.set_next_item_width(max(min(w.width - 110 * w.window.scale, 320 * w.window.scale), 60.0))
        entered, self._note = imgui.input_text_with_hint(
            "##note", "a note, and Enter", self._note, imgui.InputTextFlags_.enter_returns_true
        )
        w.about(console, "timeline.bookmark", argument="note")
        imgui.same_line()
        if imgui.button("Bookmark##add") or entered:
            console.do("timeline.bookmark", self._note)
            self._note = ""
        w.about(console, "timeline.bookmark")
        gone = None
        for k, mark in enumerate(timeline.bookmarks):
            if imgui.small_button(f"x##{k}"):
                gone = mark.t_s
            w.about(console, "timeline.unbookmark", mark.t_s)
            imgui.same_line()
            if imgui.selectable(f"{w.elided(f'{clock(mark.t_s)}  {mark.note}', w.width)}##mark{k}", False)[0]:
                console.do("timeline.seek", mark.t_s)
            w.tip(f"{mark.note or 'bookmark'}: a click goes there")
        if gone is not None:
            console.do("timeline.unbookmark", gone)
