"""Steering: axes, pulses, attitude, guidance modes at a click, what it has cost, planned burns, jumps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.widgets import Panel
from flyaround.simulator.piloting.chaser_control import ATTITUDE_MODES
from flyaround.simulator.piloting.jumps import EVENTS

if TYPE_CHECKING:
    from flyaround.gui.console import Console

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
PLUME = "whether the exhaust, 30 deg wide to each side, meets the target's sphere within 20 m"


class SteeringPanel(Panel):
    """How keys and sticks act, what else may fly the chaser, and its propellant."""

    name, title, place, shown = "steering", "Steering", "left", False

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
        self._cost(console)
        self._burns(console)
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

    def _burns(self, console: Console) -> None:
        w, steering = self._w, console.session.craft.steering
        w.section("Planned burns")
        if not steering.burns.burns:
            w.text("none; burn.plan T RADIAL ALONG CROSS in Do ... (Ctrl+P) plans one", style.QUIET)
            return
        for burn in steering.burns.burns:
            left = burn.t_s - console.session.t_s
            parts = " ".join(f"{v:+.3f}" for v in burn.delta_v_lvlh_m_s)
            w.text(
                f"T+{burn.t_s:.0f} s, in {left:.0f} s: {parts} m/s",
                tip="middle of the burn since the start; change of velocity radial, along-track, cross-track",
            )
        w.button(console, "burn.cancel", width=w.width)
