"""Commands of the world's guidance modes from where the chaser is, and of planned burns."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import Argument, Command
from flyaround.simulator.piloting import guidance_modes
from flyaround.simulator.piloting.guidance_modes import CLEAR_RADII, begin_mode
from flyaround.simulator.piloting.planned_burns import LARGEST_M_S, LONGEST_AHEAD_S, burn_of

if TYPE_CHECKING:
    from flyaround.gui.console import Console
    from flyaround.simulator.world.guidance.chaser import Chaser

FAR_M = 1e5
APPROACH_M_S = 0.1
TURN_S = 900.0


def _fly(console: Console, title: str, mode: Chaser) -> None:
    session = console.session
    session.take_over()
    state, flight = session.state_lvlh(), session.flight
    session.steering.guide(begin_mode(title, mode, state, flight.n_rad_s, session.t_s, flight.orbit))
    console.say(f"guidance: {title}")


def _state(console: Console) -> guidance_modes.LvlhState:
    console.session.take_over()
    return console.session.state_lvlh()


def _radius(console: Console) -> float:
    return console.session.docking.radius_m


def _near_m(console: Console) -> float:
    """What is taken for a hold point's distance unless one is given: 10 m, or farther from a large target."""
    return max(10.0, 2 * CLEAR_RADII * _radius(console))


def _hold(console: Console) -> None:
    _fly(console, "station keeping", guidance_modes.hold_here(_state(console)))


def _hold_at(console: Console, radial: float, along: float, cross: float) -> None:
    _fly(console, "station keeping", guidance_modes.hold_at((radial, along, cross), _radius(console)))


def _vbar(console: Console, hold: float | None = None, speed: float = APPROACH_M_S) -> None:
    near = _near_m(console) if hold is None else hold
    _fly(console, "V-bar", guidance_modes.vbar(_state(console), near, speed, _radius(console)))


def _rbar(console: Console, hold: float | None = None, speed: float = APPROACH_M_S) -> None:
    near = _near_m(console) if hold is None else hold
    _fly(console, "R-bar", guidance_modes.rbar(_state(console), near, speed, _radius(console)))


def _glideslope(console: Console, end: float | None = None) -> None:
    near = _near_m(console) if end is None else end
    _fly(console, "glideslope", guidance_modes.glideslope(_state(console), near, _radius(console)))


def _waypoint(
    console: Console, radial: float, along: float, cross: float, speed: float = APPROACH_M_S
) -> None:
    mode = guidance_modes.waypoint(_state(console), (radial, along, cross), speed, _radius(console))
    _fly(console, "waypoint", mode)


def _flyaround(console: Console, radius: float | None = None, period: float = TURN_S) -> None:
    state = _state(console)
    away = float((state[0] @ state[0]) ** 0.5) if radius is None else radius
    _fly(console, "fly-around", guidance_modes.flyaround(state, away, period, _radius(console)))


def _circumnavigate(console: Console, size: float | None = None) -> None:
    mode = guidance_modes.circumnavigation(_state(console), size, _radius(console))
    _fly(console, "natural circumnavigation", mode)


def _safe_ellipse(console: Console, size: float | None = None) -> None:
    _fly(console, "safe ellipse", guidance_modes.safe_ellipse(_state(console), size, _radius(console)))


def _keep_range(console: Console, near: float | None = None, far: float | None = None) -> None:
    state = _state(console)
    away = float((state[0] @ state[0]) ** 0.5)
    near = max(away - 5.0, CLEAR_RADII * _radius(console)) if near is None else near
    far = away + 5.0 if far is None else far
    _fly(console, "range keeping", guidance_modes.keep_range(state, near, far, _radius(console)))


def _drift(console: Console) -> None:
    console.session.take_over()
    console.session.steering.guide(None)
    console.say("guidance: none, the chaser drifts")


def _plan_burn(console: Console, t: float, radial: float, along: float, cross: float) -> None:
    session = console.session
    session.take_over()
    burn = burn_of(t, radial, along, cross)
    session.steering.burns = session.steering.burns.with_burn(burn, session.t_s)
    console.say(f"a burn of {burn.size_m_s:.3g} m/s is planned at T+{t:.1f} s")


