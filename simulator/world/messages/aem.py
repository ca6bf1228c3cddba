"""Reader and writer of CCSDS attitude ephemeris messages (AEM, CCSDS 504.0-B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.frames.rotation import (
    quat_conjugate,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
)
from flyaround.simulator.world.messages.ccsds import Segment, header, read_segments, stamp
from flyaround.simulator.world.messages.ccsds_frames import FRAMES, R_gcrf_from, known_frame

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike
    from scipy.spatial.transform import RotationSpline

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

_ROUNDING_S = 1e-6  # tolerance of times outside a segment
_MARGIN_LINES = 12  # lines before and after a flight that the spline includes
_QUATERNION_TYPES = ("QUATERNION", "QUATERNION/DERIVATIVE", "QUATERNION/RATE", "QUATERNION/ANGVEL")
_EULER_TYPES = ("EULER_ANGLE", "EULER_ANGLE/RATE", "EULER_ANGLE/DERIVATIVE", "EULER_ANGLE/ANGVEL")
_TYPES = (*_QUATERNION_TYPES, *_EULER_TYPES, "SPIN")


def read_aem_state(text: str, source: str, epoch: Instant) -> tuple[FloatArray, FloatArray]:
    """Read the attitude and rate at ``epoch`` from an attitude message.

    Between two lines the body rotates at a constant rate about a fixed axis, so the lines must be less than half a
    rotation apart.

    Returns
    -------
    q_eci_from_body_wxyz : (4,) array
        Unit quaternion, scalar first.
    omega_rad_s : (3,) array
        Rate relative to ECI, body axes [rad s-1].

    Raises
    ------
    UserError
        If the file is not an AEM of a known kind in a known frame, its lines are out of order, or the epoch is outside
        every segment or in a gap.
    """
    segment, times = _segment_over(text, source, epoch, 0.0)
    k = min(max(int(np.searchsorted(times, 0.0)) - 1, 0), len(times) - 2)
    segment.refuse_gap(times, k + 1)
    q0, q1 = _attitudes(segment, times, epoch)[k : k + 2]
    rate = _rotvec(quat_multiply(quat_conjugate(q0), q1)) / (times[k + 1] - times[k])
    offset = rate * -times[k]
    angle = float(np.linalg.norm(offset))
    rotation = np.array([np.cos(angle / 2), *(0.5 * np.sinc(angle / (2 * np.pi)) * offset)])
    return quat_multiply(q0, rotation), rate


@dataclass(frozen=True, eq=False)
class AttitudeHistory:
    """The attitude of a message over a flight: a cubic rotation spline through its lines, whose rate is continuous.

    Parameters
    ----------
    spline : RotationSpline
        Spline over the flight.
    end_s : float
        End of the requested span, after which the last rate continues.
    """

    spline: RotationSpline
    end_s: float

    def __call__(self, t_s: float) -> tuple[FloatArray, FloatArray]:
        """Return ``q_eci_from_body_wxyz`` (unit) and the body's rate relative to ECI, body axes [rad s-1]."""
        clipped_s = min(t_s, self.end_s)
        x, y, z, w = self.spline(clipped_s).as_quat()
        q, omega = np.array([w, x, y, z]), np.asarray(self.spline(clipped_s, 1), float)
        return (
            q if clipped_s == t_s else quat_multiply(q, quat_from_rotvec(omega * (t_s - clipped_s)))
        ), omega


def read_aem_history(text: str, source: str, epoch: Instant, duration_s: float) -> AttitudeHistory:
    """Read the attitude from ``epoch`` on for ``duration_s`` from an attitude message.

    Returns
    -------
    AttitudeHistory
        Attitude and rate as a function of the time since ``epoch`` [s].

    Raises
    ------
    UserError
        As in `read_aem_state`, and if no segment covers the whole flight.

    References
    ----------
    Hughes (1986), Spacecraft Attitude Dynamics, ch. 2; the spline is that of scipy's ``RotationSpline``.
    """
    from scipy.spatial.transform import Rotation, RotationSpline  # noqa: PLC0415 - slow to import

    segment, times = _segment_over(text, source, epoch, duration_s)
    low = max(int(np.searchsorted(times, 0.0)) - _MARGIN_LINES, 0)
    high = min(int(np.searchsorted(times, duration_s)) + _MARGIN_LINES + 1, len(times))
    for k in range(low + 1, high):
        segment.refuse_gap(times, k)
    q = _attitudes(segment, times, epoch)[low:high]
    return AttitudeHistory(
        RotationSpline(times[low:high], Rotation.from_quat(np.roll(q, -1, axis=1))), duration_s
    )


def _segment_over(text: str, source: str, epoch: Instant, duration_s: float) -> tuple[Segment, FloatArray]:
    """Return the segment that covers a flight, and the times of its lines since ``epoch`` [s]."""
    spans = []
    for segment in read_segments(text, source, "AEM"):
        times = segment.times_s(epoch)
        first, last = segment.usable_span_s(times, epoch)
        spans.append(f"{epoch.plus(first).iso()} to {epoch.plus(last).iso()}")
        if len(times) > 1 and first <= _ROUNDING_S and last >= duration_s - _ROUNDING_S:
            return segment, times
    span = epoch.iso() + (f" to {epoch.plus(duration_s).iso()}" if duration_s else "")
    raise UserError(
        f"{source} covers {' and '.join(spans)}, not {span}: choose an epoch and a duration within"
    )


