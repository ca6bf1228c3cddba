"""Replaces TLEs, CCSDS orbit and attitude messages of a scenario by the states they give at its epoch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from simulator.errors import UserError
from simulator.runtime.arrays import quat, vec3
from simulator.runtime.untrusted_files import read_regular
from simulator.world.flight.recording import Recording, Replay
from simulator.world.messages.aem import read_aem_state
from simulator.world.messages.oem import read_oem_state
from simulator.world.messages.tle import state_from_tle
from simulator.world.orbit.initial_orbit import OemOrbit, StateOrbit, TleOrbit
from simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray
    from simulator.scenario.scenario import AnyChaser, Scenario
    from simulator.world.attitude.target_attitude import Attitude
    from simulator.world.ephemeris.bodies import BodyName
    from simulator.world.orbit.initial_orbit import ElementsOrbit, KnownOrbit


def resolve_messages(scenario: Scenario, where: str, folder: Path) -> Scenario:
    """The scenario with a TLE or OEM orbit and an AEM attitude replaced by the states they give.

    Parameters
    ----------
    scenario : as read. where : its name, for messages. folder : where relative paths start.

    Raises
    ------
    UserError
        If a file cannot be read or says nothing about the epoch.
    """
    epoch = Instant.from_utc(scenario.epoch_utc)
    try:
        return msgspec.structs.replace(
            scenario,
            orbit=_orbit(scenario.orbit, epoch, folder),
            attitude=_attitude(scenario.attitude, epoch, folder),
            chaser=_chaser(scenario.chaser, scenario.duration_s, folder),
        )
    except UserError as error:
        raise UserError(f"{where}: {error}") from error


def _orbit(
    orbit: ElementsOrbit | StateOrbit | TleOrbit | OemOrbit, epoch: Instant, folder: Path
) -> KnownOrbit:
    match orbit:
        case TleOrbit():
            centre: BodyName = "earth"
            r, v = state_from_tle(orbit.line1, orbit.line2, epoch)
        case OemOrbit():
            centre = orbit.centre
            text = read_message(orbit.file, "orbit.file", folder)
            r, v = read_oem_state(text, orbit.file, epoch, centre.upper())
        case _:
            return orbit
    return StateOrbit(centre=centre, r_eci_km=vec3(r / 1e3), v_eci_km_s=vec3(v / 1e3))


def _attitude(attitude: Attitude, epoch: Instant, folder: Path) -> Attitude:
    name = attitude.aem_file
    if name is None:
        return attitude
    if attitude.q_wxyz is not None or attitude.euler_deg is not None:
        raise UserError("section [attitude] has aem_file and another attitude, allowed: one of them")
    if attitude.motion == "aem":
        # the file stays with the scenario; the flight reads all of it
        return msgspec.structs.replace(attitude, aem_file=str((folder / name).resolve()))
    q, rate = read_aem_state(read_message(name, "attitude.aem_file", folder), name, epoch)
    x, y, z = np.degrees(rate)
    return msgspec.structs.replace(
        attitude, aem_file=None, frame="eci", q_wxyz=quat(_unit(q)), rate_deg_s=(float(x), float(y), float(z))
    )


def _chaser(chaser: AnyChaser, duration_s: float, folder: Path) -> AnyChaser:
    """The chaser, with the path of a recording made absolute and its length checked."""
    if not isinstance(chaser, Replay):
        return chaser
    path = (folder / chaser.file).resolve()
    recorded_s = Recording.read(path).duration_s
    if recorded_s < duration_s:
        raise UserError(
            f"key duration_s is {duration_s:g}, allowed: at most the {recorded_s:g} s of recording {chaser.file}"
        )
    return msgspec.structs.replace(chaser, file=str(path))


def _unit(q: FloatArray) -> FloatArray:
    return q / np.linalg.norm(q)


MOST_BYTES = 100_000_000  # of a message: years of states, a minute apart


def read_message(name: str, key: str, folder: Path) -> str:
    """Text of a message file.

    Raises
    ------
    UserError
        If it cannot be read, with the key that names it.
    """
    path = folder / name
    try:
        return read_regular(path, MOST_BYTES).decode("utf-8")
    except OSError as error:
        raise UserError(f"key {key} is {name!r}, which cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise UserError(f"key {key} is {name!r}, which is not a text file") from error
