"""The propagated flight of a scenario, and the times of its frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.runtime.untrusted_files import decode_text
from flyaround.simulator.scenario.messages import (
    chaser_ephemeris,
    orbit_at_epoch,
    read_message,
    target_ephemeris,
)
from flyaround.simulator.world.attitude.target_attitude import Attitude
from flyaround.simulator.world.ephemeris.ephemeris_table import EphemerisTable
from flyaround.simulator.world.flight.build import TargetStart, propagate_flight, with_best_down
from flyaround.simulator.world.flight.recording import Replay, recorded_tracks
from flyaround.simulator.world.guidance.paths import Hold
from flyaround.simulator.world.messages.aem import read_aem_history
from flyaround.simulator.world.orbit.forces import EarthForces
from flyaround.simulator.world.orbit.moon_forces import MoonForces
from flyaround.simulator.world.orbit.spherical_harmonics import egm96
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.scenario import Scenario
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.attitude.rigid_body import AttitudeTrack
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.flight.flight import Flight
    from flyaround.simulator.world.orbit.forces import ForceModel, Forces

# Longest and shortest interval at which the flight is checked for impact on the ground [s].
_CHECK_INTERVAL_S, _MIN_STEP_S = 60.0, 1.0

PLACEHOLDER_CHASER = Hold(position_lvlh_m=(0.0, 100.0, 0.0))
"""Placeholder for the chaser, which is cheap to propagate."""

MAX_FRAMES = 1_000_000
"""Number of frames above which a run is probably a mistake."""


def fly(scenario: Scenario, target: Target, duration_s: float | None = None) -> Flight:
    """Propagate the scenario with the target's mass properties.

    Parameters
    ----------
    scenario : Scenario
        Scenario from `load_scenario`.
    target : Target
        Target with the inertia, unless the scenario overrides it.
    duration_s : float, optional
        Replaces the scenario's, for example in an open-ended session.

    Returns
    -------
    Flight
        States of both craft over the scenario's duration.

    Raises
    ------
    UserError
        If the duration is not positive, a craft hits the ground, is below 80 km under drag or leaves its body, or a
        file cannot be read.
    """
    orbit, chaser = orbit_at_epoch(scenario), scenario.chaser
    r, v = orbit.state()
    epoch = Instant.from_utc(scenario.epoch_utc)
    span_s = scenario.duration_s if duration_s is None else duration_s
    if not 0 < span_s < np.inf:
        raise UserError(f"the duration of the flight is {span_s} s, allowed: more than 0")
    replay = chaser if isinstance(chaser, Replay) else None
    flight = propagate_flight(
        TargetStart(
            r_eci_m=r,
            v_eci_m_s=v,
            # a recording contains the target's attitude, and at its start pointing may be undefined
            attitude=Attitude(motion="fixed", frame="eci") if replay else scenario.attitude,
            inertia_kg_m2=target.mass.inertia_kg_m2,
            history=_attitude_history(scenario, epoch),
            ephemeris=None if replay else target_ephemeris(scenario),
        ),
        PLACEHOLDER_CHASER if replay else chaser,
        epoch=epoch,
        duration_s=span_s,
        forces=force_model(
            scenario.forces.with_masses(target.mass.mass_kg, scenario.chaser_thrusters.mass_kg),
            epoch,
            span_s,
            orbit.body,
        ),
        body=orbit.body,
        burns=tuple(scenario.burns),
        chaser_ephemeris=chaser_ephemeris(scenario),
    )
    if replay is not None:
        flight = _replayed(flight, replay)
    _check_height(flight, scenario.name)
    return flight


def _replayed(flight: Flight, replay: Replay) -> Flight:
    """Return the flight with both craft as recorded, and the guidance of a chaser held where it ends."""
    recording = replay.read()
    track, attitude = recorded_tracks(
        recording, flight.orbit.forces, flight.duration_s, flight.epoch, flight.body
    )
    flight = replace(
        flight,
        orbit=track,
        attitude=attitude,
        recording=recording,
        pointing=replay.pointing,
        approach_axis_lvlh=replay.approach_axis_lvlh,
    )
    end_s = min(recording.duration_s, flight.duration_s)
    position, _ = flight.lvlh(end_s).from_eci(*flight.relative(end_s))
    flight = replace(flight, guidance=Hold(position_lvlh_m=vec3(position), pointing=replay.pointing))
    return with_best_down(flight) if replay.pointing.down == "auto" else flight


def _attitude_history(scenario: Scenario, epoch: Instant) -> AttitudeTrack | None:
    """Return the target's attitude over the scenario from the file that it follows, or None."""
    name = scenario.attitude.aem_file
    if scenario.attitude.motion != "aem" or name is None or isinstance(scenario.chaser, Replay):
        return None
    text = decode_text(read_message(Path(name), "attitude.aem_file"), name)
    return read_aem_history(text, name, epoch, scenario.duration_s)


