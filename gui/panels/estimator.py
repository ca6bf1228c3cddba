"""Panel of the estimator: choice of method, its answer for the newest picture, its stages, and errors over time."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.gui import style
from flyaround.gui.jobs.estimator_process import known_methods, method_title, stage_text
from flyaround.gui.picture.decline_cause import decline_cause
from flyaround.gui.texts import texts
from flyaround.gui.views.estimate_overlay import OLD_S
from flyaround.gui.views.stage import stage_pictures
from flyaround.gui.widgets import Panel
from flyaround.hil.board.method_names import NETWORK
from flyaround.simulator.piloting.readouts import mission_time

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.jobs.estimates import ComparedEstimate, Estimates
    from flyaround.gui.jobs.estimator_process import Answer
    from flyaround.gui.picture.feed import Picture

PLOT_HEIGHT = 92.0
LEAST_DEG, LEAST_M = 1e-3, 1e-4
"""Least error on the logarithmic scale; smaller ones are drawn on its edge."""
THUMB = 150.0  # least width of a small picture


@lru_cache(maxsize=2)
def _cause_in(picture: Picture) -> str:
    return decline_cause(picture.frame, picture.target)


class EstimatorPanel(Panel):
    """Controls of an estimator beside the flight, and its answers."""

    name, title, place, shown = "estimator", "Estimator", "left", False

    _network = ""

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, estimates = self._w, console.jobs.estimates
        label = "Stop estimating" if estimates.on else "Estimate"
        fill = None if estimates.on else style.PRIMARY
        w.button(console, "estimator.run", label=label, width=w.width, on=estimates.on, fill=fill)
        self._choose(console)
        w.switch(console, "estimator.stages")
        w.button(console, "estimator.forget")
        # below the controls, which must not move when a result comes
        colour = style.GOOD if estimates.on else style.BAD if estimates.refusal else style.QUIET
        w.text(estimates.doing, colour, "current step, and estimates per second")
        newest, picture = estimates.newest, console.feed.newest
        fresh = newest is not None and newest.answer.accepted and console.session.t_s - newest.t_s < OLD_S
        if picture is not None and not fresh and (cause := _cause_in(picture)):
            w.text(cause, style.WARN, "why the newest picture gives no estimate, and what to do")
        if newest is None:
            w.text(texts("view-tips")["estimator"], style.QUIET)
        else:
            self._figures(newest, console.session.t_s)
        # before the plots, so that they are in sight below the pose
        if newest is not None and newest.answer.stages:
            w.section("Stages")
            self._stages(console, newest.answer)
        elif estimates.with_stages:
            w.text("stages: with the next estimate", style.QUIET)
        w.section("Over the flight")
        self._plots(estimates)

    def _choose(self, console: Console) -> None:
        w, imgui, estimates = self._w, self._w.imgui, console.jobs.estimates
        for k, method in enumerate(known_methods()):
            w.flow(w.button_width(method), first=k == 0)
            w.button(console, "estimator.method", method, label=method, on=method == estimates.method)
        imgui.set_next_item_width(max(w.width - w.button_width("Network") - 8, 60))
        _, self._network = imgui.input_text_with_hint("##network", "file of a network", self._network)
        w.tip("file that flyaround train has written, as method")
        w.flow(w.button_width("Network"), first=False)
        network = f"{NETWORK}{self._network.removeprefix(NETWORK)}"
        on = estimates.method == network
        w.button(console, "estimator.method", network, label="Network", on=on, enabled=network != NETWORK)

    def _figures(self, e: ComparedEstimate, t_s: float) -> None:
        w, answer = self._w, e.answer
        w.section(f"{method_title(e.method)} at {mission_time(e.t_s)}")
        w.tip("method, and mid-exposure time of its picture since the start")
        said, colour = ("accepted", style.GOOD) if answer.accepted else ("declined", style.WARN)
        said = f"{said}, {abs(t_s - e.t_s):.1f} s ago{answer.reason and ': '}{answer.reason}"
        w.text(said, colour, "whether the estimator accepts its best pose; simulated time since its picture")
        if (position := answer.t_camera_from_target_m) is not None:
            w.row("Position, camera [m]", position, "{:+z.3f}", "of the target: right, down, ahead")
        if (attitude := answer.q_camera_from_target_wxyz) is not None:
            tip = "quaternion w x y z that turns target axes into camera axes"
            # four in a line are wider than the panel
            w.row("Attitude w, x", attitude[:2], "{:+z.4f}", tip)
            w.row("Attitude y, z", attitude[2:], "{:+z.4f}", tip)
        else:
            w.text("no pose", style.QUIET)
        if "too small" in answer.reason:
            w.text("Full detail in Picture gives it every pixel; or fly nearer.", style.QUIET)
        w.row("Confidence", (answer.confidence,), "{:.3f}", "0 to 1; hybrid accepts from 0.9 on")
        if e.E_R_deg is not None and e.E_T_m is not None:
            w.row("Attitude error", (e.E_R_deg,), "{:.3f}°", "error of the attitude against the truth [°]")
            w.row("Position error", (1e3 * e.E_T_m,), "{:.1f} mm", "error of the position against the truth")
            share = 100 * e.E_T_m / max(e.range_m, 1e-9)
            w.row("Position error / range", (share,), "{:.2f} %", "position error over the range")
        slowest = sorted(answer.stages_ms.items(), key=lambda item: -item[1])[:3]
        stages = ", ".join(f"{stage_text(name)[0].lower()} {ms:.0f} ms" for name, ms in slowest)
        w.row("Took", (e.took_ms,), "{:.0f} ms", f"all stages but the preparation; longest: {stages}")
        tip = "size in pixels of the picture that the estimator received"
        w.row("Picture", ("{} x {}".format(*e.size_px),), "{} px", tip)
        if answer.network:
            tip = "own: trained for this craft by flyaround train; shipped: comes with Flyaround; none: edges only"
            colour = style.GOOD if answer.network == "own" else style.QUIET
            w.text(f"keypoint network: {answer.network}", colour, tip)

    # --- plots

    def _plots(self, estimates: Estimates) -> None:
        if not (rows := list(estimates.history)):
            self._w.text("no estimate yet", style.QUIET)
            return
        t = np.array([e.t_s for e in rows])
        good = np.array([e.answer.accepted for e in rows])
        turn = np.array([np.nan if e.E_R_deg is None else max(e.E_R_deg, LEAST_DEG) for e in rows])
        shift = np.array([np.nan if e.E_T_m is None else max(e.E_T_m, LEAST_M) for e in rows])
        sure = np.array([e.answer.confidence for e in rows])
        self._plot("attitude error [°]", t, turn, good, log=True)
        self._plot("position error [m]", t, shift, good, log=True)
        self._plot("confidence", t, sure, good, log=False)
        self._w.text("dots: accepted; rings: declined", style.QUIET)

    def _plot(self, name: str, t: Any, values: Any, good: Any, *, log: bool) -> None:  # noqa: ANN401 - arrays
        w, implot = self._w, self._w.implot
        w.text(name)
        tip = f"{name} over the flight; dots: accepted, rings: declined"
        with w.plot(name, PLOT_HEIGHT, tip, span_s=(t[0], t[-1])) as in_sight:
            if not in_sight:
                return
            always = w.imgui.Cond_.always
            low, high = float(t[0]), float(t[-1])
            # a little wider than the data, so that dots at the ends are whole
            margin = 0.04 * max(high - low, 1.0)
            implot.setup_axis_limits(implot.ImAxis_.x1, low - margin, high + margin, always)
            finite = values[np.isfinite(values)]
            least, most = (float(finite.min()), float(finite.max())) if len(finite) else (0.1, 1.0)
            if log:
                implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
            # whole decades, which are labelled
            decades = 10.0 ** np.floor(np.log10([least, 10 * most])) if log else (-0.1, 1.1)
            implot.setup_axis_limits(implot.ImAxis_.y1, *decades, always)
            for colour, filled, which in ((style.ESTIMATE, 1.0, good), (style.WARN, 0.0, ~good)):
                spec = implot.Spec()
                spec.marker, spec.marker_size = implot.Marker_.circle, 2.6 * w.window.scale
                spec.marker_line_color = w.imgui.ImVec4(*colour)
                spec.marker_fill_color = w.imgui.ImVec4(*colour[:3], filled)
                if which.any():
                    dots = (np.ascontiguousarray(a[which]) for a in (t, values))
                    implot.plot_scatter(f"{name} {filled}", *dots, spec)

    def _stages(self, console: Console, answer: Answer) -> None:
        w, imgui, pictures = self._w, self._w.imgui, stage_pictures(answer)
        for (name, picture), width in zip(pictures.items(), w.grid(len(pictures), THUMB, 2), strict=True):
            with w.ctx.begin_group():
                texture = w.window.show_picture(f"stage/{name}", picture, picture)
                imgui.image(texture, w.vec(width, width * picture.shape[0] / picture.shape[1]))
                if imgui.is_item_clicked():
                    console.do("estimator.stage", name)
                title, tip = stage_text(name)
                w.tip(f"{title}: {tip}")
                large = name == console.jobs.estimates.stage and console.shown.get("stage", False)
                with w.ctx.push_text_wrap_pos(imgui.get_cursor_pos_x() + width):
                    w.one_line(title, style.ACCENT if large else style.QUIET)
        w.text("A click shows one large, in the place of the view.", style.QUIET)
