"""Resolution of a scenario's TLEs and CCSDS messages to states at its epoch."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.runtime.untrusted_files import decode_text, read_regular
from flyaround.simulator.scenario.orbit_files import read_orbit_file
from flyaround.simulator.world.ephemeris.body import body_named
from flyaround.simulator.world.flight.recording import Recording, Replay
from flyaround.simulator.world.guidance.free_flight import FollowedChaser
from flyaround.simulator.world.messages.aem import read_aem_state
from flyaround.simulator.world.messages.tle import state_from_tle
from flyaround.simulator.world.orbit.initial_orbit import (
    ElementsOrbit,
    OemOrbit,
    ResolvedOrbit,
    StateOrbit,
    TleOrbit,
)
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.scenario import AnyChaser, Scenario
    from flyaround.simulator.world.attitude.target_attitude import Attitude
    from flyaround.simulator.world.messages.ephemeris import Ephemeris

    State = tuple[FloatArray, FloatArray]


def resolve_messages(scenario: Scenario, source: str, folder: Path) -> Scenario:
    """Return the scenario with a TLE or OEM orbit and an AEM attitude replaced by states.

    Parameters
    ----------
    scenario : Scenario
        Scenario as read.
    source : str
        Name of the file in error messages.
    folder : Path
        Base of relative paths.

    Raises
    ------
    UserError
        If a file cannot be read or does not cover the epoch.
    """
    epoch = Instant.from_utc(scenario.epoch_utc)
    try:
        body_named(getattr(scenario.orbit, "centre", "earth"))
        return msgspec.structs.replace(
            scenario,
            orbit=_orbit(scenario.orbit, epoch, scenario.duration_s, folder),
            attitude=_attitude(scenario.attitude, epoch, folder),
            chaser=_chaser(scenario.chaser, scenario.duration_s, folder),
        )
    except UserError as error:
        raise UserError(f"{source}: {error}") from error


def _orbit(
    orbit: ElementsOrbit | StateOrbit | TleOrbit | OemOrbit, epoch: Instant, duration_s: float, folder: Path
) -> ResolvedOrbit | OemOrbit:
    match orbit:
        case TleOrbit(line1=str(line1), line2=str(line2), file=None):
            orbit_source: Ephemeris | State = state_from_tle(line1, line2, epoch)
            centre: str = "earth"
            name, motion = "the two-line elements", None
        case TleOrbit(line1=None, line2=None, file=str(name)):
            orbit = OemOrbit(file=name, satellite=orbit.satellite)
            return _orbit(orbit, epoch, duration_s, folder)
        case TleOrbit():
            raise UserError("section [orbit] has kind tle, allowed: line1 and line2, or file alone")
        case OemOrbit():
            name, centre, motion = orbit.file, orbit.centre, orbit.motion
            orbit_source = _orbit_file(folder / name, "orbit.file", epoch, centre, orbit.satellite)
        case _:
            return orbit
    if not isinstance(orbit_source, tuple):
        if isinstance(orbit, OemOrbit) and motion != "propagate":
            orbit_source.require_span(duration_s)
            return msgspec.structs.replace(orbit, file=str((folder / name).resolve()), motion="oem")
        orbit_source.require_span(0.0)
        orbit_source = orbit_source(0.0)[:2]
    elif motion == "oem":
        raise UserError(
            f"key orbit.motion is 'oem', but {name} has a single state but no ephemeris: remove the key"
        )
    state = _state_orbit(centre, orbit_source)
    if (problem := state.problem()) is not None:
        velocity = "has a velocity that " if "v_eci" in problem[0] else ""
        raise UserError(f"the state that {name} gives at {epoch.iso()} {velocity}{problem[1]}")
    return state


def _state_orbit(centre: str, state: State) -> StateOrbit:
    return StateOrbit(centre=centre, r_eci_km=vec3(state[0] / 1e3), v_eci_km_s=vec3(state[1] / 1e3))


def target_ephemeris(scenario: Scenario) -> Ephemeris | None:
    """Return the ephemeris that the target of a loaded scenario follows; None if it is propagated.

    Raises
    ------
    UserError
        If the orbit is still a file.
    """
    orbit = scenario.orbit
    if not isinstance(orbit, OemOrbit):
        return None
    epoch = Instant.from_utc(scenario.epoch_utc)
    ephemeris = _orbit_file(Path(orbit.file), "orbit.file", epoch, orbit.centre, orbit.satellite)
    if orbit.motion != "oem" or isinstance(ephemeris, tuple):
        raise UserError("the orbit is still a file: load the scenario with load_scenario")
    return ephemeris


def chaser_ephemeris(scenario: Scenario) -> Ephemeris | None:
    """Return the ephemeris that the chaser follows, about the target's central body; None if its mode moves it.

    Raises
    ------
    UserError
        If the file has no ephemeris over the scenario.
    """
    chaser = scenario.chaser
    if not isinstance(chaser, FollowedChaser):
        return None
    epoch = Instant.from_utc(scenario.epoch_utc)
    centre: str = getattr(scenario.orbit, "centre", "earth")
    ephemeris = _orbit_file(Path(chaser.file), "chaser.file", epoch, centre, chaser.satellite)
    if isinstance(ephemeris, tuple):
        raise UserError(
            f"key chaser.file is {chaser.file!r}, which has a single state but no ephemeris: give an OEM"
        )
    ephemeris.require_span(scenario.duration_s)
    return ephemeris


def ephemeris_sentences(scenario: Scenario) -> list[str]:
    """Describe the craft of a loaded scenario that follow a file.

    Returns
    -------
    list of str
        One sentence for each of them, the target first; empty if none does.
    """
    ephemerides = {"target": target_ephemeris(scenario), "chaser": chaser_ephemeris(scenario)}
    return [
        f"{craft}: follows {Path(e.where).name} between its lines, {e.interpolation}"
        for craft, e in ephemerides.items()
        if e is not None
    ]


def orbit_at_epoch(scenario: Scenario) -> ResolvedOrbit:
    """Return the target's orbit at the epoch, with its TLE or message already read.

    Raises
    ------
    UserError
        If it has not been read.
    """
    if isinstance(scenario.orbit, ElementsOrbit | StateOrbit):
        return scenario.orbit
    ephemeris = target_ephemeris(scenario)
    if ephemeris is None:
        raise UserError("the orbit is still a TLE or a file: load the scenario with load_scenario")
    return _state_orbit(getattr(scenario.orbit, "centre", "earth"), ephemeris(0.0)[:2])


def _orbit_file(
    path: Path, key: str, epoch: Instant, centre: str, satellite: str | None
) -> Ephemeris | State:
    data = read_message(path, key)
    return _parse_orbit(data, str(path), epoch, centre, satellite)


# a flight uses the same parsed data as the check of its scenario
@lru_cache(maxsize=4)
def _parse_orbit(
    data: bytes, source: str, epoch: Instant, centre: str, satellite: str | None
) -> Ephemeris | State:
    return read_orbit_file(data, source, epoch, centre=centre, satellite=satellite)


def _attitude(attitude: Attitude, epoch: Instant, folder: Path) -> Attitude:
    name = attitude.aem_file
    if name is None:
        return attitude
    if attitude.q_wxyz is not None or attitude.euler_deg is not None:
        raise UserError("section [attitude] has aem_file and another attitude, allowed: one of them")
    if attitude.motion == "aem":
        # the scenario keeps the file; the flight reads all of it
        return msgspec.structs.replace(attitude, aem_file=str((folder / name).resolve()))
    text = decode_text(read_message(folder / name, "attitude.aem_file"), name)
    q, rate = read_aem_state(text, name, epoch)
    x, y, z = np.degrees(rate)
    return msgspec.structs.replace(
        attitude,
        aem_file=None,
        frame="eci",
        q_wxyz=quat(_normalised(q)),
        rate_deg_s=(float(x), float(y), float(z)),
    )


def _chaser(chaser: AnyChaser, duration_s: float, folder: Path) -> AnyChaser:
    """Return the chaser with absolute file paths, and a recording's length checked."""
    if isinstance(chaser, FollowedChaser):
        return msgspec.structs.replace(chaser, file=str((folder / chaser.file).resolve()))
    if not isinstance(chaser, Replay):
        return chaser
    path = (folder / chaser.file).resolve()
    recorded_s = Recording.read(path).duration_s
    if recorded_s < duration_s:
        raise UserError(
            f"key duration_s is {duration_s:g}, allowed: at most the {recorded_s:g} s of recording {chaser.file}"
        )
    return msgspec.structs.replace(chaser, file=str(path))


def _normalised(q: FloatArray) -> FloatArray:
    return q / np.linalg.norm(q)


MAX_BYTES = 100_000_000  # size limit of a message: years of states, a minute apart


def read_message(path: Path, key: str) -> bytes:
    """Read the bytes of a message file.

    Raises
    ------
    UserError
        If it cannot be read; the message names the key.
    """
    try:
        return read_regular(path, MAX_BYTES)
    except OSError as error:
        raise UserError(
            f"key {key} is {str(path)!r}, which cannot be read: {error.strerror or error}"
        ) from error
    except ValueError as error:  # a null character in the name
        raise UserError(f"key {key} is {str(path)!r}, which is not a valid file name: {error}") from error
