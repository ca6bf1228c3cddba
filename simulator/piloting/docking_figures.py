"""Docking figures: the chaser's position, attitude and motion relative to the port, and their limits at contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from flyaround.simulator.piloting.readouts import SPEED_DECIMALS, speed_text
from flyaround.simulator.runtime.arrays import Vec3, vec3
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from flyaround.simulator.world.frames.vectors import cross

if TYPE_CHECKING:
    from flyaround.simulator.piloting.docking_port import DockingPort
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.guidance.manual_control import ChaserState

State = Literal["within", "near", "outside"]

PROBE_M: Vec3 = (0.0, 0.0, 1.0)
"""The chaser's docking point in camera axes: on the boresight, a metre in front of the camera."""

CAPTURE_M = 0.5
"""Largest distance from the port's centre at which the docking point makes contact in its plane [m]."""

CORRIDOR_DEG = 10.0
"""Half angle of the corridor in front of the port, if the scenario has none [deg]."""

NEAR_LIMIT_FACTOR = 2.0
"""Multiple of the limit up to which a figure counts as near the limit."""


@dataclass(frozen=True, kw_only=True)
class DockingFigures:
    """State of the chaser's docking point relative to the port, and its attitude relative to the docked one.

    Parameters
    ----------
    t_s : float
        Time since the scenario's start.
    axial_m : float
        Distance in front of the port's plane; negative behind it.
    closing_m_s : float
        Rate at which the distance decreases.
    right_m : float
        Lateral offset to the right, as seen from the docked camera.
    down_m : float
        Lateral offset downwards.
    right_m_s : float
        Rate of the offset to the right, in the rotating target frame.
    down_m_s : float
        Rate of the offset downwards.
    roll_deg : float
        Roll relative to the docked attitude, clockwise.
    pitch_deg : float
        Pitch relative to the docked attitude, upwards.
    yaw_deg : float
        Yaw relative to the docked attitude, to the right.
    roll_deg_s : float
        Angular velocity relative to the target about the camera's z axis.
    pitch_deg_s : float
        Angular velocity relative to the target about the camera's x axis.
    yaw_deg_s : float
        Angular velocity relative to the target about the camera's y axis.
    """

    t_s: float
    axial_m: float
    closing_m_s: float
    right_m: float
    down_m: float
    right_m_s: float
    down_m_s: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    roll_deg_s: float
    pitch_deg_s: float
    yaw_deg_s: float

    @property
    def range_m(self) -> float:
        """Distance from the docking point to the centre of the port [m]."""
        return float(np.sqrt(self.axial_m**2 + self.lateral_m**2))

    @property
    def lateral_m(self) -> float:
        """Distance from the axis."""
        return float(np.hypot(self.right_m, self.down_m))

    @property
    def lateral_m_s(self) -> float:
        """Speed across the axis."""
        return float(np.hypot(self.right_m_s, self.down_m_s))

    @property
    def speed_m_s(self) -> float:
        """Magnitude of the velocity."""
        return float(np.hypot(self.closing_m_s, self.lateral_m_s))

    @property
    def R_port_from_camera(self) -> FloatArray:
        """(3, 3) rotation matrix of the three angles."""
        r, p, y = np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg])
        cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
        about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        about_x = np.array([[1, 0, 0], [0, cp, -sp], [0, sp, cp]])
        about_z = np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])
        return np.asarray(about_y @ about_x @ about_z)

    def in_camera_m(self, points_port_m: FloatArray) -> FloatArray:
        """Convert points (N, 3) from the port's axes, origin at its centre, to the camera's.

        Returns
        -------
        (N, 3) array
            Points in camera axes, origin at the camera, in the order given [m].
        """
        R = self.R_port_from_camera
        tip = np.array([self.right_m, self.down_m, -self.axial_m])
        return np.asarray((points_port_m - (tip - R @ np.array(PROBE_M))) @ R)

    @property
    def aimed_at_m(self) -> tuple[float, float] | None:
        """Predicted position of the docking point in the port's plane, right and down; None if it does not approach."""
        # at a millimetre per second the prediction reaches a quarter of an hour ahead at one metre
        if self.closing_m_s < 1e-3 or self.axial_m <= 0:
            return None
        left_s = self.axial_m / self.closing_m_s
        return self.right_m + left_s * self.right_m_s, self.down_m + left_s * self.down_m_s

    @property
    def off_axis_deg(self) -> float:
        """Angle at the port between its axis and the docking point: 0 on the axis, 180 behind the target."""
        return float(np.degrees(np.arctan2(self.lateral_m, self.axial_m)))


