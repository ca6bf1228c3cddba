"""A second camera of the same instant, by its pose in the first one: stereo pairs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

import msgspec
import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import Quat, quat, vec3
from flyaround.simulator.runtime.sections import Section
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_rotvec,
    quat_multiply,
)

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState

_Offset = Annotated[float, msgspec.Meta(ge=-1000, le=1000)]
_Turn = Annotated[float, msgspec.Meta(ge=-180, le=180)]

SECOND_SEED = 1_000_003
"""Offset of the second image's seed, so that its noise is independent of the first one's."""


class SecondCamera(Section, frozen=True, kw_only=True):
    """A second camera of the same type, exposed at the same instants.

    ``position_m`` is its position right of, below and in front of the first; ``turn_deg`` is the rotation vector, in
    the first camera's axes, from those to its own.
    """

    position_m: tuple[_Offset, _Offset, _Offset]
    turn_deg: tuple[_Turn, _Turn, _Turn] = (0.0, 0.0, 0.0)

    @property
    def q_second_from_first_wxyz(self) -> Quat:
        """Rotation from the first camera's axes to the second's."""
        return quat(quat_conjugate(quat_from_rotvec(np.radians(self.turn_deg))))

    def pose(self, q_wxyz: Quat, t_m: tuple[float, float, float]) -> tuple[Quat, tuple[float, float, float]]:
        """Return a target's pose in the second camera from that in the first.

        Returns
        -------
        q_wxyz : tuple of float
            Unit quaternion, target axes to the second camera's, with w >= 0.
        t_m : tuple of float
            Position of the target's origin in the second camera's axes [m].
        """
        q = np.asarray(self.q_second_from_first_wxyz)
        rotated = quat_multiply(q, np.asarray(q_wxyz))
        t = matrix_from_quat(q) @ (np.asarray(t_m) - np.asarray(self.position_m))
        # one sign per attitude, so that labels compare as text
        return quat(rotated if rotated[0] >= 0 else -rotated), vec3(t)


def second_camera_scene(scene: SceneState, second: SecondCamera) -> SceneState:
    """Return the scene at the same instant as seen by the second camera.

    Returns
    -------
    SceneState
        Copy of the scene with the second camera's position, attitude and velocity, the target's pose and the lamp's
        offset in its axes, and another seed, so that its noise is independent.

    Raises
    ------
    UserError
        If a light is fixed to the first camera's axes and its position in the second's is undefined.
    """
    q = np.asarray(second.q_second_from_first_wxyz)
    R = matrix_from_quat(q)
    position, is_rotated = np.asarray(second.position_m), any(second.turn_deg)
    lamp = scene.lamp
    if lamp is not None:
        if is_rotated:
            raise UserError(
                "the lamp shines along the first camera's boresight, and [second_camera] is turned by "
                f"{list(second.turn_deg)}: set turn_deg = [0, 0, 0], or leave the lamp out"
            )
        lamp = msgspec.structs.replace(lamp, offset_m=vec3(np.asarray(lamp.offset_m) - position))
    if any(light.frame != "target" for light in scene.area_lights):
        raise UserError(
            'area lights fixed to the camera have no place in a second one: set frame = "target" in [[lights]], or '
            "leave [second_camera] out"
        )
    R_eci_from_first = matrix_from_quat(scene.q_camera_from_eci_wxyz).T
    arm: FloatArray = R_eci_from_first @ position
    rate: FloatArray = R_eci_from_first @ np.cross(scene.omega_camera_rad_s, position)
    q_target, t_target = second.pose(scene.q_camera_from_target_wxyz, scene.t_camera_from_target_m)
    return replace(
        scene,
        seed=scene.seed + SECOND_SEED,
        lamp=lamp,
        q_camera_from_target_wxyz=q_target,
        t_camera_from_target_m=t_target,
        # the target moves by itself, so the fixed offset does not affect its velocity in camera axes
        v_target_camera_m_s=vec3(R @ np.asarray(scene.v_target_camera_m_s)),
        r_camera_eci_m=vec3(np.asarray(scene.r_camera_eci_m) + arm),
        v_camera_eci_m_s=vec3(np.asarray(scene.v_camera_eci_m_s) + rate),
        q_camera_from_eci_wxyz=quat(quat_multiply(q, np.asarray(scene.q_camera_from_eci_wxyz))),
        omega_camera_rad_s=vec3(R @ np.asarray(scene.omega_camera_rad_s)),
    )
