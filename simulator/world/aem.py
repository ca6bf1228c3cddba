"""CCSDS attitude ephemeris messages (AEM, 504.0-B): reading an attitude out of one, and writing a flight's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.world.ccsds import FRAMES, Segment, gcrf_from, header, read_segments, stamp
from simulator.world.rotation import quat_conjugate, quat_from_matrix, quat_multiply, quat_normalize

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from simulator.arrays import FloatArray
    from simulator.world.time import Instant


def read_aem_state(text: str, where: str, epoch: Instant) -> tuple[FloatArray, FloatArray]:
    """``q_eci_from_body_wxyz`` and the rate relative to ECI in body axes [rad s-1] at ``epoch``.

    Between two lines the body turns at a constant rate about a fixed axis; that rate is what is returned.
    Lines must therefore be closer together than half a turn.

    Raises
    ------
    UserError
        If the file is not an AEM of quaternions against a known inertial frame, its lines are out of order,
        or the epoch falls outside every segment.
    """
    spans = []
    for segment in read_segments(text, where, "AEM"):
        instants = segment.instants()
        times = np.array([t.minus(epoch) for t in instants])
        spans.append(f"{instants[0].iso()} to {instants[-1].iso()}")
        if len(times) > 1 and times[0] <= 1e-6 and times[-1] >= -1e-6:
            k = min(max(int(np.searchsorted(times, 0.0)) - 1, 0), len(times) - 2)
            q0, q1 = _quaternions(segment)[k : k + 2]
            turn = _rotvec(quat_multiply(quat_conjugate(q0), q1)) / (times[k + 1] - times[k])
            half = turn * -times[k]
            angle = float(np.linalg.norm(half))
            step = np.array([np.cos(angle / 2), *(0.5 * np.sinc(angle / (2 * np.pi)) * half)])
            return quat_multiply(q0, step), turn
    raise UserError(f"{where} covers {' and '.join(spans)}, not {epoch.iso()}: choose an epoch within")


def _quaternions(segment: Segment) -> FloatArray:
    """(n, 4) ``q_eci_from_body_wxyz``.

    A quaternion of these messages carries vectors of frame A to frame B by rotating the frame, which makes
    it the Hamilton quaternion ``q_A_from_B``.
    """
    if segment.need("ATTITUDE_TYPE").upper() != "QUATERNION":
        raise UserError(
            f"{segment.where}: ATTITUDE_TYPE is {segment.meta['ATTITUDE_TYPE']}, allowed: QUATERNION"
        )
    values = segment.numbers(4)
    if segment.meta.get("QUATERNION_TYPE", "LAST").upper() == "LAST":
        values = np.roll(values, 1, axis=1)
    try:
        q = quat_normalize(values)
    except ValueError as error:
        raise UserError(f"{segment.where}: {error}") from error
    a, b = segment.need("REF_FRAME_A").upper(), segment.need("REF_FRAME_B").upper()
    if segment.meta.get("ATTITUDE_DIR", "A2B").upper() == "B2A":
        q = quat_conjugate(q)
    if a not in FRAMES and b in FRAMES:
        a, q = b, quat_conjugate(q)
    if a not in FRAMES:
        raise UserError(f"{segment.where}: neither REF_FRAME_A nor REF_FRAME_B is one of {', '.join(FRAMES)}")
    return quat_multiply(quat_from_matrix(gcrf_from(a)), q)


def _rotvec(q_wxyz: FloatArray) -> FloatArray:
    q = q_wxyz if q_wxyz[0] >= 0 else -q_wxyz
    sine = float(np.linalg.norm(q[1:]))
    return np.zeros(3) if sine == 0 else np.asarray(2 * np.arctan2(sine, q[0]) / sine * q[1:])


def write_aem(
    *, name: str, body_frame: str, epochs_utc: Sequence[str], q_eci_from_body_wxyz: ArrayLike
) -> str:
    """An AEM of quaternions, scalar last, from GCRF to the body.

    Parameters
    ----------
    name : of the object. body_frame : what its axes are called, for example SC_BODY_1.
    epochs_utc : ISO 8601 with Z, in order. q_eci_from_body_wxyz : (n, 4).
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
    before = np.zeros(4)
    for epoch, q in zip(epochs_utc, np.asarray(q_eci_from_body_wxyz, float), strict=True):
        # one sign through the file, so that readers may interpolate the numbers
        near = -q if q @ before < 0 else q
        before = near
        w, x, y, z = near
        lines.append(f"{stamp(epoch)} {x:.12f} {y:.12f} {z:.12f} {w:.12f}")
    return "\n".join([*lines, "DATA_STOP"]) + "\n"
