"""Propagation of a flight: target orbit, target attitude, chaser, and camera attitude, in this order."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.simulator.world.attitude.directions import PointingContext
from flyaround.simulator.world.attitude.pointing import DOWN_AXES_LVLH
from flyaround.simulator.world.attitude.reaction_wheels import fly_wheels
from flyaround.simulator.world.attitude.target_attitude import Attitude, SteadyTrack
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.flight.flight import Flight
from flyaround.simulator.world.frames.lvlh import lvlh_frame
from flyaround.simulator.world.frames.rotation import quat_normalize
from flyaround.simulator.world.guidance.command_script import CommandScript, fly_script
from flyaround.simulator.world.guidance.thruster_control import fly_controlled
from flyaround.simulator.world.orbit.followed import CraftPair, follow, followed_craft, refuse_thrust
from flyaround.simulator.world.orbit.gravity import Gravity
from flyaround.simulator.world.orbit.propagation import elements_from_state, propagate
from flyaround.simulator.world.relative.clohessy_wiltshire import mean_motion_rad_s

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.world.attitude.reaction_wheels import Wheels
    from flyaround.simulator.world.attitude.rigid_body import AttitudeTrack
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.guidance.chaser import Chaser
    from flyaround.simulator.world.orbit.burns import Burn
    from flyaround.simulator.world.orbit.followed import Ephemeris
    from flyaround.simulator.world.orbit.forces import ForceModel
    from flyaround.simulator.world.time.instant import Instant


@dataclass(frozen=True, kw_only=True)
class TargetStart:
    """The target at the start of a flight.

    Parameters
    ----------
    r_eci_m : array_like
        (3,) position of the centre of mass relative to the central body, GCRS axes [m].
    v_eci_m_s : array_like
        (3,) velocity of the same [m s-1].
    attitude : Attitude
        Attitude at the start and from then on.
    inertia_kg_m2 : array_like
        (3, 3), body axes, unless ``attitude`` has its own.
    history : AttitudeTrack, optional
        Attitude from a file, which replaces the propagation by ``attitude``.
    ephemeris : Ephemeris, optional
        Orbit to follow instead of propagating ``r_eci_m`` and ``v_eci_m_s``.
    """

    r_eci_m: ArrayLike
    v_eci_m_s: ArrayLike
    attitude: Attitude
    inertia_kg_m2: ArrayLike
    history: AttitudeTrack | None = None
    ephemeris: Ephemeris | None = None


def propagate_flight(
    target: TargetStart,
    chaser: Chaser,
    *,
    epoch: Instant,
    duration_s: float,
    forces: ForceModel | None = None,
    body: Body = EARTH,
    burns: tuple[Burn, ...] = (),
    chaser_ephemeris: Ephemeris | None = None,
) -> Flight:
    """Propagate target orbit, tumble and chaser.

    Parameters
    ----------
    target : TargetStart
        Initial state of the target.
    chaser : Chaser
        The chaser, with its mode.
    epoch : Instant
        Start of the flight.
    duration_s : float
        Length of the flight.
    forces : ForceModel, optional
        Forces on both craft; by default the plain gravity of the body, a point mass with J2.
    body : Body, optional
        Central body.
    burns : tuple of Burn, optional
        Burns of both craft; the chaser's must be for free flight.
    chaser_ephemeris : Ephemeris, optional
        Ephemeris that the chaser follows; its mode is then `FollowedChaser`.

    Returns
    -------
    Flight
        States of both craft over the span.

    Raises
    ------
    UserError
        If the propagation fails, as in `propagate`, or the target's ephemeris has a burn and the chaser flies freely,
        by thrusters or by a script.
    """
    r, v = np.asarray(target.r_eci_m, float), np.asarray(target.v_eci_m_s, float)
    if forces is None:
        forces = Gravity.from_body(body, epoch)
    frame = lvlh_frame(r, v, forces.target(0.0, r, v))
    mu = forces.mu_m3_s2
    elements = elements_from_state(r, v, mu)
    n = mean_motion_rad_s(elements.semi_major_axis_m, mu)
    start = None
    if chaser.ballistic and chaser_ephemeris is None:
        start = frame.to_eci(*chaser.start_lvlh(elements, mu))
    if target.ephemeris is None:
        orbit = propagate(r, v, duration_s, forces, start, burns)
    else:
        followed = followed_craft(target.ephemeris, duration_s, forces)
        if chaser.acting_thrusters or isinstance(chaser, CommandScript):
            refuse_thrust(followed, duration_s, forces)
        orbit = follow(followed, duration_s, forces, start, burns)
    if chaser_ephemeris is not None:
        chaser_track = followed_craft(chaser_ephemeris, duration_s, forces)
        orbit = replace(orbit, solution=CraftPair(orbit.solution, chaser=chaser_track))
    q0 = quat_normalize(target.attitude.q_eci_from_target_wxyz(frame))
    thrusters = chaser.acting_thrusters
    flight = Flight(
        epoch=epoch,
        duration_s=duration_s,
        orbit=orbit,
        # replaced below, because the target may point at the chaser
        attitude=SteadyTrack(q0, np.zeros(3)),
        guidance=chaser,
        n_rad_s=n,
        pointing=chaser.pointing,
        controlled=fly_controlled(orbit, chaser, n, thrusters, chaser.keep_out) if thrusters else None,
        scripted=fly_script(orbit, chaser, n) if isinstance(chaser, CommandScript) else None,
        body=body,
        burns=burns,
    )
    context = PointingContext(
        orbit=orbit,
        body=body,
        epoch=epoch,
        duration_s=duration_s,
        relative=flight.relative,
    )
    track = target.history
    if track is None:
        track = target.attitude.track(q0, target.inertia_kg_m2, context)
    flight = replace(flight, attitude=track)
    # a script's thrust is along the camera's axes, which must stay as flown
    if chaser.pointing.down == "auto" and flight.scripted is None:
        flight = with_best_down(flight)
    return with_wheels(flight, chaser.wheels)


def with_wheels(flight: Flight, wheels: Wheels | None) -> Flight:
    """Return the flight with its camera rotated by reaction wheels; unchanged if ``wheels`` is None."""
    if wheels is None:
        return flight
    return replace(flight, wheels=fly_wheels(flight.pointing_reference, flight.duration_s, wheels))


def with_best_down(flight: Flight, samples: int = 61) -> Flight:
    """Choose the reference of the image's down side.

    Returns
    -------
    Flight
        The flight with the first reference that stays 10 degrees away from the boresight during the flight, or else the
        one that stays farthest away.
    """
    boresights = []
    for t in np.linspace(0.0, flight.duration_s, samples):
        frame = flight.lvlh(float(t))
        p, _ = flight.relative(float(t), frame)
        boresights.append(frame.R_eci_from_lvlh.T @ p / np.linalg.norm(p))
    sines = {
        name: min(float(np.linalg.norm(np.cross(axis, b))) for b in boresights)
        for name, axis in DOWN_AXES_LVLH.items()
    }
    clear = [name for name, sine in sines.items() if sine > np.sin(np.radians(10))]
    down = clear[0] if clear else max(sines, key=lambda name: sines[name])
    return replace(flight, pointing=msgspec.structs.replace(flight.pointing, down=down))
