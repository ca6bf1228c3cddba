"""From a scenario to a propagated flight, and the times of its frames."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.runtime.untrusted_files import decode_text
from simulator.scenario.messages import chaser_ephemeris, known_orbit, read_message, target_ephemeris
from simulator.world.attitude.target_attitude import Attitude
from simulator.world.ephemeris.bodies import MOON
from simulator.world.ephemeris.ephemeris_table import EphemerisTable
from simulator.world.flight.build import TargetStart, propagate_flight
from simulator.world.flight.recording import Replay, recorded_tracks
from simulator.world.messages.aem import read_aem_history
from simulator.world.orbit.forces import EarthForces
from simulator.world.orbit.moon_forces import MoonForces
from simulator.world.orbit.spherical_harmonics import egm96
from simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray
    from simulator.scenario.scenario import Scenario
    from simulator.targets.model import Target
    from simulator.world.attitude.rigid_body import AttitudeTrack
    from simulator.world.ephemeris.bodies import Body
    from simulator.world.flight.flight import Flight
    from simulator.world.orbit.forces import ForceModel, Forces

_CHASER_MASS_KG = 100.0
_LOOK_EVERY_S = 60.0
MOST_FRAMES = 1_000_000
"""More frames than this in one run are taken for a mistake."""


def fly(scenario: Scenario, target: Target, duration_s: float | None = None) -> Flight:
    """Propagate the scenario with the target's mass properties.

    Parameters
    ----------
    scenario : from `load_scenario`.
    target : gives the inertia, unless the scenario overrides it.
    duration_s : instead of the scenario's, for example for an open-ended session.
    """
    orbit, chaser = known_orbit(scenario), scenario.chaser
    r, v = orbit.state()
    epoch = Instant.from_utc(scenario.epoch_utc)
    span_s = duration_s or scenario.duration_s
    replay = chaser if isinstance(chaser, Replay) else None
    flight = propagate_flight(
        TargetStart(
            r_eci_m=r,
            v_eci_m_s=v,
            # a recording brings the target's attitude, and its chaser may be where no pointing could be made
            attitude=Attitude(motion="fixed", frame="eci") if replay else scenario.attitude,
            inertia_kg_m2=target.mass.inertia_kg_m2,
            history=_attitude_history(scenario, epoch),
            ephemeris=None if replay else target_ephemeris(scenario),
        ),
        replay.held_at_start() if replay else chaser,
        epoch=epoch,
        duration_s=span_s,
        forces=force_model(scenario.forces, epoch, span_s, target.mass.mass_kg, orbit.body),
        body=orbit.body,
        burns=tuple(scenario.burns),
        chaser_ephemeris=chaser_ephemeris(scenario),
    )
    _check_height(flight, scenario.name)
    if replay is None:
        return flight
    recording = replay.read()
    track, attitude = recorded_tracks(recording, flight.orbit.forces, span_s, epoch, orbit.body)
    return replace(flight, orbit=track, attitude=attitude, recording=recording)


def _attitude_history(scenario: Scenario, epoch: Instant) -> AttitudeTrack | None:
    """The target's attitude over the scenario, from the file that it follows."""
    name = scenario.attitude.aem_file
    if scenario.attitude.motion != "aem" or name is None or isinstance(scenario.chaser, Replay):
        return None
    text = decode_text(read_message(Path(name), "attitude.aem_file"), name)
    return read_aem_history(text, name, epoch, scenario.duration_s)


def _check_height(flight: Flight, name: str) -> None:
    """Refuse a flight that drag or a burn brings to the ground."""
    for t_s in np.linspace(0.0, flight.duration_s, max(int(flight.duration_s / _LOOK_EVERY_S), 2)):
        height = float(np.linalg.norm(flight.orbit(float(t_s))[0])) - flight.body.radius_m
        if height < 0:
            raise UserError(
                f"scenario {name}: the target is below the surface of {flight.body.title} {t_s:.0f} s after the start: "
                "shorten duration_s, or change the burns or the orbit"
            )


def force_model(
    forces: Forces, epoch: Instant, duration_s: float, target_mass_kg: float, body: Body
) -> ForceModel | None:
    """The forces asked for about a body, or None for the plain point mass with J2 (the Earth)."""
    known, degree = forces.with_masses(target_mass_kg, _CHASER_MASS_KG), forces.gravity_degree
    if body is MOON:
        return MoonForces(epoch=epoch, sky=EphemerisTable.of(epoch, duration_s), forces=known)
    if degree is None and not (forces.sun or forces.moon or forces.drag or forces.solar_pressure):
        return None
    degree = 2 if degree is None else degree
    return EarthForces(
        sky=EphemerisTable.of(epoch, duration_s),
        forces=known,
        harmonics=egm96(degree) if degree >= 2 else None,
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
