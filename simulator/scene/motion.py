"""Motion during an exposure: a scene propagated by its own rates to a nearby time."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
)
from flyaround.simulator.world.time.instant import Instant

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.world.ephemeris.body import BodyState


def propagated_scene(scene: SceneState, dt_s: float) -> SceneState:
    """Return the scene ``dt_s`` seconds from its mid-exposure.

    Rotation rates are constant; both craft fall freely. In low orbit, over a second, the error for a tumbling craft is
    quadratic in its rate and the time: millipixels within exposures.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    dt_s : float
        Time from mid-exposure [s], of either sign.

    Returns
    -------
    SceneState
        The propagated scene; random key and epoch text are unchanged.
    """
    if dt_s == 0.0:
        return scene
    q_ce = np.asarray(scene.q_camera_from_eci_wxyz)
    q_ct = np.asarray(scene.q_camera_from_target_wxyz)
    R_ce, R_ct = matrix_from_quat(q_ce), matrix_from_quat(q_ct)
    omega_camera, omega_target = np.asarray(scene.omega_camera_rad_s), np.asarray(scene.omega_target_rad_s)
    r_camera, v_camera = np.asarray(scene.r_camera_eci_m), np.asarray(scene.v_camera_eci_m_s)
    r_target, v_target = np.asarray(scene.r_target_eci_m), np.asarray(scene.v_target_eci_m_s)
    # the model's origin rotates about the centre of mass
    origin_target = R_ct.T @ (np.asarray(scene.t_camera_from_target_m) - R_ce @ (r_target - r_camera))
    # a frame rotated by w dt about its own axes: coordinates in it rotate by -w dt
    new_q_ce = quat_normalize(quat_multiply(quat_from_rotvec(-omega_camera * dt_s), q_ce))
    q_et = quat_multiply(quat_multiply(quat_conjugate(q_ce), q_ct), quat_from_rotvec(omega_target * dt_s))
    new_q_ct = quat_normalize(quat_multiply(new_q_ce, q_et))
    new_R_ce, new_R_ct = matrix_from_quat(new_q_ce), matrix_from_quat(new_q_ct)
    central = scene.central
    center, mu = np.asarray(central.r_eci_m), central.body.mu_m3_s2
    acceleration_camera, acceleration_target = (_free_fall(r - center, mu) for r in (r_camera, r_target))
    # propagate differences, because adding an orbit's radius and a close range loses nanometres to rounding
    relative = (
        (r_target - r_camera)
        + dt_s * (v_target - v_camera)
        + 0.5 * dt_s**2 * (acceleration_target - acceleration_camera)
    )
    t = new_R_ce @ relative + new_R_ct @ origin_target
    rate = new_R_ce @ (v_target - v_camera) + new_R_ct @ np.cross(omega_target, origin_target)
    return replace(
        scene,
        t_s=scene.t_s + dt_s,
        q_camera_from_target_wxyz=quat(new_q_ct if new_q_ct[0] >= 0 else -new_q_ct),
        t_camera_from_target_m=vec3(t),
        v_target_camera_m_s=vec3(rate - np.cross(omega_camera, t)),
        r_camera_eci_m=vec3(r_camera + dt_s * (v_camera + 0.5 * dt_s * acceleration_camera)),
        v_camera_eci_m_s=vec3(v_camera + dt_s * acceleration_camera),
        q_camera_from_eci_wxyz=quat(new_q_ce),
        r_target_eci_m=vec3(r_target + dt_s * (v_target + 0.5 * dt_s * acceleration_target)),
        v_target_eci_m_s=vec3(v_target + dt_s * acceleration_target),
        bodies=tuple(_propagate_body(state, scene, dt_s) for state in scene.bodies),
    )


def central_velocity_m_s(scene: SceneState) -> FloatArray:
    """Return the velocity of the central body relative to the Earth's centre.

    Returns
    -------
    (3,) array
        Velocity in ECI axes at the scene's epoch [m s-1]; zeros if the Earth is the central body.
    """
    central = scene.central
    # for the Earth it is zero, and parsing the epoch would take longest
    if not any(central.r_eci_m):
        return np.zeros(3)
    return central.body.geocentric_state(Instant.from_utc(scene.epoch_utc))[1]


def _propagate_body(state: BodyState, scene: SceneState, dt_s: float) -> BodyState:
    """Return a body ``dt_s`` later: rotated by its rate and, if it is the central one, moved."""
    r, q = np.asarray(state.r_eci_m), np.asarray(state.q_fixed_from_eci_wxyz)
    if state.name == scene.central_body:
        r = r + dt_s * central_velocity_m_s(scene)
    if state.body.turns:
        q = quat_multiply(quat_from_rotvec(np.array([0.0, 0.0, -state.body.turn_rad_s * dt_s])), q)
    return replace(state, r_eci_m=vec3(r), q_fixed_from_eci_wxyz=quat(q))


def _free_fall(r_m: FloatArray, mu_m3_s2: float) -> FloatArray:
    """Return the acceleration towards a point mass at the origin [m s-2]."""
    return np.asarray(-mu_m3_s2 / np.linalg.norm(r_m) ** 3 * r_m)
