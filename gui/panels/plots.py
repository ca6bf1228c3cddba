"""Panel of plots over time of figures chosen here or dragged from the panel Chaser."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.gui import style
from flyaround.gui.picture.figures import FIGURES
from flyaround.gui.text_widgets import DRAGGED
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.telemetry import Telemetry

KEPT = 6000
"""Number of moments whose figures are kept: 100 s at 60 frames of the window a second, three minutes at 33."""
COLOURS = (style.ACCENT, style.WARN, style.GOOD)


class PlotsPanel(Panel):
    """One plot per watched figure, with the newest value beside its title."""

    name, title, place, shown = "plots", "Plots", "left", False

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._watched = ["Range", "Closing"]
        self._kept: deque[Telemetry] = deque(maxlen=KEPT)

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, imgui = self._w, self._w.imgui
        self._keep(console.telemetry)
        unwatched = [name for name in FIGURES if name not in self._watched]
        imgui.set_next_item_width(-1)
        if imgui.begin_combo("##add", "plot another figure ..."):
            for name in unwatched:
                if imgui.selectable(FIGURES[name].title, False)[0]:
                    self._watched.append(name)
            imgui.end_combo()
        w.tip("or drag a row of figures here from the panel Chaser")
        times = np.array([r.t_s for r in self._kept])
        for name in tuple(self._watched):
            self._plot(name, times)
        imgui.dummy(w.vec(w.width, max(float(imgui.get_content_region_avail().y), w.line)))
        self._take_dropped()

    def _keep(self, now: Telemetry) -> None:
        while self._kept and self._kept[-1].t_s >= now.t_s:
            self._kept.pop()  # a seek went back in time
        self._kept.append(now)

    def _plot(self, name: str, times: Any) -> None:  # noqa: ANN401 - an array
        w, implot, imgui = self._w, self._w.implot, self._w.imgui
        title, values_of = FIGURES[name].title, FIGURES[name].values
        values = np.array([values_of(r) for r in self._kept], float)
        values = values.reshape(len(values), -1)
        if imgui.button(f"x##{name}"):
            self._watched.remove(name)
        w.tip("remove this plot")
        imgui.same_line()
        newest = ", ".join(f"{v:.4g}" for v in values[-1])
        imgui.align_text_to_frame_padding()
        w.cut_line(f"{title}: {newest}", w.width, style.INK, f"{title}, now")
        axis = implot.AxisFlags_
        with w.plot(name, 90, f"{title} over the flight", span_s=(times[0], times[-1])) as is_open:
            if is_open:
                fitted = axis.no_highlight | axis.auto_fit
                implot.setup_axes("", "", fitted | axis.no_tick_labels, fitted)
                # more labels would lie over each other
                ends = sorted({float(values.min()), float(values.max())})
                implot.setup_axis_ticks(implot.ImAxis_.y1, ends, [f"{end:.4g}" for end in ends])
                for k, column in enumerate(values.T):
                    line = w.curve(COLOURS[k % len(COLOURS)])
                    implot.plot_line(f"{name} {k}", times, np.ascontiguousarray(column), line)
        self._take_dropped()

    def _take_dropped(self) -> None:
        """Watch the figure that was dropped on the last item."""
        imgui = self._w.imgui
        if not imgui.begin_drag_drop_target():
            return
        payload = imgui.accept_drag_drop_payload_py_id(DRAGGED)
        if payload is not None and (name := list(FIGURES)[payload.data_id]) not in self._watched:
            self._watched.append(name)
        imgui.end_drag_drop_target()
