"""Rigid transforms with named frames. Composing transforms whose frames do not match raises an error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.runtime.arrays import Quat, Vec3, quat, vec3
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_multiply,
    quat_normalize,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True)
class Pose:
    """Rigid transform between two named frames: ``x_to = R_to_from_frm @ x_frm + t_m``.

    >>> target = Pose.from_arrays("camera", "target", (1, 0, 0, 0), (0, 0, 10))
    >>> target
    <Pose camera_from_target, origin at (0, 0, 10) m>
    >>> target @ Pose.from_arrays("target", "panel", (1, 0, 0, 0), (0.5, 0, 0))
    <Pose camera_from_panel, origin at (0.5, 0, 10) m>
    >>> target.inverse().apply((0, 0, 10)).tolist()
    [0.0, 0.0, 0.0]
    >>> target @ target
    Traceback (most recent call last):
    ValueError: cannot compose camera_from_target with camera_from_target: the inner frames differ

    Parameters
    ----------
    to : str
        Frame of the result, for example ``"camera"``.
    frm : str
        Frame of the argument, for example ``"target"``.
    q_wxyz : tuple of float
        Unit quaternion ``q_to_from_frm``, scalar first.
    t_m : tuple of float
        Origin of ``frm`` in ``to`` [m].

    Raises
    ------
    ValueError
        If a value is not finite, or the quaternion not of unit length to three digits.
    """

    to: str
    frm: str
    q_wxyz: Quat
    t_m: Vec3

    def __post_init__(self) -> None:
        # the negated test also refuses NaN
        if not (len(self.q_wxyz) == 4 and abs(sum(c * c for c in self.q_wxyz) - 1) < 2e-3):
            raise ValueError(f"pose {self.to} from {self.frm}: {self.q_wxyz} is not a unit quaternion")
        if not (len(self.t_m) == 3 and all(map(math.isfinite, self.t_m))):
            raise ValueError(f"pose {self.to} from {self.frm}: {self.t_m} is not a position of three numbers")

    @staticmethod
    def from_arrays(to: str, frm: str, q_wxyz: ArrayLike, t_m: ArrayLike) -> Pose:
        """Create a pose from array-likes; the quaternion is normalised.

        Parameters
        ----------
        to : str
            Frame of the result.
        frm : str
            Frame of the argument.
        q_wxyz : array_like
            (4,) quaternion ``q_to_from_frm``, scalar first.
        t_m : array_like
            (3,) origin of ``frm`` in ``to`` [m].

        Returns
        -------
        Pose
            Pose with a unit quaternion.

        Raises
        ------
        ValueError
            If the quaternion is zero, a value is not finite, or a shape differs.
        """
        q, t = np.asarray(q_wxyz, float), np.asarray(t_m, float)
        if q.shape != (4,) or t.shape != (3,):
            raise ValueError(
                f"pose {to} from {frm}: a quaternion of four numbers and a position of three are needed, "
                f"got the shapes {q.shape} and {t.shape}"
            )
        if not np.all(np.isfinite(t)):
            raise ValueError(f"translation {to} from {frm} must be finite, got {t.tolist()}")
        return Pose(to, frm, quat(quat_normalize(q)), vec3(t))

    def __repr__(self) -> str:
        """Return the names of the frames, and the origin of ``frm`` in ``to``."""
        origin = ", ".join(f"{x + 0.0:.6g}" for x in self.t_m)
        return f"<Pose {self.to}_from_{self.frm}, origin at ({origin}) m>"

    @property
    def R(self) -> FloatArray:
        """(3, 3) rotation matrix ``R_to_from_frm``."""
        return matrix_from_quat(self.q_wxyz)

    def apply(self, points_m: ArrayLike) -> FloatArray:
        """Return the points (..., 3) given in ``frm``, expressed in ``to`` [m].

        Returns
        -------
        (..., 3) array
            Points in ``to`` [m].
        """
        return np.asarray(points_m, float) @ self.R.T + np.asarray(self.t_m)

    def inverse(self) -> Pose:
        """Return the pose ``frm`` from ``to``.

        Returns
        -------
        Pose
            Pose whose ``to`` and ``frm`` are exchanged.
        """
        return Pose.from_arrays(
            self.frm, self.to, quat_conjugate(self.q_wxyz), -self.R.T @ np.asarray(self.t_m)
        )

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: ``a_from_c = a_from_b @ b_from_c``.

        Raises
        ------
        ValueError
            If the inner frames differ.
        """
        if self.frm != other.to:
            raise ValueError(
                f"cannot compose {self.to}_from_{self.frm} with {other.to}_from_{other.frm}: the inner frames differ"
            )
        return Pose.from_arrays(
            self.to, other.frm, quat_multiply(self.q_wxyz, other.q_wxyz), self.apply(np.asarray(other.t_m))
        )
