"""Putting a flight together: target orbit, tumble, chaser and its camera, propagated one after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.runtime.arrays import Quat, vec3
from simulator.world.attitude.directions import Surroundings
from simulator.world.attitude.pointing import DOWN_AXES_LVLH
from simulator.world.attitude.reaction_wheels import fly_wheels
from simulator.world.attitude.target_attitude import SteadyTrack, TargetMotion
from simulator.world.ephemeris.bodies import EARTH, Body
from simulator.world.ephemeris.earth_orientation import pole_eci
from simulator.world.flight.flight import Flight
from simulator.world.frames.lvlh import lvlh_frame
from simulator.world.frames.rotation import quat_normalize
from simulator.world.guidance.command_script import Steered, fly_script
from simulator.world.guidance.thruster_control import fly_controlled
from simulator.world.orbit.gravity import Gravity
from simulator.world.orbit.propagation import elements_from_state, propagate
from simulator.world.relative.clohessy_wiltshire import mean_motion_rad_s

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

    from simulator.runtime.arrays import FloatArray
    from simulator.world.attitude.pointing import Pointing
    from simulator.world.attitude.reaction_wheels import Wheels
    from simulator.world.frames.lvlh import Lvlh
    from simulator.world.guidance.keep_out import KeepOut
    from simulator.world.guidance.modes import Guidance
    from simulator.world.guidance.thrusters import Thrusters
    from simulator.world.orbit.burns import Burn
    from simulator.world.orbit.forces import Forces
    from simulator.world.time.instant import Instant


@dataclass(frozen=True, kw_only=True)
class TargetStart:
    """The target at the start of a flight.

    Parameters
    ----------
    r_eci_m, v_eci_m_s : (3,) centre of mass from the centre of the body it circles, GCRS axes.
    attitude : ``q_eci_from_target_wxyz``, or a function that gives it from the LVLH frame at the start.
    motion : how it turns from there.
    """

    r_eci_m: ArrayLike
    v_eci_m_s: ArrayLike
    attitude: Callable[[Lvlh], FloatArray] | Quat
    motion: TargetMotion


@dataclass(frozen=True, kw_only=True)
class ChaserPlan:
    """How the chaser flies and its camera turns.

    Parameters
    ----------
    guidance : motion of the chaser.
    pointing : of the camera.
    choose_down : replace the pointing's ``down`` by the reference that suits this flight (`with_best_down`).
    thrusters, keep_out : of a chaser that flies by thrusters; else a path is followed exactly.
    wheels : that turn the camera; else its pointing is followed exactly.
    """

    guidance: Guidance
    pointing: Pointing
    choose_down: bool = False
    thrusters: Thrusters | None = None
    keep_out: KeepOut | None = None
    wheels: Wheels | None = None


def propagate_flight(
    target: TargetStart,
    chaser: ChaserPlan,
    *,
    epoch: Instant,
    duration_s: float,
    forces: Forces | None = None,
    body: Body = EARTH,
    burns: tuple[Burn, ...] = (),
) -> Flight:
    """Propagate target orbit, tumble and chaser.

    Parameters
    ----------
    epoch, duration_s : start and length.
    forces : on both craft; a point mass with J2 unless given.
    body : what they circle; with the Moon the forces must be given.
    burns : of both craft; the chaser's are for one in free flight.
    """
    guidance, pointing = chaser.guidance, chaser.pointing
    r, v = np.asarray(target.r_eci_m, float), np.asarray(target.v_eci_m_s, float)
    if forces is None:
        forces = Gravity(pole_eci=vec3(pole_eci(epoch)))
    frame = lvlh_frame(r, v, forces.target(0.0, r, v))
    mu = forces.mu_m3_s2
    n = mean_motion_rad_s(elements_from_state(r, v, mu).semi_major_axis_m, mu)
    start = frame.to_eci(*guidance.state_lvlh(0.0, n)) if guidance.ballistic else None
    orbit = propagate(r, v, duration_s, forces, start, burns)
    attitude = target.attitude
    q0 = quat_normalize(attitude(frame) if callable(attitude) else np.asarray(attitude, float))
    scripted = isinstance(guidance, Steered)
    flight = Flight(
        epoch=epoch,
        duration_s=duration_s,
        orbit=orbit,
        # a stand-in: what the target points at may be the chaser
        attitude=SteadyTrack(q0, np.zeros(3)),
        guidance=guidance,
        n_rad_s=n,
        pointing=pointing,
        controlled=fly_controlled(orbit, guidance, n, chaser.thrusters, chaser.keep_out)
        if chaser.thrusters
        else None,
        steered=fly_script(orbit, guidance, n, pointing, chaser.keep_out)
        if isinstance(guidance, Steered)
        else None,
        body=body,
        burns=burns,
    )
    around = Surroundings(
        orbit=orbit,
        body=body,
        epoch=epoch,
        duration_s=duration_s,
        relative=flight.apart,
    )
    flight = replace(flight, attitude=target.motion.track(q0, around))
    # the thrust of a script follows the camera's axes, which must stay as they were flown
    flight = with_best_down(flight) if chaser.choose_down and not scripted else flight
    return with_wheels(flight, chaser.wheels)


def with_wheels(flight: Flight, wheels: Wheels | None) -> Flight:
    """The flight with its camera turned by wheels after the pointing, or as it is."""
    if wheels is None:
        return flight
    return replace(flight, wheels=fly_wheels(flight.looking, flight.duration_s, wheels))


def with_best_down(flight: Flight, samples: int = 61) -> Flight:
    """The flight with the first down reference that stays 10 deg off the boresight, or else the best one."""
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
    return replace(flight, pointing=replace(flight.pointing, down=down))