def docking_figures(
    chaser: ChaserState, attitude: tuple[FloatArray, FloatArray], port: DockingPort
) -> DockingFigures:
    """Compute the docking figures at one time.

    Parameters
    ----------
    chaser : ChaserState
        State of the chaser.
    attitude : tuple of array
        Attitude of the target: ``q_eci_from_target_wxyz`` and angular velocity, target axes [rad s-1].
    port : DockingPort
        Docking port of the target.
    """
    q_target, omega = attitude
    R_target_from_eci = matrix_from_quat(q_target).T
    R_eci_from_camera = matrix_from_quat(chaser.q_camera_from_eci_wxyz).T
    omega_camera = np.array(chaser.omega_camera_rad_s)
    lever = np.array(PROBE_M)
    p = R_target_from_eci @ (np.array(chaser.position_eci_m) + R_eci_from_camera @ lever)
    v = R_target_from_eci @ (
        np.array(chaser.velocity_eci_m_s) + R_eci_from_camera @ cross(omega_camera, lever)
    )
    R_port_from_target = matrix_from_quat(port.q_target_from_port_wxyz).T
    x, y, z = R_port_from_target @ (p - np.array(port.origin_m))
    vx, vy, vz = R_port_from_target @ (v - cross(omega, p))
    R = R_port_from_target @ R_target_from_eci @ R_eci_from_camera
    turn = np.degrees(omega_camera - (R_target_from_eci @ R_eci_from_camera).T @ omega)
    return DockingFigures(
        t_s=chaser.t_s,
        axial_m=-float(z),
        closing_m_s=float(vz),
        right_m=float(x),
        down_m=float(y),
        right_m_s=float(vx),
        down_m_s=float(vy),
        # R_port_from_camera = R_y(yaw) R_x(pitch) R_z(roll)
        roll_deg=float(np.degrees(np.arctan2(R[1, 0], R[1, 1]))),
        pitch_deg=float(np.degrees(np.arcsin(np.clip(-R[1, 2], -1.0, 1.0)))),
        yaw_deg=float(np.degrees(np.arctan2(R[0, 2], R[2, 2]))),
        roll_deg_s=float(turn[2]),
        pitch_deg_s=float(turn[0]),
        yaw_deg_s=float(turn[1]),
    )


def docking_point_target_m(chaser: ChaserState, q_eci_from_target_wxyz: FloatArray) -> FloatArray:
    """Return the chaser's docking point (3,) from the target's centre of mass, target axes [m]."""
    R_eci_from_camera = matrix_from_quat(chaser.q_camera_from_eci_wxyz).T
    reach = np.array(chaser.position_eci_m) + R_eci_from_camera @ np.array(PROBE_M)
    return np.asarray(matrix_from_quat(q_eci_from_target_wxyz).T @ reach)


@dataclass(frozen=True, kw_only=True)
class DockingLimits:
    """Limits of the figures at contact; the limits of closing speed and offset grow with distance.

    Parameters
    ----------
    name : str
        Name in commands and files.
    title : str
        Name in texts for people.
    source : str
        Origin of the limits.
    closing_m_s : float
        Largest closing speed at contact [m s-1].
    lateral_m : float
        Largest lateral offset at contact [m].
    lateral_m_s : float
        Largest lateral speed at contact [m s-1].
    attitude_deg : float
        Largest attitude error about each axis at contact [deg].
    rate_deg_s : float
        Largest angular velocity about each axis at contact [deg s-1].
    slowest_m_s : float, optional
        Smallest closing speed at contact [m s-1].
    closing_per_m : float, optional
        Allowed closing speed per metre of distance [s-1], if larger than ``closing_m_s``.
    lateral_per_m : float, optional
        Growth of the allowed offset and its rate with distance.
    """

    name: str
    title: str
    source: str
    closing_m_s: float
    lateral_m: float
    lateral_m_s: float
    attitude_deg: float
    rate_deg_s: float
    slowest_m_s: float = 0.0
    closing_per_m: float = 1 / 200
    lateral_per_m: float = 0.02

    def lateral_at_m(self, axial_m: float) -> float:
        """Return the offset allowed at a distance from the port, along each of the two directions."""
        return self.lateral_m + self.lateral_per_m * axial_m