def _cancel_burn(console: Console, t: float | None = None) -> None:
    steering = console.session.steering
    before = len(steering.burns.burns)
    steering.burns = steering.burns.without(t)
    console.say(f"{before - len(steering.burns.burns)} planned burn(s) cancelled")


def _distance(name: str, text: str, *, optional: bool = True) -> Argument:
    return Argument(name, "number", text, least=0.1, most=FAR_M, optional=optional, unit="m")


def _place() -> tuple[Argument, ...]:
    return tuple(
        Argument(a, "number", text, least=-FAR_M, most=FAR_M, unit="m")
        for a, text in (
            ("radial", "outward from the Earth"),
            ("along", "along the flight"),
            ("cross", "across the orbit"),
        )
    )


SPEED = Argument(
    "speed", "number", "of the approach; 0.1 unless given", least=1e-3, most=10.0, optional=True, unit="m/s"
)

COMMANDS = (
    Command("guidance.hold", "Station keeping", "keep the chaser where it is beside the target", _hold),
    Command(
        "guidance.hold-at",
        "Station keeping at a point",
        "fly to a point of LVLH and keep it",
        _hold_at,
        arguments=_place(),
    ),
    Command(
        "guidance.vbar",
        "V-bar approach",
        "along the velocity axis to a hold point, by default 10 m from the centre of mass",
        _vbar,
        arguments=(_distance("hold", "from the target's centre of mass"), SPEED),
    ),
    Command(
        "guidance.rbar",
        "R-bar approach",
        "along the radius to a hold point, by default 10 m from the centre of mass",
        _rbar,
        arguments=(_distance("hold", "from the target's centre of mass"), SPEED),
    ),
    Command(
        "guidance.glideslope",
        "Glideslope",
        "straight in, the slower the nearer, by default to 10 m",
        _glideslope,
        arguments=(_distance("end", "from the target's centre of mass"),),
    ),
    Command(
        "guidance.waypoint",
        "Waypoint",
        "along a straight line to a point of LVLH, and keep it",
        _waypoint,
        arguments=(*_place(), SPEED),
    ),
    Command(
        "guidance.flyaround",
        "Fly-around",
        "a forced circle about the target through where the chaser is, by default once in 15 minutes",
        _flyaround,
        arguments=(
            _distance("radius", "of the circle; left out: where the chaser is"),
            Argument(
                "period",
                "number",
                "of a turn; 900 unless given",
                least=60.0,
                most=1e5,
                optional=True,
                unit="s",
            ),
        ),
    ),
    Command(
        "guidance.circumnavigate",
        "Circumnavigation",
        "one burn onto the 2:1 ellipse about the target through where the chaser is, then free flight",
        _circumnavigate,
        arguments=(_distance("size", "half of its radial size; left out: through where the chaser is"),),
    ),
    Command(
        "guidance.safe-ellipse",
        "Safe ellipse",
        "onto an ellipse that keeps clear of the velocity axis, then free flight",
        _safe_ellipse,
        arguments=(_distance("size", "half of its radial size; left out: through where the chaser is"),),
    ),
    Command(
        "guidance.keep-range",
        "Range keeping",
        "drift that is turned back at two distances, by default 5 m to both sides",
        _keep_range,
        arguments=(
            _distance("near", "turned back when nearer than this"),
            _distance("far", "turned back when farther than this"),
        ),
    ),
    Command("guidance.drift", "Free drift", "no guidance, no autopilot: the chaser drifts", _drift),
    Command(
        "burn.plan",
        "Plan a burn",
        "a change of velocity along LVLH axes at a time; the thrusters begin so much earlier that its middle is there",
        _plan_burn,
        arguments=(
            Argument(
                "t", "number", "since the scenario's start", least=0.0, most=1e6 + LONGEST_AHEAD_S, unit="s"
            ),
            *(
                Argument(a, "number", text, least=-LARGEST_M_S, most=LARGEST_M_S, unit="m/s")
                for a, text in (
                    ("radial", "outward from the Earth"),
                    ("along", "along the flight"),
                    ("cross", "across the orbit"),
                )
            ),
        ),
    ),
    Command(
        "burn.cancel",
        "Cancel burns",
        "take back the planned burn nearest to a time; left out: all of them",
        _cancel_burn,
        arguments=(Argument("t", "number", "since the scenario's start", optional=True, unit="s"),),
    ),
)