def _attitudes(segment: Segment, times_s: FloatArray, epoch: Instant) -> FloatArray:
    """Return the attitudes ``q_eci_from_body_wxyz`` (n, 4) of a segment's lines."""
    kind = segment.require_one_of("ATTITUDE_TYPE", _TYPES)
    if kind in _QUATERNION_TYPES:
        q = _quaternions(segment)
    elif kind in _EULER_TYPES:
        q = _from_angles(segment.numbers(3), _sequence(segment))
    else:
        q = _from_angles(_spin_angles(segment), "ZYZ")
    a, b = segment.require("REF_FRAME_A"), segment.require("REF_FRAME_B")
    if segment.meta.get("ATTITUDE_DIR", "A2B").upper() == "B2A":
        q = quat_conjugate(q)
    frame = known_frame(a)
    if frame is None:
        frame, q = known_frame(b), quat_conjugate(q)
    if frame is None:
        raise UserError(
            f"{segment.where}: neither REF_FRAME_A = {a} nor REF_FRAME_B = {b} is one of {', '.join(FRAMES)}"
        )
    is_rotating = frame in {"ITRF", "TOD", "TEME"}
    fixed_rotation = None if is_rotating else quat_from_matrix(R_gcrf_from(frame, epoch))
    rows = [
        quat_multiply(
            quat_from_matrix(R_gcrf_from(frame, epoch.plus(t))) if fixed_rotation is None else fixed_rotation,
            row,
        )
        for t, row in zip(times_s.tolist(), q, strict=True)
    ]
    return np.array(rows)


def _quaternions(segment: Segment) -> FloatArray:
    """Return the (n, 4) quaternions, scalar first.

    A quaternion of these messages maps vectors of frame A to frame B by rotating the frame, so it is the Hamilton
    quaternion ``q_A_from_B``.
    """
    values = segment.numbers(4)
    if segment.meta.get("QUATERNION_TYPE", "LAST").upper() == "LAST":
        values = np.roll(values, 1, axis=1)
    try:
        return quat_normalize(values)
    except ValueError as error:
        raise UserError(f"{segment.where}: {error}") from error


def _sequence(segment: Segment) -> str:
    """Return the axes of an Euler sequence such as 321, as SciPy names intrinsic rotations."""
    sequence = segment.require("EULER_ROT_SEQ").upper().translate(str.maketrans("123", "XYZ"))
    if (
        len(sequence) != 3
        or set(sequence) - set("XYZ")
        or sequence[0] == sequence[1]
        or sequence[1] == sequence[2]
    ):
        raise UserError(
            f"{segment.where}: EULER_ROT_SEQ is {segment.meta['EULER_ROT_SEQ']}, allowed: three axes such as 321"
        )
    return sequence


def _spin_angles(segment: Segment) -> FloatArray:
    """Return the angles (n, 3) about z, y, z from frame A to a spinning body, from right ascension and declination."""
    alpha, delta, phase, _ = segment.numbers(4).T
    return np.stack([alpha, 90.0 - delta, phase], axis=1)


def _from_angles(angles_deg: FloatArray, axes: str) -> FloatArray:
    """Return (n, 4) ``q_A_from_B`` of rotations that carry frame A's axes to B's, in the order of the sequence."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to import

    return np.roll(Rotation.from_euler(axes, angles_deg, degrees=True).as_quat(), 1, axis=1)


def _rotvec(q_wxyz: FloatArray) -> FloatArray:
    q = q_wxyz if q_wxyz[0] >= 0 else -q_wxyz
    sine = float(np.linalg.norm(q[1:]))
    return np.zeros(3) if sine == 0 else np.asarray(2 * np.arctan2(sine, q[0]) / sine * q[1:])


def write_aem(
    *, name: str, body_frame: str, epochs_utc: Sequence[str], q_eci_from_body_wxyz: ArrayLike
) -> str:
    """Write an AEM of quaternions, scalar last, from GCRF to the body.

    Parameters
    ----------
    name : str
        Name of the object.
    body_frame : str
        Name of its axes, for example SC_BODY_1.
    epochs_utc : sequence of str
        ISO 8601 with Z, in order.
    q_eci_from_body_wxyz : array_like
        (n, 4) attitudes.

    Returns
    -------
    str
        Text of the message: one segment, a line for each attitude in their order, and a line feed at the end. A
        quaternion has the other sign if that makes it continuous with the one before.
    """
    lines = header("AEM", "1.0", epochs_utc[0])
    lines += [
        "META_START",
        f"OBJECT_NAME = {name}",
        f"OBJECT_ID = {name}",
        "CENTER_NAME = EARTH",
        "REF_FRAME_A = GCRF",
        f"REF_FRAME_B = {body_frame}",
        "ATTITUDE_DIR = A2B",
        "TIME_SYSTEM = UTC",
        f"START_TIME = {stamp(epochs_utc[0])}",
        f"STOP_TIME = {stamp(epochs_utc[-1])}",
        "ATTITUDE_TYPE = QUATERNION",
        "QUATERNION_TYPE = LAST",
        "META_STOP",
        "",
        "DATA_START",
    ]
    previous = np.zeros(4)
    for epoch, q in zip(epochs_utc, np.asarray(q_eci_from_body_wxyz, float), strict=True):
        # keep the sign continuous, so that readers may interpolate the components
        continuous = -q if q @ previous < 0 else q
        previous = continuous
        w, x, y, z = continuous
        lines.append(f"{stamp(epoch)} {x:.12f} {y:.12f} {z:.12f} {w:.12f}")
    return "\n".join([*lines, "DATA_STOP"]) + "\n"
