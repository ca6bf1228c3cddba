"""Commands of the world's guidance modes from where the chaser is, and of planned burns."""

from __future__ import annotations

from flyaround.gui.command_table import Argument, Command, number
from flyaround.gui.commands.steering import order
from flyaround.simulator.piloting import guidance_orders as orders
from flyaround.simulator.piloting.orders import CancelBurns, Drift, PlanBurn
from flyaround.simulator.piloting.planned_burns import LARGEST_M_S, LONGEST_AHEAD_S, burn_of

FAR_M = 1e5


def _distance(name: str, text: str) -> Argument:
    return number(name, text, 0.1, FAR_M, "m", optional=True)


def _lvlh(most: float, unit: str) -> tuple[Argument, ...]:
    """Return the three components of a vector in the LVLH frame."""
    axes = {"radial": "outward from the Earth", "along": "along the flight", "cross": "across the orbit"}
    return tuple(number(axis, about, -most, most, unit) for axis, about in axes.items())


PLACE = _lvlh(FAR_M, "m")
SPEED = number("speed", "of the approach; 0.1 unless given", 1e-3, 10.0, "m/s", optional=True)
HOLD = _distance("hold", "from the target's centre of mass")
SIZE = _distance("size", "half of its radial size; left out: through where the chaser is")
PERIOD = number("period", "of a turn; 900 unless given", 60.0, 1e5, "s", optional=True)
SINCE_START = "since the scenario's start"

COMMANDS = (
    Command(
        "guidance.hold",
        "Station keeping",
        "keep the chaser where it is beside the target",
        order(orders.KeepStation),
    ),
    Command(
        "guidance.hold-at",
        "Station keeping at a point",
        "fly to a point of LVLH and keep it",
        order(lambda *place: orders.KeepStation(place)),
        arguments=PLACE,
    ),
    *(
        Command(
            f"guidance.{name}",
            f"{title} approach",
            f"along the {axis} to a hold point, by default 10 m from the centre of mass",
            order(made),
            arguments=(HOLD, SPEED),
        )
        for name, title, axis, made in (
            ("vbar", "V-bar", "velocity axis", orders.ApproachVbar),
            ("rbar", "R-bar", "radius", orders.ApproachRbar),
        )
    ),
    Command(
        "guidance.glideslope",
        "Glideslope",
        "straight in, the slower the nearer, by default to 10 m",
        order(orders.FlyGlideslope),
        arguments=(_distance("end", "from the target's centre of mass"),),
    ),
    Command(
        "guidance.waypoint",
        "Waypoint",
        "along a straight line to a point of LVLH, and keep it",
        order(lambda r, a, c, *speed: orders.FlyTo((r, a, c), *speed)),
        arguments=(*PLACE, SPEED),
    ),
    Command(
        "guidance.flyaround",
        "Fly-around",
        "a forced circle about the target through where the chaser is, by default once in 15 minutes",
        order(orders.FlyAround),
        arguments=(_distance("radius", "of the circle; left out: where the chaser is"), PERIOD),
    ),
    Command(
        "guidance.circumnavigate",
        "Circumnavigation",
        "one burn onto the 2:1 ellipse about the target through where the chaser is, then free flight",
        order(orders.Circumnavigate),
        arguments=(SIZE,),
    ),
    Command(
        "guidance.safe-ellipse",
        "Safe ellipse",
        "onto an ellipse that keeps clear of the velocity axis, then free flight",
        order(orders.FlySafeEllipse),
        arguments=(SIZE,),
    ),
    Command(
        "guidance.keep-range",
        "Range keeping",
        "drift that is turned back at two distances, by default 5 m to both sides",
        order(orders.KeepRange),
        arguments=(
            _distance("near", "turned back when nearer than this"),
            _distance("far", "turned back when farther than this"),
        ),
    ),
    Command("guidance.drift", "Free drift", "no guidance, no autopilot: the chaser drifts", order(Drift)),
    Command(
        "burn.plan",
        "Plan a burn",
        "a change of velocity along LVLH axes at a time; the thrusters begin so much earlier that its middle is there",
        order(lambda *burn: PlanBurn(burn_of(*burn))),
        arguments=(number("t", SINCE_START, 0.0, 1e6 + LONGEST_AHEAD_S, "s"), *_lvlh(LARGEST_M_S, "m/s")),
    ),
    Command(
        "burn.cancel",
        "Cancel burns",
        "take back the planned burn nearest to a time; left out: all of them",
        order(CancelBurns),
        arguments=(number("t", SINCE_START, unit="s", optional=True),),
    ),
)
