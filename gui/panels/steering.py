"""Steering: axes, pulses, attitude, guidance modes at a click, what it has cost, planned burns, jumps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.chaser_control import ATTITUDE_MODES
from flyaround.simulator.piloting.jumps import EVENTS
from flyaround.simulator.piloting.planned_burns import BurnPlan

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.planned_burns import PlannedBurn

GUIDANCE = (
    "guidance.hold",
    "guidance.vbar",
    "guidance.rbar",
    "guidance.glideslope",
    "guidance.flyaround",
    "guidance.circumnavigate",
    "guidance.safe-ellipse",
    "guidance.keep-range",
    "guidance.drift",
)
FIRST_AFTER_S, FIRST_M_S = 60.0, 0.01
"""A burn that is added: how long after the last one, and its change of velocity along the flight."""
PLUME = "whether the exhaust, 30 deg wide to each side, meets the target's sphere within 20 m"


class SteeringPanel(Panel):
    """How keys and sticks act, what else may fly the chaser, and its propellant."""

    name, title, place, shown = "steering", "Steering", "left", False

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._point = [0.0, 0.0, 0.0]
        self._of: tuple[BurnPlan, int] | None = None
        self._nearest_m = np.inf

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, steering = self._w, console.session.craft.steering
        w.switches(console, ("steer.lvlh", "steer.pulses"))
        w.section("Attitude")
        for k, mode in enumerate(ATTITUDE_MODES):
            width = w.imgui.calc_text_size(mode).x + 2 * w.imgui.get_style().frame_padding.x
            w.flow(width, first=k == 0)
            w.button(console, "steer.attitude", mode, label=mode, on=steering.attitude == mode)
        w.section("Guidance")
        colour = style.ACCENT if steering.doing else style.QUIET
        w.text(steering.doing or "by hand", colour, "what flies the chaser while nothing is pressed")
        if steering.guided is not None:
            w.text(steering.guided.phase(console.session.t_s), style.QUIET, "what the guidance is at")
        w.buttons(console, GUIDANCE, 2)
        self._to_a_point(console)
        self._burns(console)
        self._cost(console)
        w.section("Jump")
        w.buttons(console, [f"time.next-{event}" for event in EVENTS], 1)

    def _cost(self, console: Console) -> None:
        w, steering = self._w, console.session.craft.steering
        spent = steering.propellant
        w.section("Spent by steering")
        w.row(
            "Delta-v",
            (spent.delta_v_m_s,),
            "{:.3f} m/s",
            "change of velocity that the thrusters gave since the start, all pushes added up",
        )
        isp = spent.thrusters.specific_impulse_s
        w.row(
            "Propellant",
            (spent.used_kg,),
            "{:.3f} kg",
            f"burnt since the start, at a specific impulse of {isp:g} s",
        )
        w.row(
            "Mass",
            (spent.mass_kg,),
            "{:.2f} kg",
            "of the chaser, as the scenario gives it; 100 kg unless it does",
        )
        if steering.plume:
            w.text("# the plume strikes the target", style.OUTSIDE, PLUME)
        else:
            w.text("plume clear of the target", style.QUIET, PLUME)

    def _to_a_point(self, console: Console) -> None:
        """Three numbers and two ways to read them: a place, or a way from here."""
        w, imgui = self._w, self._w.imgui
        w.section("Fly to a point")
        imgui.set_next_item_width(w.width)
        self._point = imgui.input_float3("##point", self._point, "%.2f m")[1]
        w.tip("radial, along-track and cross-track in the target's LVLH frame [m]")
        half = (w.width - imgui.get_style().item_spacing.x) / 2
        here = console.session.craft.state_lvlh()[0]
        place = tuple(float(v) for v in self._point)
        by = tuple(round(float(h) + v, 3) for h, v in zip(here, place, strict=True))
        for k, (label, point) in enumerate((("Fly there", place), ("Fly by so much", by))):
            if k:
                imgui.same_line()
            if imgui.button(label, w.vec(half, 0)):
                console.do("guidance.waypoint", *point)
            w.about(console, "guidance.waypoint", *point)

    def _burns(self, console: Console) -> None:
        """A row for each planned burn, whose numbers can be typed, and one for a new one."""
        w, imgui, session = self._w, self._w.imgui, console.session
        w.section("Planned burns")
        burns = session.craft.steering.burns.burns
        flags = imgui.TableFlags_.sizing_stretch_prop
        if imgui.begin_table("burns", 3, flags):
            for title in ("T+ [s]", "radial, along, cross [m/s]", ""):
                imgui.table_setup_column(title)
            imgui.table_headers_row()
            for k, burn in enumerate(burns):
                self._burn_row(console, k, burn)
            imgui.end_table()
        if imgui.button("Add a burn", w.vec(w.width, 0)):
            at_s = max([session.t_s, *(b.end_s for b in burns)]) + FIRST_AFTER_S
            console.do("burn.plan", round(at_s, 1), 0.0, FIRST_M_S, 0.0)
        w.about(console, "burn.plan")
        if burns:
            self._forecast(console)
            w.button(console, "burn.cancel", width=w.width)

    def _burn_row(self, console: Console, k: int, burn: PlannedBurn) -> None:
        w, imgui = self._w, self._w.imgui
        entered = imgui.InputTextFlags_.enter_returns_true
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.set_next_item_width(-1)
        changed, t_s = imgui.input_double(f"##t{k}", burn.t_s, 0.0, 0.0, "%.1f", entered)
        w.tip("middle of the burn since the scenario's start [s]; Enter takes it")
        imgui.table_next_column()
        imgui.set_next_item_width(-1)
        parts = [float(v) for v in burn.delta_v_lvlh_m_s]
        other, parts = imgui.input_float3(f"##v{k}", parts, "%.4g", entered)
        w.tip("change of velocity: radial, along-track, cross-track [m/s]; Enter takes it")
        imgui.table_next_column()
        gone = imgui.small_button(f"x##burn{k}")
        w.about(console, "burn.cancel", burn.t_s)
        if gone or changed or other:
            console.do("burn.cancel", burn.t_s)
        if changed or other:
            console.do("burn.plan", t_s, *(round(float(v), 6) for v in parts))

    def _forecast(self, console: Console) -> None:
        """Delta-v of all burns, and how near their path comes to the target."""
        craft = console.session.craft
        key = (craft.steering.burns, int(console.session.t_s))
        if key != self._of:
            ahead = BurnPlan(tuple(b for b in craft.steering.burns.burns if b.start_s >= console.session.t_s))
            path = craft.predicted_burns(ahead).points_lvlh_m if ahead.burns else np.zeros((0, 3))
            self._of, self._nearest_m = key, np.linalg.norm(path, axis=1).min(initial=np.inf)
        total = sum(b.size_m_s for b in craft.steering.burns.burns)
        self._w.row("Delta-v", (total,), "{:.3f} m/s", "of all planned burns together")
        if np.isfinite(self._nearest_m):
            tip = "nearest that the path through the burns comes to the target's centre of mass"
            self._w.row("Closest", (self._nearest_m,), "{:.2f} m", tip)
