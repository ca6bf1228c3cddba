"""From a scenario to a propagated flight: degrees become radians, names become objects."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.scenario import motion as sm
from simulator.scenario import scenario as sc
from simulator.scenario.attitude import check_attitude, q_eci_from_target, target_motion
from simulator.scenario.chaser import burns, check_burns, check_chaser, guidance, keep_out, thrusters, wheels
from simulator.scenario.forces import check_forces, force_model
from simulator.world.attitude.pointing import Pointing
from simulator.world.attitude.target_attitude import Fixed
from simulator.world.ephemeris.bodies import BODIES, Body
from simulator.world.flight.build import ChaserPlan, TargetStart, propagate_flight
from simulator.world.flight.recording import Recording, recorded_tracks
from simulator.world.orbit.propagation import Elements, elements_from_state, state_from_elements
from simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray
    from simulator.targets.model import Target
    from simulator.world.flight.flight import Flight

_LOOK_EVERY_S = 60.0
MOST_FRAMES = 1_000_000
"""More frames than this in one run are taken for a mistake."""


def fly(scenario: sc.Scenario, target: Target, duration_s: float | None = None) -> Flight:
    """Propagate the scenario with the target's mass properties.

    Parameters
    ----------
    scenario : from `load_scenario`.
    target : gives the inertia, unless the scenario overrides it.
    duration_s : instead of the scenario's, for example for an open-ended session.
    """
    a = scenario.attitude
    r, v = orbit_state(scenario)
    down = scenario.chaser.pointing.down
    pointing = scenario.chaser.pointing
    epoch = Instant.from_utc(scenario.epoch_utc)
    span_s = duration_s or scenario.duration_s
    body = central_body(scenario)
    # a recording brings the target's attitude, and its chaser may be where no pointing could be made
    replayed = isinstance(scenario.chaser, sm.ReplayChaser)
    start = TargetStart(
        r_eci_m=r,
        v_eci_m_s=v,
        attitude=lambda frame: q_eci_from_target(a, frame),
        motion=Fixed(frame="eci")
        if replayed
        else target_motion(a, target.mass.inertia_kg_m2, epoch, scenario.duration_s),
    )
    chaser = ChaserPlan(
        guidance=guidance(scenario.chaser),
        thrusters=thrusters(scenario.chaser),
        keep_out=keep_out(scenario.chaser),
        wheels=wheels(scenario.chaser),
        pointing=Pointing(
            down="nadir" if down == "auto" else down,
            right_rad=np.radians(pointing.right_deg),
            below_rad=np.radians(pointing.below_deg),
            roll_rad=np.radians(pointing.roll_deg),
        ),
        choose_down=down == "auto",
    )
    flight = propagate_flight(
        start,
        chaser,
        epoch=epoch,
        duration_s=span_s,
        forces=force_model(scenario.forces, epoch, span_s, target.mass.mass_kg, body),
        body=body,
        burns=burns(scenario.burns),
    )
    _check_height(flight, scenario.name)
    if not isinstance(scenario.chaser, sm.ReplayChaser):
        return flight
    recording = Recording.read(Path(scenario.chaser.file))
    orbit, tumble = recorded_tracks(recording, flight.orbit.forces, span_s, epoch, body)
    return replace(flight, orbit=orbit, attitude=tumble, recording=recording)


def _check_height(flight: Flight, name: str) -> None:
    """Refuse a flight that drag or a burn brings to the ground."""
    for t_s in np.linspace(0.0, flight.duration_s, max(int(flight.duration_s / _LOOK_EVERY_S), 2)):
        height = float(np.linalg.norm(flight.orbit(float(t_s))[0])) - flight.body.radius_m
        if height < 0:
            raise UserError(
                f"scenario {name}: the target is below the surface of {flight.body.title} {t_s:.0f} s after the start: "
                "shorten duration_s, or change the burns or the orbit"
            )


def central_body(scenario: sc.Scenario) -> Body:
    """What the target circles."""
    return BODIES["earth" if isinstance(scenario.orbit, sm.TleOrbit) else scenario.orbit.centre]


def orbit_state(scenario: sc.Scenario) -> tuple[FloatArray, FloatArray]:
    """Position [m] and velocity [m s-1] of the target at the epoch from its central body, GCRS axes."""
    body = central_body(scenario)
    o = scenario.orbit
    if isinstance(o, sm.StateOrbit):
        return np.array(o.r_eci_km) * 1e3, np.array(o.v_eci_km_s) * 1e3
    if not isinstance(o, sm.ElementsOrbit):
        raise UserError("the orbit is still a TLE or a file: load the scenario with load_scenario")
    return state_from_elements(
        Elements(
            semi_major_axis_m=body.radius_m + o.altitude_km * 1e3,
            eccentricity=o.eccentricity,
            inclination_rad=np.radians(o.inclination_deg),
            raan_rad=np.radians(o.raan_deg),
            argument_of_perigee_rad=np.radians(o.argp_deg),
            true_anomaly_rad=np.radians(o.true_anomaly_deg),
        ),
        body.mu_m3_s2,
    )


def frame_times(duration_s: float, n: int | None = None, every_s: float | None = None) -> FloatArray:
    """Mid-exposure times of frames [s].

    ``n`` frames alone are spread evenly from the start to the end; with ``every_s`` they are that far apart
    from the start on, as many as fit when ``n`` is None.

    Raises
    ------
    UserError
        If a number is not positive, or the frames do not fit the flight.
    """
    if n is not None and n < 1:
        raise UserError(f"the number of frames is {n}, allowed: at least 1")
    if n is not None and n > MOST_FRAMES:
        raise UserError(f"the number of frames is {n}, allowed: at most {MOST_FRAMES}")
    if every_s is None:
        return np.linspace(0.0, duration_s, n or 1, dtype=float)
    if not (np.isfinite(every_s) and every_s > 0):
        raise UserError(f"the time between frames is {every_s} s, allowed: more than 0")
    # a rounding's worth of slack, so that 60 s hold 601 frames 0.1 s apart
    if duration_s / every_s > MOST_FRAMES:
        raise UserError(
            f"frames every {every_s:g} s are more than {MOST_FRAMES} in {duration_s:g} s; choose a longer spacing"
        )
    fitting = int(np.floor(duration_s / every_s + 1e-9)) + 1
    if n is not None and n > fitting:
        raise UserError(
            f"{n} frames every {every_s:g} s do not fit the flight of {duration_s:g} s: {fitting} do"
        )
    return np.minimum(np.arange(n or fitting, dtype=float) * every_s, duration_s)


def check_physics(scenario: sc.Scenario, where: str) -> None:
    """Refuse what each key allows alone but physics does not allow together.

    Raises
    ------
    UserError
        With file, key, value and what is allowed.
    """
    o = scenario.orbit
    r, v = orbit_state(scenario)
    body = central_body(scenario)
    if isinstance(o, sm.ElementsOrbit):
        altitude = (body.radius_m + o.altitude_km * 1e3) * (1 - o.eccentricity) - body.radius_m
        if altitude < body.lowest_m:
            key, value = (
                ("eccentricity", o.eccentricity) if o.eccentricity else ("altitude_km", o.altitude_km)
            )
            raise UserError(
                f"{where}: key orbit.{key} is {value:g}, which puts the orbit's lowest point at "
                f"{altitude / 1e3:.0f} km, allowed: at least {body.lowest_m / 1e3:.0f} km above {body.title}"
            )
    else:
        _check_state_orbit(r, v, body, where)
    check_forces(scenario.forces, body, where)
    check_attitude(scenario.attitude, body, where)
    check_chaser(scenario.chaser, where)
    check_burns(scenario, where)


def _check_state_orbit(r: FloatArray, v: FloatArray, body: Body, where: str) -> None:
    speed, radius = float(np.linalg.norm(v)), float(np.linalg.norm(r))
    escape = float(np.sqrt(2 * body.mu_m3_s2 / radius)) if radius > 0 else 0.0
    lowest = body.radius_m + body.lowest_m
    if radius < lowest:
        raise UserError(
            f"{where}: key orbit.r_eci_km is {radius / 1e3:.1f} km from the centre of {body.title}, "
            f"allowed: at least {lowest / 1e3:.0f} km"
        )
    if speed >= escape:
        raise UserError(
            f"{where}: key orbit.v_eci_km_s is {speed / 1e3:.3f} km/s fast, "
            f"allowed: less than the {escape / 1e3:.3f} km/s that leave {body.title}"
        )
    if float(np.linalg.norm(np.cross(r, v))) < 1e-3 * radius * escape:
        raise UserError(
            f"{where}: key orbit.v_eci_km_s points along orbit.r_eci_km, allowed: an orbit, not a fall"
        )
    e = elements_from_state(r, v, body.mu_m3_s2)
    altitude = e.semi_major_axis_m * (1 - e.eccentricity) - body.radius_m
    if altitude < body.lowest_m:
        raise UserError(
            f"{where}: section [orbit] has its lowest point {altitude / 1e3:.0f} km high, "
            f"allowed: at least {body.lowest_m / 1e3:.0f} km above {body.title}"
        )
