"""Panel of steering: axes, pulses, attitude, guidance modes, propellant used, planned burns and jumps."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.gui import style
from flyaround.gui.picture.figures import flown_colour
from flyaround.gui.texts import NOTES
from flyaround.gui.widgets import Panel
from flyaround.simulator.errors import UserError
from flyaround.simulator.piloting.chaser_control import ATTITUDE_MODES
from flyaround.simulator.piloting.guidance_orders import FlyTo
from flyaround.simulator.piloting.jumps import EVENTS
from flyaround.simulator.piloting.readouts import mission_time, speed_text
from flyaround.simulator.runtime.arrays import vec3

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.gui.surface import Surface
    from flyaround.simulator.piloting.piloted_craft import PilotedCraft
    from flyaround.simulator.piloting.planned_burns import PlannedBurn
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.runtime.arrays import FloatArray

MODES = "hold vbar rbar glideslope flyaround circumnavigate safe-ellipse keep-range drift"
GUIDANCE = tuple(f"guidance.{mode}" for mode in MODES.split())
FIRST_AFTER_S, FIRST_M_S = 60.0, 0.01
"""Defaults of an added burn: time after the last one, and its along-track delta-v."""
AXES = ("radial", "along", "cross")
LEAST_WAY_M = 0.05  # a nearer point is where the chaser is
HERE = "here: dim numbers follow the chaser"


def fly_to_warning(craft: PilotedCraft, place: FloatArray) -> tuple[str, style.Rgba]:
    """Return the warning against a straight flight to a point, or else its length, and the text's colour."""
    here = craft.state_lvlh()[0]
    try:
        FlyTo(vec3(place)).mode((here, here), craft.docking.radius_m)
    except UserError as error:
        return f"refused: {error}", style.BAD
    if risk := craft.risk_of(np.array([here, place])):
        return risk, style.WARN
    away_m = float(np.linalg.norm(place - here))
    return HERE if away_m < LEAST_WAY_M else f"{away_m:.2f} m from here", style.QUIET


