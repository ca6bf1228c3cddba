"""From a scenario's [attitude] section to how the target turns: degrees become radians, files become histories."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.runtime.arrays import vec3
from simulator.scenario.messages import read_message
from simulator.world.attitude.rigid_body import check_inertia
from simulator.world.attitude.target_attitude import Fixed, History, Pointed, Spin, TargetMotion, Tumble
from simulator.world.attitude.torques import Torques
from simulator.world.frames.rotation import quat_from_matrix, quat_from_rotvec, quat_multiply, quat_normalize
from simulator.world.messages.aem import read_aem_history

if TYPE_CHECKING:
    from simulator.runtime.arrays import FloatArray
    from simulator.scenario import motion as sm
    from simulator.world.ephemeris.bodies import Body
    from simulator.world.frames.lvlh import Lvlh
    from simulator.world.time.instant import Instant

_PARALLEL = 1e-3


def target_motion(a: sm.Attitude, inertia_kg_m2: object, epoch: Instant, duration_s: float) -> TargetMotion:
    """How the target turns.

    Parameters
    ----------
    a : the section. inertia_kg_m2 : (3, 3) of the target's model, unless the section has its own.
    epoch, duration_s : of the flight, for a file.
    """
    if a.motion == "spin":
        rate = np.radians(a.rate_deg_s)
        return Spin(axis_body=vec3(rate), rate_rad_s=float(np.linalg.norm(rate)))
    if a.motion == "fixed":
        return Fixed(frame=a.frame)
    if a.motion == "point" and a.point is not None:
        return Pointed(
            axis_body=a.point.axis,
            at=a.point.at,
            second_axis_body=a.point.second_axis,
            second_at=a.point.second_at,
        )
    if a.motion == "aem" and a.aem_file is not None:
        text = read_message(a.aem_file, "attitude.aem_file", Path())
        return History(read_aem_history(text, a.aem_file, epoch, duration_s))
    return Tumble(
        omega_rad_s=np.radians(a.rate_deg_s),
        inertia_kg_m2=np.asarray(a.inertia_kg_m2 or inertia_kg_m2, float),
        torques=Torques(
            constant_nm=a.torque_body_nm,
            gravity_gradient=a.gravity_gradient,
            residual_dipole_a_m2=a.residual_dipole_a_m2,
        ),
    )


def check_attitude(a: sm.Attitude, body: Body, where: str) -> None:
    """Refuse an attitude given twice or not at all, and what does not go with the motion.

    Raises
    ------
    UserError
        With file, key, value and what is allowed.
    """
    if a.q_wxyz is not None and a.euler_deg is not None:
        raise UserError(f"{where}: section [attitude] has both q_wxyz and euler_deg, allowed: one of them")
    if a.q_wxyz is not None:
        norm = float(np.linalg.norm(a.q_wxyz))
        if abs(norm - 1) > 1e-3:
            raise UserError(
                f"{where}: key attitude.q_wxyz is {list(a.q_wxyz)} with norm {norm:.6g}, "
                "allowed: a unit quaternion, scalar first"
            )
    if a.inertia_kg_m2 is not None:
        try:
            check_inertia(np.array(a.inertia_kg_m2))
        except ValueError as error:
            raise UserError(f"{where}: key attitude.inertia_kg_m2: {error}") from error
    if body.name == "moon" and any(a.residual_dipole_a_m2):
        raise UserError(
            f"{where}: key attitude.residual_dipole_a_m2 needs the Earth's field, and this orbit is about the Moon: "
            "remove the key"
        )
    _check_motion(a, where)


def _check_motion(a: sm.Attitude, where: str) -> None:
    torques = any((*a.torque_body_nm, *a.residual_dipole_a_m2)) or a.gravity_gradient
    if a.motion != "tumble" and torques:
        raise UserError(
            f"{where}: section [attitude] has a torque, but attitude.motion is {a.motion}: remove it, or choose tumble"
        )
    if a.motion == "spin" and not any(a.rate_deg_s):
        raise UserError(
            f"{where}: key attitude.rate_deg_s is [0, 0, 0], allowed: the rate and axis of the spin"
        )
    if a.motion in {"fixed", "point", "aem"} and any(a.rate_deg_s):
        raise UserError(
            f"{where}: key attitude.rate_deg_s is given, but attitude.motion is {a.motion}: remove one of them"
        )
    if (a.motion == "aem") != (a.aem_file is not None):
        raise UserError(
            f"{where}: attitude.motion is {a.motion}, which goes with key attitude.aem_file and no other: give the file"
        )
    if (a.motion == "point") != (a.point is not None):
        raise UserError(
            f"{where}: attitude.motion is {a.motion}, but section [attitude.point] goes with motion point alone"
        )
    if a.point is not None:
        _check_point(a.point, where)


def _check_point(p: sm.Point, where: str) -> None:
    axes = np.array(p.axis, float), np.array(p.second_axis, float)
    sizes = [float(np.linalg.norm(x)) for x in axes]
    if min(sizes) == 0 or float(np.linalg.norm(np.cross(*axes))) < _PARALLEL * sizes[0] * sizes[1]:
        raise UserError(
            f"{where}: attitude.point.axis {list(p.axis)} and second_axis {list(p.second_axis)} must be two "
            "directions apart from each other"
        )
    if p.at == p.second_at or {p.at, p.second_at} == {"nadir", "zenith"}:
        raise UserError(
            f"{where}: attitude.point.at and second_at are {p.at} and {p.second_at}, allowed: two different directions"
        )


def q_eci_from_target(a: sm.Attitude, frame: Lvlh) -> FloatArray:
    """The target's attitude at the epoch, from a section whose AEM has been read."""
    q = np.array([1.0, 0.0, 0.0, 0.0])
    if a.q_wxyz is not None:
        q = quat_normalize(a.q_wxyz)
    elif a.euler_deg is not None:
        yaw, pitch, roll = np.radians(a.euler_deg)
        about_z, about_y = quat_from_rotvec([0.0, 0.0, yaw]), quat_from_rotvec([0.0, pitch, 0.0])
        q = quat_multiply(quat_multiply(about_z, about_y), quat_from_rotvec([roll, 0.0, 0.0]))
    if a.frame == "lvlh":
        q = quat_multiply(quat_from_matrix(frame.R_eci_from_lvlh), q)
    return q
