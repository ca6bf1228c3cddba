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
    from collections.abc import Callable, Sequence

    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.planned_burns import PlannedBurn

MODES = "hold vbar rbar glideslope flyaround circumnavigate safe-ellipse keep-range drift"
GUIDANCE = tuple(f"guidance.{mode}" for mode in MODES.split())
FIRST_AFTER_S, FIRST_M_S = 60.0, 0.01
"""Defaults of an added burn: time after the last one, and its along-track delta-v."""
PLUME = "whether the exhaust, 30 deg wide to each side, meets the target's sphere within 20 m"


class SteeringPanel(Panel):
    """Axes, pulses and attitude of keys and sticks; guidance; planned burns; propellant."""

    name, title, place, shown = "steering", "Steering", "left", False

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._point = [0.0, 0.0, 0.0]
        self._key: tuple[BurnPlan, int] | None = None
        self._nearest_m = np.inf

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, steering = self._w, console.session.craft.steering
        w.switches(console, ("steer.lvlh", "steer.pulses"))
        w.section("Attitude")
        for k, mode in enumerate(ATTITUDE_MODES):
            w.flow(w.button_width(mode.capitalize()), first=k == 0)
            w.button(console, "steer.attitude", mode, label=mode.capitalize(), on=steering.attitude == mode)
        w.section("Guidance")
        colour = style.ACCENT if steering.doing else style.QUIET
        w.text(console.flown_by, colour, "what flies the chaser while nothing is pressed")
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
        tip = "change of velocity that the thrusters gave since the start, all pushes added up"
        w.row("Delta-v", (spent.delta_v_m_s,), "{:.3f} m/s", tip)
        tip = f"burnt since the start, at a specific impulse of {spent.thrusters.specific_impulse_s:g} s"
        w.row("Propellant", (spent.used_kg,), "{:.3f} kg", tip)
        tip = "of the chaser, as the scenario gives it; 100 kg unless it does"
        w.row("Mass", (spent.mass_kg,), "{:.2f} kg", tip)
        if steering.plume:
            w.text("# the plume strikes the target", style.OUTSIDE, PLUME)
        else:
            w.text("plume clear of the target", style.QUIET, PLUME)

    def _to_a_point(self, console: Console) -> None:
        """Draw three numbers that can be used as a position or as a displacement."""
        w, imgui = self._w, self._w.imgui
        w.section("Fly to: radial, along, cross")
        imgui.set_next_item_width(w.width)
        self._point = imgui.input_float3("##point", self._point, "%.2f m")[1]
        w.tip("radial, along-track and cross-track in the target's LVLH frame [m]")
        here = console.session.craft.state_lvlh()[0]
        place = tuple(float(v) for v in self._point)
        by = tuple(round(float(h) + v, 3) for h, v in zip(here, place, strict=True))
        half = (w.width - imgui.get_style().item_spacing.x) / 2
        fly = "guidance.waypoint"
        w.button(console, fly, *place, label="Fly there", width=half)
        imgui.same_line()
        w.button(console, fly, *by, label="Fly by so much", width=half, icon="by", fill=style.RAISED)

    def _burns(self, console: Console) -> None:
        """Draw a table of the planned burns, whose numbers can be edited, and a button for a new one."""
        w, session = self._w, console.session
        w.section("Planned burns [m/s]")
        burns = session.craft.steering.burns.burns
        at_s = max([session.t_s, *(b.end_s for b in burns)]) + FIRST_AFTER_S
        first = (round(at_s, 1), 0.0, FIRST_M_S, 0.0)
        # above the table, whose growth must not move it
        w.button(console, "burn.plan", *first, label="Add a burn", width=w.width)
        rows = [self._burn_cells(console, k, burn) for k, burn in enumerate(burns)]
        w.table("burns", (0.27, 0.63, 0.1), rows, ("T+ [s]", "radial, along, cross", ""))
        if burns:
            self._forecast(console)
            w.button(console, "burn.cancel", width=w.width)

    def _burn_cells(self, console: Console, k: int, burn: PlannedBurn) -> tuple[Callable[[], None], ...]:
        """Return the functions that draw time, components and the delete button of a burn; Enter applies an edit."""
        w, imgui = self._w, self._w.imgui
        entered = imgui.InputTextFlags_.enter_returns_true

        def replan(t_s: float, parts: Sequence[float]) -> None:
            console.do("burn.plan", t_s, *(round(float(v), 6) for v in parts), burn.t_s)

        def time() -> None:
            imgui.set_next_item_width(-1)
            changed, t_s = imgui.input_double(f"##t{k}", burn.t_s, 0.0, 0.0, "%.1f", entered)
            w.tip("middle of the burn since the scenario's start [s]; Enter takes it")
            if changed:
                replan(t_s, burn.delta_v_lvlh_m_s)

        def delta_v() -> None:
            imgui.set_next_item_width(-1)
            parts = [float(v) for v in burn.delta_v_lvlh_m_s]
            changed, parts = imgui.input_float3(f"##v{k}", parts, "%.4g", entered)
            w.tip("change of velocity: radial, along-track, cross-track [m/s]; Enter takes it")
            if changed:
                replan(burn.t_s, parts)

        def cross() -> None:
            if imgui.small_button(f"x##burn{k}"):
                console.do("burn.cancel", burn.t_s)
            w.command_tip(console, "burn.cancel", burn.t_s)

        return time, delta_v, cross

    def _forecast(self, console: Console) -> None:
        """Draw the delta-v of all burns, and the closest approach of their path to the target."""
        craft = console.session.craft
        key = (craft.steering.burns, int(console.session.t_s))
        if key != self._key:
            ahead = BurnPlan(tuple(b for b in craft.steering.burns.burns if b.start_s >= console.session.t_s))
            path = craft.predicted_burns(ahead).points_lvlh_m if ahead.burns else np.zeros((0, 3))
            self._key, self._nearest_m = key, np.linalg.norm(path, axis=1).min(initial=np.inf)
        total = sum(b.size_m_s for b in craft.steering.burns.burns)
        self._w.row("Delta-v", (total,), "{:.3f} m/s", "of all planned burns together")
        if np.isfinite(self._nearest_m):
            tip = "nearest that the path through the burns comes to the target's centre of mass"
            self._w.row("Closest", (self._nearest_m,), "{:.2f} m", tip)