class SteeringPanel(Panel):
    """Axes, pulses and attitude of keys and sticks; guidance; planned burns; propellant."""

    name, title, place, shown = "steering", "Steering", "left", False

    def __init__(self, window: Surface) -> None:
        super().__init__(window)
        self._point, self._from_here = [""] * 3, False
        self._flight: FlightSession | None = None

    def draw(self, console: Console) -> None:
        """Draw into the current panel."""
        w, steering = self._w, console.session.craft.steering
        w.switches(console, ("steer.lvlh", "steer.pulses"))
        w.section("Attitude")
        for k, mode in enumerate(ATTITUDE_MODES):
            label = "Track target" if mode == "target" else mode.capitalize()
            w.flow(w.button_width(label), first=k == 0)
            w.button(console, "steer.attitude", mode, label=label, on=steering.attitude == mode)
        w.section("Guidance")
        colour = flown_colour(console.session, style.QUIET)
        phase = "" if steering.guided is None else f": {steering.guided.phase(console.session.t_s)}"
        # one line, because buttons stand below it
        w.cut_line(console.flown_by + phase, w.width, colour, NOTES["flown-by"])
        w.buttons(console, GUIDANCE, 2)
        self._to_a_point(console)
        self._burns(console)
        self._cost(console)
        w.section("Jump")
        w.buttons(console, [f"time.next-{event}" for event in EVENTS], 1)

    def _cost(self, console: Console) -> None:
        w, craft = self._w, console.session.craft
        steering, spent = craft.steering, craft.steering.propellant
        w.section("Spent by steering")
        w.row("Delta-v", (speed_text(spent.delta_v_m_s),), "{}", NOTES["delta-v"])
        way = np.array(console.telemetry.position_lvlh_m) - steering.taken_over_lvlh_m
        moved = ["the guidance flies"] if craft.mode == "guidance" else [f"{m:+z.2f}" for m in way]
        tip = "way since hand or autopilot took over from the scenario's guidance: radial, along, cross"
        w.row("Since taking over [m]", moved, "{}", tip)
        tip = f"burnt since the start, at a specific impulse of {spent.thrusters.specific_impulse_s:g} s"
        w.row("Propellant", (spent.used_kg,), "{:.3f} kg", tip)
        w.row("Mass", (spent.mass_kg,), "{:.2f} kg", NOTES["mass"])
        strikes = "the plume strikes the target", style.OUTSIDE
        w.text(*(strikes if steering.plume else ("plume clear of the target", style.QUIET)), NOTES["plume"])

    def _to_a_point(self, console: Console) -> None:
        """Draw the fields of a point or of a displacement, a line about the flight there, and its button."""
        w, craft = self._w, console.session.craft
        w.section("Fly to, target's LVLH [m]")
        changed, self._from_here = w.imgui.checkbox("Counted from here", self._from_here)
        w.tip("on: offsets from the chaser's position; off: a point relative to the target")
        if changed or console.session is not self._flight:
            self._point, self._flight = [""] * 3, console.session
        # a component that nobody typed stays where the chaser is
        here = craft.state_lvlh()[0]
        start = here if self._from_here else np.zeros(3)
        follows = [f"{h:z.2f}" for h in here - start]
        arguments = console.table["guidance.waypoint"].arguments[:3]
        w.heads(AXES)
        for k, width in enumerate(w.grid(3, np.inf, 3)):
            w.imgui.set_next_item_width(width)
            self._point[k] = w.typed(f"point{k}", self._point[k], arguments[k], "Fly to", follows[k])
        shown = [text or here for text, here in zip(self._point, follows, strict=True)]
        flawed = any(a.flaw(text, "") for a, text in zip(arguments, shown, strict=True))
        place = here if flawed else np.round(start + np.array(shown, float), 3)
        warning, colour = ("" if flawed else HERE), style.QUIET
        if any(self._point) and not flawed:
            warning, colour = fly_to_warning(craft, place)
        w.lines(warning, colour, "about the straight way to the point")
        on = craft.steering.doing == FlyTo.title
        quiet = style.LIT if on else None if warning == HERE else style.PRIMARY
        fill = quiet if colour == style.QUIET else colour
        label = "Fly there" if colour == style.QUIET else "Fly there anyway"
        look: dict[str, Any] = {"label": label, "width": w.width, "fill": fill, "enabled": not flawed}
        w.button(console, "guidance.waypoint", *place.tolist(), **look)

    def _burns(self, console: Console) -> None:
        """Draw a table of the planned burns, whose numbers can be edited, and a button for a new one."""
        w, session = self._w, console.session
        w.section("Burns, target's LVLH [m/s]")
        burns = session.craft.steering.burns.burns
        at_s = max([session.t_s, *(b.end_s for b in burns)]) + FIRST_AFTER_S
        first = (round(at_s, 1), 0.0, FIRST_M_S, 0.0)
        # above the table, whose growth must not move it
        w.button(console, "burn.plan", *first, label="Add a burn", width=w.width)
        for k, burn in enumerate(burns):
            self._burn(console, k, burn)
        if burns:
            self._forecast(console)
            w.button(console, "burn.cancel", width=w.width)

    def _burn(self, console: Console, k: int, burn: PlannedBurn) -> None:
        """Draw the delete button and the time of a burn, and below them its components in three equal fields."""
        w, imgui = self._w, self._w.imgui
        now = (burn.t_s, *(round(float(v), 6) for v in burn.delta_v_lvlh_m_s))

        def replan(which: int, text: str) -> str:
            return console.attempt("burn.plan", *now[:which], text, *now[which + 1 :], burn.t_s)

        if imgui.button(f"x##burn{k}"):
            console.do("burn.cancel", burn.t_s)
        w.command_tip(console, "burn.cancel", burn.t_s)
        imgui.same_line()
        about = "middle of the burn since the scenario's start, h:min:s or seconds"
        w.field(f"Burn {k + 1} at T+", about, 0.5)
        w.entry(f"t{k}", mission_time(burn.t_s)[2:], partial(replan, 0), about, burn.t_s, now)
        if k == 0:
            w.heads(AXES)
        for axis, width in enumerate(w.grid(3, np.inf, 3), 1):
            imgui.set_next_item_width(width)
            about = f"change of velocity, {AXES[axis - 1]} [m/s]"
            w.entry(f"v{k}{axis}", f"{now[axis]:.4g}", partial(replan, axis), about, burn.t_s, now)

    def _forecast(self, console: Console) -> None:
        """Draw the delta-v of all burns, and the closest approach of their path to the target."""
        w, craft = self._w, console.session.craft
        total = sum(b.size_m_s for b in craft.steering.burns.burns)
        w.row("Delta-v", (speed_text(total),), "{}", "of all planned burns together")
        nearest_m, risk = craft.burns_forecast()
        if np.isfinite(nearest_m):
            with w.coloured(style.BAD if risk else style.INK):
                w.row("Closest", (nearest_m,), "{:.2f} m", NOTES["closest"])
        w.lines(risk and f"the path {risk}", style.BAD, "as red on the LVLH map")
