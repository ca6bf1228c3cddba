"""A propagated flight: target, chaser, Sun and Moon at any time of its span."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.world.bodies.earth import EARTH
from flyaround.simulator.world.ephemeris.body import bodies_at
from flyaround.simulator.world.ephemeris.eclipse import sun_fraction_past_bodies
from flyaround.simulator.world.ephemeris.sun_moon import sun_eci_m
from flyaround.simulator.world.flight.recording import Recording
from flyaround.simulator.world.flight.world_state import WorldState
from flyaround.simulator.world.frames.lvlh import Lvlh, lvlh_frame
from flyaround.simulator.world.guidance.manual_control import ChaserState

if TYPE_CHECKING:
    from collections.abc import Iterable

    from flyaround.simulator.runtime.arrays import FloatArray, Vec3
    from flyaround.simulator.world.attitude.pointing import Pointing
    from flyaround.simulator.world.attitude.reaction_wheels import WheelTrack
    from flyaround.simulator.world.attitude.rigid_body import AttitudeTrack
    from flyaround.simulator.world.ephemeris.body import Body
    from flyaround.simulator.world.guidance.chaser import Chaser
    from flyaround.simulator.world.guidance.command_script import ScriptedTrack
    from flyaround.simulator.world.guidance.thruster_control import ControlledTrack
    from flyaround.simulator.world.orbit.burns import Burn
    from flyaround.simulator.world.orbit.propagation import OrbitTrack
    from flyaround.simulator.world.time.instant import Instant

_EDGE_S = 1e-6
"""Tolerance outside the span, for rounding [s]."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Flight:
    """A flight over ``0 <= t_s <= duration_s``; every state depends on the inputs alone.

    Parameters
    ----------
    epoch : Instant
        Start of the flight.
    duration_s : float
        Length [s].
    orbit : OrbitTrack
        Orbit of the target relative to the centre of ``body``.
    attitude : AttitudeTrack
        Attitude of the target.
    guidance : Chaser
        Guidance of the chaser.
    n_rad_s : float
        The target's mean motion at the start.
    pointing : Pointing
        Attitude of the camera.
    controlled : ControlledTrack, optional
        The chaser's track if it flies by thrusters.
    scripted : ScriptedTrack, optional
        The chaser's track if it follows a script.
    wheels : WheelTrack, optional
        Attitude of the camera if reaction wheels turn it; by default that of ``pointing``.
    recording : Recording, optional
        Recorded flight to replay instead.
    body : Body, optional
        Central body, by default the Earth.
    burns : tuple of Burn, optional
        Burns of both craft, already included in the orbits.
    approach_axis_lvlh : tuple of float, optional
        Axis of approach of a recorded flight, by default that of ``guidance``.
    """

    epoch: Instant
    duration_s: float
    orbit: OrbitTrack
    attitude: AttitudeTrack
    guidance: Chaser
    n_rad_s: float
    pointing: Pointing
    controlled: ControlledTrack | None = None
    scripted: ScriptedTrack | None = None
    wheels: WheelTrack | None = None
    recording: Recording | None = None
    body: Body = EARTH
    burns: tuple[Burn, ...] = ()
    approach_axis_lvlh: Vec3 | None = None

    def lvlh(self, t_s: float) -> Lvlh:
        """Return the target's LVLH frame.

        Returns
        -------
        Lvlh
            Frame with the rate that belongs to the modelled forces and burns at ``t_s`` [rad s-1].
        """
        return lvlh_frame(*self.orbit(t_s), self.orbit.acceleration(t_s))

    def chaser(self, t_s: float) -> ChaserState:
        """Return the chaser under its guidance and pointing.

        Returns
        -------
        ChaserState
            State relative to the target at ``t_s``, GCRS axes: that of the recording or the script if there is one.
            Manual control does not change it.

        Raises
        ------
        ValueError
            If ``t_s`` is outside the flight.
        """
        self._check(t_s)
        if self.recording is not None:
            return self.recording.chaser(t_s)
        frame = self.lvlh(t_s)
        p, v = self.relative(t_s, frame)
        if self.scripted is not None and not self.scripted.script.tracking:
            return self.scripted(t_s)
        q, omega = self.wheels(t_s) if self.wheels else self.pointing.attitude(-p, -v, frame)
        return ChaserState(
            t_s=t_s,
            position_eci_m=vec3(p),
            velocity_eci_m_s=vec3(v),
            q_camera_from_eci_wxyz=quat(q),
            omega_camera_rad_s=vec3(omega),
        )

    def state(self, t_s: float) -> WorldState:
        """Return the world at ``t_s`` seconds after the start.

        Returns
        -------
        WorldState
            Both craft, bodies and Sun, GCRS axes, with the chaser of `chaser`.

        Raises
        ------
        ValueError
            If ``t_s`` is outside the flight.
        """
        return self.state_with_chaser(self.chaser(t_s))

    def state_with_chaser(self, chaser: ChaserState) -> WorldState:
        """Return the world at ``chaser.t_s`` with a given chaser state, for example under manual control.

        Returns
        -------
        WorldState
            The flight's target, bodies and Sun at that time, GCRS axes, with the given chaser.

        Raises
        ------
        ValueError
            If the time is outside the flight.
        """
        t_s = chaser.t_s
        self._check(t_s)
        instant = self.epoch.plus(t_s)
        r, v = self._target(instant, t_s)
        q_target, omega_target = self.attitude(t_s)
        p, p_rate = np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        p_lvlh, v_lvlh = self.lvlh(t_s).from_eci(p, p_rate)
        sun, bodies = sun_eci_m(instant.tt1, instant.tt2), bodies_at(instant, self.body)
        return WorldState(
            epoch_utc=instant.iso(),
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
            bodies=bodies,
            sun_visible_fraction=sun_fraction_past_bodies(bodies, r, sun),
            central_body=self.body.name,
        )

    def recorded_row(self, chaser: ChaserState) -> list[float]:
        """Return the row of a recording for a chaser's state.

        This is several times faster than `state_with_chaser` and `state_row`, which give the same values.

        Returns
        -------
        list of float
            The `NUMBERS` values of a row in the order of `csv_header`, GCRS axes [m], [m s-1], [rad s-1].

        Raises
        ------
        ValueError
            If the time is outside the flight.
        """
        self._check(chaser.t_s)
        r, v = self._target(self.epoch.plus(chaser.t_s), chaser.t_s)
        q_target, omega_target = self.attitude(chaser.t_s)
        numbers = (vec3(r), vec3(v), quat(q_target), vec3(omega_target))
        camera = chaser.q_camera_from_eci_wxyz, chaser.omega_camera_rad_s
        return list(chain((chaser.t_s,), *numbers, chaser.position_eci_m, chaser.velocity_eci_m_s, *camera))

    def _target(self, instant: Instant, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the geocentric position and velocity of the target."""
        if self.recording is not None:
            # exactly as recorded
            y = self.recording.target(t_s)
            return y[:3], y[3:]
        r, v = self.orbit(t_s)
        r_body, v_body = self.body.geocentric_state(instant)
        return r_body + r, v_body + v

    def relative(self, t_s: float, frame: Lvlh | None = None) -> tuple[FloatArray, FloatArray]:
        """Return the chaser minus target along GCRS axes [m], [m s-1].

        Parameters
        ----------
        t_s : float
            Time since the start [s].
        frame : Lvlh, optional
            Result of `lvlh` at that time, if known; by default the track's approximation.

        Returns
        -------
        tuple of array
            Position (3,) [m] and velocity (3,) [m s-1].
        """
        playback = self.recording.chaser if self.recording else self.scripted
        if playback is not None:
            chaser = playback(t_s)
            return np.array(chaser.position_eci_m), np.array(chaser.velocity_eci_m_s)
        if self.controlled is not None:
            return self.controlled(t_s)
        if self.guidance.ballistic:
            return self.orbit.relative(t_s)
        return (frame or self.orbit.frame(t_s)).to_eci(*self.guidance.state_lvlh(t_s, self.n_rad_s))

    def pointing_reference(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Compute the attitude that the camera's pointing prescribes, faster than `chaser`.

        Returns
        -------
        q_camera_from_eci_wxyz : (4,) array
            Unit quaternion, scalar first.
        omega_camera_rad_s : (3,) array
            Rate relative to ECI, camera axes [rad s-1].
        """
        frame = self.orbit.frame(t_s)
        p, v = self.relative(t_s, frame)
        return self.pointing.attitude(-p, -v, frame)

    def _check(self, t_s: float) -> None:
        if not -_EDGE_S <= t_s <= self.duration_s + _EDGE_S:
            raise ValueError(f"t = {t_s} s is outside the flight of {self.duration_s} s")


def record(flight: Flight, times_s: Iterable[float]) -> Recording:
    """Sample a flight.

    Returns
    -------
    Recording
        One sample for each of ``times_s``, in their order. `Recording.read` accepts its file if there are at least
        two times, the first is 0 and they increase.
    """
    return Recording.from_states(flight.state(float(t)) for t in times_s)