TWO_TENTHS = DockingLimits(
    name="two-tenths",
    title="0.2 m, m/s, °, °/s",
    source="SpaceX's docking simulator (iss-sim.spacex.com): every figure below 0.2",
    closing_m_s=0.2,
    lateral_m=0.2,
    lateral_m_s=0.2,
    attitude_deg=0.2,
    rate_deg_s=0.2,
)
IDSS = DockingLimits(
    name="idss",
    title="IDSS standard",
    source="International Docking System Standard, initial contact conditions",
    closing_m_s=0.10,
    slowest_m_s=0.05,
    lateral_m=0.10,
    lateral_m_s=0.04,
    attitude_deg=4.0,
    rate_deg_s=0.2,
)
PRESETS: dict[str, DockingLimits] = {p.name: p for p in (TWO_TENTHS, IDSS)}


@dataclass(frozen=True, kw_only=True)
class JudgedFigure:
    """A figure with its limit.

    Parameters
    ----------
    name : str
        Name of the quantity.
    unit : str
        Unit of the quantity.
    value : float
        Figure, signed if applicable.
    limit : float
        Limit of its magnitude at present.
    """

    name: str
    unit: str
    value: float
    limit: float

    @property
    def text(self) -> str:
        """The value with its sign, without minus zero: speeds as `speed_text` writes them, others to two decimals."""
        return f"{self.value:+z.{SPEED_DECIMALS if self.unit == 'm/s' else 2}f}"

    @property
    def size_text(self) -> str:
        """The magnitude with its unit."""
        size = abs(self.value)
        return speed_text(size) if self.unit == "m/s" else f"{size:.3g} {self.unit}"

    @property
    def share(self) -> float:
        """Magnitude over limit."""
        return abs(self.value) / self.limit

    @property
    def state(self) -> State:
        """Within the limit, near it, or outside."""
        return "within" if self.share <= 1.0 else "near" if self.share <= NEAR_LIMIT_FACTOR else "outside"


def judge(
    figures: DockingFigures, limits: DockingLimits, corridor_deg: float = CORRIDOR_DEG
) -> tuple[JudgedFigure, ...]:
    """Compare each figure with its limit at the chaser's distance.

    Returns
    -------
    tuple of JudgedFigure
        Twelve, always in the same order: closing speed, offsets, lateral rates, angles, angular rates, and last the
        angle off the axis against ``corridor_deg``. That angle is 0 within the offset allowed at the port.
    """
    f, distance = figures, max(figures.axial_m, 0.0)
    closing = max(limits.closing_m_s, limits.closing_per_m * distance)
    lateral = limits.lateral_at_m(distance)
    across_rate = limits.lateral_m_s * (1 + limits.lateral_per_m * distance)
    # inside the offset allowed at the port, the angle there is meaningless
    off_axis = 0.0 if f.lateral_m <= limits.lateral_m and f.axial_m > -limits.lateral_m else f.off_axis_deg
    rows = (
        ("closing", "m/s", f.closing_m_s, closing),
        ("offset right", "m", f.right_m, lateral),
        ("offset down", "m", f.down_m, lateral),
        ("rate right", "m/s", f.right_m_s, across_rate),
        ("rate down", "m/s", f.down_m_s, across_rate),
        ("roll", "°", f.roll_deg, limits.attitude_deg),
        ("pitch", "°", f.pitch_deg, limits.attitude_deg),
        ("yaw", "°", f.yaw_deg, limits.attitude_deg),
        ("roll rate", "°/s", f.roll_deg_s, limits.rate_deg_s),
        ("pitch rate", "°/s", f.pitch_deg_s, limits.rate_deg_s),
        ("yaw rate", "°/s", f.yaw_deg_s, limits.rate_deg_s),
        ("off axis", "°", off_axis, corridor_deg),
    )
    return tuple(JudgedFigure(name=n, unit=u, value=v, limit=limit) for n, u, v, limit in rows)