def _check_height(flight: Flight, name: str) -> None:
    """Raise if a craft hits the ground, leaves its body's sphere of influence, or has no finite position.

    The time step is half of altitude over speed, so that no dive to the surface is missed, except within the shortest
    step.
    """
    t_s, body = 0.0, flight.body
    while True:
        r, v = flight.orbit(t_s)
        problem = _position_problem("the target", r, body)
        chaser, _ = flight.relative(t_s)
        problem = problem or _position_problem("the chaser", r + chaser, body)
        if problem:
            raise UserError(
                f"scenario {name}: {problem} {t_s:.0f} s after the start: shorten duration_s, or change the "
                "burns, the chaser's path or the orbit"
            )
        if t_s >= flight.duration_s:
            return
        height = min(float(np.linalg.norm(r)), float(np.linalg.norm(r + chaser))) - body.radius_m
        step_s = height / (2 * float(np.linalg.norm(v)))
        t_s = min(t_s + min(max(step_s, _MIN_STEP_S), _CHECK_INTERVAL_S), flight.duration_s)


def _position_problem(craft: str, r_m: FloatArray, body: Body) -> str | None:
    """Return why a craft cannot be at a position."""
    distance = float(np.linalg.norm(r_m))
    if not np.isfinite(distance):
        return f"the position of {craft} is not finite"
    if distance < body.radius_m:
        return f"{craft} is below the surface of {body.title}"
    if distance > body.reach_m:
        return f"{craft} is {distance / 1e3:.0f} km from {body.title} and has left it,"
    return None


def force_model(forces: Forces, epoch: Instant, duration_s: float, body: Body) -> ForceModel | None:
    """Return the requested forces about a body on both craft; None for its plain gravity."""
    model = FORCE_MODELS.get(body.name)
    return None if model is None else model(forces, epoch, duration_s)


def _moon_forces(forces: Forces, epoch: Instant, duration_s: float) -> ForceModel:
    return MoonForces(epoch=epoch, sky=EphemerisTable.build(epoch, duration_s), forces=forces)


def _earth_forces(forces: Forces, epoch: Instant, duration_s: float) -> ForceModel | None:
    degree = forces.gravity_degree
    if degree is None and not (forces.sun or forces.moon or forces.drag or forces.solar_pressure):
        return None
    degree = 2 if degree is None else degree
    return EarthForces(
        sky=EphemerisTable.build(epoch, duration_s),
        forces=forces,
        harmonics=egm96(degree) if degree >= 2 else None,
    )


FORCE_MODELS: dict[str, Callable[[Forces, Instant, float], ForceModel | None]] = {
    "earth": _earth_forces,
    "moon": _moon_forces,
}
"""Force models by body, for those with more than plain gravity."""


def frame_times(duration_s: float, n: int | None = None, every_s: float | None = None) -> FloatArray:
    """Choose the mid-exposure times of frames.

    ``n`` frames alone are spread evenly from start to end; ``every_s`` is a spacing from the start, with as many frames
    as fit if ``n`` is None.

    Returns
    -------
    (n,) array
        Times since the start [s] in order, none after ``duration_s``. A single frame is at 0; without ``n`` and
        ``every_s`` there is one.

    Raises
    ------
    UserError
        If a number is not positive, or the frames do not fit the flight.
    """
    if n is not None and n < 1:
        raise UserError(f"the number of frames is {n}, allowed: at least 1")
    if n is not None and n > MAX_FRAMES:
        raise UserError(f"the number of frames is {n}, allowed: at most {MAX_FRAMES}")
    if every_s is None:
        return np.linspace(0.0, duration_s, n or 1, dtype=float)
    if not (np.isfinite(every_s) and every_s > 0):
        raise UserError(f"the time between frames is {every_s} s, allowed: more than 0")
    # tolerance for rounding, so that 60 s hold 601 frames 0.1 s apart
    n_fitting = np.floor(duration_s / every_s + 1e-9) + 1
    if n is None and n_fitting > MAX_FRAMES:
        raise UserError(
            f"frames every {every_s:g} s are more than {MAX_FRAMES} in {duration_s:g} s; choose a longer spacing"
        )
    if n is not None and n > n_fitting:
        raise UserError(
            f"{n} frames every {every_s:g} s do not fit the flight of {duration_s:g} s: {n_fitting:.0f} do"
        )
    return np.minimum(np.arange(n or n_fitting, dtype=float) * every_s, duration_s)
