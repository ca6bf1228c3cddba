"""Commands of the world's guidance modes from where the chaser is, and of planned burns."""

from __future__ import annotations

from flyaround.gui.command_table import Argument, Command, command, moment, number
from flyaround.gui.commands.steering import order
from flyaround.simulator.piloting import guidance_orders as orders
from flyaround.simulator.piloting.orders import CancelBurns, Drift, PlanBurn
from flyaround.simulator.piloting.planned_burns import MAX_DELTA_V_M_S, burn_of

FAR_M = 1e5


def _distance(name: str, text: str) -> Argument:
    return number(name, text, 0.1, FAR_M, "m", optional=True)


def _lvlh(most: float, unit: str) -> tuple[Argument, ...]:
    """Return the three components of a vector in the LVLH frame."""
    axes = {"radial": "outward from the Earth", "along": "along the flight", "cross": "across the orbit"}
    return tuple(number(axis, about, -most, most, unit) for axis, about in axes.items())


def _mode(name: str, mode: type[orders.GuidanceOrder], *arguments: Argument) -> Command:
    """Return the command of a mode, which is lit while the mode flies."""
    state = lambda console: console.session.craft.steering.doing == mode.title  # noqa: E731
    return command(f"guidance.{name}", order(mode), *arguments, state=state)


PLACE = _lvlh(FAR_M, "m")
SPEED = number("speed", "of the approach; 0.1 unless given", 1e-3, 10.0, "m/s", optional=True)
HOLD = _distance("hold", "from the target's centre of mass")
SIZE = _distance("size", "half of its radial size; left out: through where the chaser is")
PERIOD = number("period", "of a turn; 900 unless given", 60.0, 1e5, "s", optional=True)
RADIUS = _distance("radius", "of the circle; left out: where the chaser is")
NEAR = _distance("near", "turned back when nearer than this")
FAR = _distance("far", "turned back when farther than this")
SINCE_START = "since the scenario's start"

COMMANDS = (
    _mode("hold", orders.KeepStation),
    command("guidance.hold-at", order(lambda *place: orders.KeepStation(place)), *PLACE),
    _mode("vbar", orders.ApproachVbar, HOLD, SPEED),
    _mode("rbar", orders.ApproachRbar, HOLD, SPEED),
    _mode("glideslope", orders.FlyGlideslope, _distance("end", "from the target's centre of mass")),
    command(
        "guidance.waypoint", order(lambda r, a, c, *speed: orders.FlyTo((r, a, c), *speed)), *PLACE, SPEED
    ),
    _mode("flyaround", orders.FlyAround, RADIUS, PERIOD),
    _mode("circumnavigate", orders.Circumnavigate, SIZE),
    _mode("safe-ellipse", orders.FlySafeEllipse, SIZE),
    _mode("keep-range", orders.KeepRange, NEAR, FAR),
    command("guidance.drift", order(Drift), state=lambda c: c.session.craft.drifts),
    command(
        "burn.plan",
        order(lambda *burn: PlanBurn(burn_of(*burn[:4]), *burn[4:])),
        moment("time", SINCE_START),
        *_lvlh(MAX_DELTA_V_M_S, "m/s"),
        moment("replaces", "time of the planned burn that it replaces", optional=True),
    ),
    command("burn.cancel", order(CancelBurns), moment("time", SINCE_START, optional=True)),
)