@dataclass(frozen=True, kw_only=True)
class Contact:
    """A contact with its score.

    Parameters
    ----------
    t_s : float
        Time.
    figures : DockingFigures
        Figures just before it.
    at_port : bool
        True if the docking point met the port rather than the body.
    misses : tuple of str
        Violated limits, as text; none for a docking.
    score : int
        0 to 100.
    """

    t_s: float
    figures: DockingFigures
    at_port: bool
    misses: tuple[str, ...]
    score: int

    @property
    def docked(self) -> bool:
        """True if it was a docking within all limits."""
        return not self.misses

    def document(self) -> dict[str, Any]:
        """Return a JSON-able object."""
        return {
            "t_s": self.t_s,
            "docked": self.docked,
            "score": self.score,
            "misses": list(self.misses),
            **{name: value for name, value in vars(self.figures).items() if name != "t_s"},
        }


def judge_contact(figures: DockingFigures, limits: DockingLimits, *, at_port: bool) -> Contact:
    """Judge a contact.

    Each figure scores 100 points at zero, 50 at its limit, none from twice the limit on; the score is their mean, and 0
    for a contact outside the port. The corridor is not scored.
    """
    rows = judge(figures, limits)[:-1]
    misses = [f"{r.name} {r.size_text} (limit {r.limit:g})" for r in rows if r.share > 1.0]
    if figures.closing_m_s < limits.slowest_m_s:
        misses.append(f"closing {speed_text(figures.closing_m_s)} (at least {limits.slowest_m_s:g})")
    if not at_port:
        misses.insert(0, "contact outside the port")
    points = float(np.mean([max(0.0, 100.0 - 50.0 * r.share) for r in rows]))
    return Contact(
        t_s=figures.t_s,
        figures=figures,
        at_port=at_port,
        misses=tuple(misses),
        score=round(points) if at_port else 0,
    )


def touches_port(before: DockingFigures, after: DockingFigures) -> bool:
    """Return True if the docking point crossed the plane of the port from outside, near its centre."""
    if not before.axial_m > 0.0 >= after.axial_m:
        return False
    # intersection of the line between the two with the plane
    share = before.axial_m / (before.axial_m - after.axial_m)
    right = before.right_m + share * (after.right_m - before.right_m)
    down = before.down_m + share * (after.down_m - before.down_m)
    return float(np.hypot(right, down)) <= CAPTURE_M


def docked_state(
    attitude: tuple[FloatArray, FloatArray], port: DockingPort
) -> tuple[Vec3, Vec3, FloatArray, Vec3]:
    """Compute the state of the docked chaser.

    Parameters
    ----------
    attitude : tuple of array
        Attitude of the target: ``q_eci_from_target_wxyz`` and angular velocity, target axes [rad s-1].
    port : DockingPort
        Docking port of the target.

    Returns
    -------
    position_m : tuple of float
        Camera minus the target's centre of mass, GCRS axes [m].
    velocity_m_s : tuple of float
        Its derivative [m s-1].
    R_camera_from_eci : (3, 3) array
        Attitude of the camera, that of the port.
    omega_camera_rad_s : tuple of float
        The target's angular velocity relative to ECI, camera axes [rad s-1].
    """
    q_target, omega = attitude
    R_eci_from_target = matrix_from_quat(q_target)
    R_eci_from_port = R_eci_from_target @ matrix_from_quat(port.q_target_from_port_wxyz)
    p = R_eci_from_target @ np.array(port.origin_m) - R_eci_from_port @ np.array(PROBE_M)
    turn = R_eci_from_target @ omega
    return vec3(p), vec3(cross(turn, p)), R_eci_from_port.T, vec3(R_eci_from_port.T @ turn)
