"""A propagated flight: target, tumble, chaser and sky at any moment of its span."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from simulator.arrays import Quat, quat, vec3
from simulator.world.attitude import AttitudeTrack, propagate_attitude, torque_on
from simulator.world.bodies import EARTH, Body
from simulator.world.clohessy_wiltshire import mean_motion_rad_s
from simulator.world.controlled import ControlledTrack, fly_controlled
from simulator.world.earth_orientation import pole_eci, q_itrs_from_eci
from simulator.world.eclipse import sun_fraction_past_both
from simulator.world.ephemeris import moon_eci_m, sun_eci_m
from simulator.world.gravity import Gravity
from simulator.world.guidance import Guidance
from simulator.world.lvlh import Lvlh, lvlh_frame
from simulator.world.moon import q_moon_from_eci
from simulator.world.orbit import OrbitTrack, elements_from_state, propagate
from simulator.world.pointing import DOWN_AXES_LVLH, Pointing
from simulator.world.rotation import quat_normalize
from simulator.world.state import WorldState
from simulator.world.steer import ChaserState
from simulator.world.time import Instant

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from numpy.typing import ArrayLike

    from simulator.arrays import FloatArray
    from simulator.world.forces import Forces
    from simulator.world.recording import Recording
    from simulator.world.safety import KeepOut
    from simulator.world.thrusters import Thrusters

_EDGE_S = 1e-6
"""Times this far outside the span are taken for rounding."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flight:
    """A flight over ``0 <= t_s <= duration_s``; every state depends on the inputs alone.

    Parameters
    ----------
    epoch : the start. duration_s : length [s].
    orbit, attitude : the target's propagated tracks; the orbit's is from the centre of ``body``.
    guidance : how the chaser moves. n_rad_s : the target's mean motion at the start.
    pointing : how the camera looks.
    controlled : the chaser's track when it flies by thrusters. recording : what is played back instead.
    """

    epoch: Instant
    duration_s: float
    orbit: OrbitTrack
    attitude: AttitudeTrack
    guidance: Guidance
    n_rad_s: float
    pointing: Pointing
    controlled: ControlledTrack | None = None
    recording: Recording | None = None
    body: Body = EARTH

    def lvlh(self, t_s: float) -> Lvlh:
        """The target's LVLH frame."""
        return lvlh_frame(*self.orbit(t_s), self.orbit.acceleration(t_s))

    def chaser(self, t_s: float) -> ChaserState:
        """The chaser as its guidance and pointing have it; the start for steering by hand."""
        self._check(t_s)
        if self.recording is not None:
            return self.recording.chaser(t_s)
        frame = self.lvlh(t_s)
        p, v = self.relative(t_s, frame)
        q, omega = self.pointing.attitude(-p, -v, frame)
        return ChaserState(
            t_s=t_s,
            position_eci_m=vec3(p),
            velocity_eci_m_s=vec3(v),
            q_camera_from_eci_wxyz=quat(q),
            omega_camera_rad_s=vec3(omega),
        )

    def state(self, t_s: float) -> WorldState:
        """The world at ``t_s`` seconds after the start.

        Raises
        ------
        ValueError
            If ``t_s`` is outside the flight.
        """
        return self.state_with_chaser(self.chaser(t_s))

    def state_with_chaser(self, chaser: ChaserState) -> WorldState:
        """The world at ``chaser.t_s`` with the chaser where it says, for example steered by hand.

        Raises
        ------
        ValueError
            If the time is outside the flight.
        """
        t_s = chaser.t_s
        self._check(t_s)
        now = self.epoch.plus(t_s)
        r, v, r_body = self._target(now, t_s)
        q_target, omega_target = self.attitude(t_s)
        p, p_rate = np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        p_lvlh, v_lvlh = self.lvlh(t_s).from_eci(p, p_rate)
        sun = sun_eci_m(now.tt1, now.tt2)
        moon = moon_eci_m(now.tt1, now.tt2) if self.body is EARTH else r_body
        return WorldState(
            epoch_utc=now.iso(),
            t_s=float(t_s),
            r_target_eci_m=vec3(r),
            v_target_eci_m_s=vec3(v),
            q_eci_from_target_wxyz=quat(q_target),
            omega_target_rad_s=vec3(omega_target),
            r_chaser_eci_m=vec3(r + p),
            v_chaser_eci_m_s=vec3(v + p_rate),
            q_camera_from_eci_wxyz=chaser.q_camera_from_eci_wxyz,
            omega_camera_rad_s=chaser.omega_camera_rad_s,
            relative_eci_m=chaser.position_eci_m,
            relative_eci_m_s=chaser.velocity_eci_m_s,
            position_lvlh_m=vec3(p_lvlh),
            velocity_lvlh_m_s=vec3(v_lvlh),
            r_sun_eci_m=vec3(sun),
            r_moon_eci_m=vec3(moon),
            q_itrs_from_eci_wxyz=quat(q_itrs_from_eci(now)),
            q_moon_from_eci_wxyz=quat(q_moon_from_eci(now)),
            sun_visible_fraction=sun_fraction_past_both(r, sun, moon),
            central_body=self.body.name,
        )

    def _target(self, now: Instant, t_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Geocentric position and velocity of the target, and position of the body it circles."""
        r_body, v_body = self.body.geocentric_state(now)
        if self.recording is not None:
            # as recorded, to the last bit
            y = self.recording.target(t_s)
            return y[:3], y[3:], r_body
        r, v = self.orbit(t_s)
        return r_body + r, v_body + v, r_body

    def relative(self, t_s: float, frame: Lvlh) -> tuple[FloatArray, FloatArray]:
        """Chaser minus target along GCRS axes [m], [m s-1]; ``frame`` is `lvlh` at that time."""
        if self.recording is not None:
            chaser = self.recording.chaser(t_s)
            return np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        if self.controlled is not None:
            return self.controlled(t_s)
        if self.guidance.ballistic:
            return self.orbit.relative(t_s)
        return frame.to_eci(*self.guidance.state_lvlh(t_s, self.n_rad_s))

    def _check(self, t_s: float) -> None:
        if not -_EDGE_S <= t_s <= self.duration_s + _EDGE_S:
            raise ValueError(f"t = {t_s} s is outside the flight of {self.duration_s} s")


def propagate_flight(
    *,
    epoch: Instant,
    duration_s: float,
    r_target_eci_m: ArrayLike,
    v_target_eci_m_s: ArrayLike,
    attitude: Callable[[Lvlh], FloatArray] | Quat,
    omega_target_rad_s: ArrayLike,
    inertia_kg_m2: ArrayLike,
    guidance: Guidance,
    pointing: Pointing,
    choose_down: bool = False,
    forces: Forces | None = None,
    body: Body = EARTH,
    torque_body_nm: ArrayLike = (0.0, 0.0, 0.0),
    gravity_gradient: bool = False,
    thrusters: Thrusters | None = None,
    keep_out: KeepOut | None = None,
) -> Flight:
    """Propagate target orbit, tumble and chaser.

    Parameters
    ----------
    epoch, duration_s : start and length.
    r_target_eci_m, v_target_eci_m_s : target's centre of mass at the start from the centre of ``body``, GCRS axes.
    attitude : ``q_eci_from_target_wxyz`` at the start, or a function that gives it from the LVLH frame there.
    omega_target_rad_s : (3,) rate relative to ECI, target axes.
    inertia_kg_m2 : (3, 3) of the target about its centre of mass, target axes.
    guidance : motion of the chaser.
    pointing : of the camera.
    choose_down : replace the pointing's ``down`` by the reference that suits this flight (`with_best_down`).
    torque_body_nm, gravity_gradient : what turns the target: a torque fixed in its axes, the Earth's gravity.
    thrusters, keep_out : of a chaser that flies by thrusters; else a path is followed exactly.
    forces : on both craft; a point mass with J2 unless given.
    body : what they circle; with the Moon the forces must be given.
    """
    r, v = np.asarray(r_target_eci_m, float), np.asarray(v_target_eci_m_s, float)
    if forces is None:
        forces = Gravity(pole_eci=vec3(pole_eci(epoch)))
    frame = lvlh_frame(r, v, forces.target(0.0, r, v))
    mu = forces.mu_m3_s2
    n = mean_motion_rad_s(elements_from_state(r, v, mu).semi_major_axis_m, mu)
    start = frame.to_eci(*guidance.state_lvlh(0.0, n)) if guidance.ballistic else None
    orbit = propagate(r, v, duration_s, forces, start)
    q0 = attitude(frame) if callable(attitude) else np.asarray(attitude, float)
    torque = torque_on(orbit, inertia_kg_m2, torque_body_nm, gravity_gradient=gravity_gradient)
    tumble = propagate_attitude(quat_normalize(q0), omega_target_rad_s, inertia_kg_m2, duration_s, torque)
    flight = Flight(
        epoch=epoch,
        duration_s=duration_s,
        orbit=orbit,
        attitude=tumble,
        guidance=guidance,
        n_rad_s=n,
        pointing=pointing,
        controlled=fly_controlled(orbit, guidance, n, thrusters, keep_out) if thrusters else None,
        body=body,
    )
    return with_best_down(flight) if choose_down else flight


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


_VECTORS = (
    "r_target_eci_m",
    "v_target_eci_m_s",
    "r_chaser_eci_m",
    "v_chaser_eci_m_s",
    "position_lvlh_m",
    "velocity_lvlh_m_s",
    "omega_target_rad_s",
    "omega_camera_rad_s",
)
_QUATERNIONS = ("q_eci_from_target_wxyz", "q_camera_from_eci_wxyz", "q_itrs_from_eci_wxyz")


def fly_table(flight: Flight, times_s: Iterable[float]) -> list[dict[str, str | float]]:
    """States as rows for a table; a vector ``r_target_eci_m`` becomes ``r_target_eci_x_m`` and so on."""
    rows = []
    for t in times_s:
        state = flight.state(float(t))
        row: dict[str, str | float] = {"epoch_utc": state.epoch_utc, "t_s": state.t_s}
        for name in _VECTORS:
            quantity, unit = _split_unit(name)
            row |= {
                f"{quantity}_{axis}_{unit}": x for axis, x in zip("xyz", getattr(state, name), strict=True)
            }
        for name in _QUATERNIONS:
            quantity = name.removesuffix("_wxyz")
            row |= {f"{quantity}_{axis}": x for axis, x in zip("wxyz", getattr(state, name), strict=True)}
        row |= {"range_m": state.range_m, "sun_visible_fraction": state.sun_visible_fraction}
        rows.append(row)
    return rows


def _split_unit(name: str) -> tuple[str, str]:
    """``v_target_eci_m_s`` as quantity and unit."""
    unit = next(u for u in ("rad_s", "m_s", "m") if name.endswith(f"_{u}"))
    return name.removesuffix(f"_{unit}"), unit
