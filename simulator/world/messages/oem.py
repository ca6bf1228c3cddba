"""CCSDS orbit ephemeris messages (OEM, 502.0-B): reads a state, writes a flight's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from simulator.errors import UserError
from simulator.world.messages.ccsds import Segment, header, read_segments, read_time, stamp
from simulator.world.messages.ccsds_frames import require_frame, state_in_gcrf

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from simulator.runtime.arrays import FloatArray
    from simulator.world.time.instant import Instant

_HALF_WINDOW = 4
_OF_DATE = ("TEME", "TOD")
"""Frames that a message may freeze at a moment, its REF_FRAME_EPOCH."""


def read_oem_state(
    text: str, where: str, epoch: Instant, centre: str = "EARTH"
) -> tuple[FloatArray, FloatArray]:
    """Position [m] and velocity [m s-1] in GCRS at ``epoch``.

    Between lines the state is interpolated by the polynomial through position and velocity of the nearest
    eight lines (Hermite), whatever the file suggests.

    Parameters
    ----------
    text : the file. where : its name, for messages. epoch : must lie within a segment.
    centre : body that it must count from.

    Raises
    ------
    UserError
        If the file is not an OEM about that body in a known frame and time system, its lines are out of
        order, or the epoch falls outside every segment or into a gap.
    """
    spans = []
    for segment in read_segments(text, where, "OEM"):
        segment.require_one_of("CENTER_NAME", (centre,))
        frame = require_frame(segment.require("REF_FRAME"), where)
        instants = segment.instants()
        times = np.array([t.minus(epoch) for t in instants])
        first, last = segment.usable_span(instants)
        spans.append(f"{first.iso()} to {last.iso()}")
        if first.minus(epoch) <= 1e-6 and last.minus(epoch) >= -1e-6:
            # interpolated in the file's own frame, whose velocities are the slopes of its positions
            r, v = _interpolate(segment, times)
            if "REF_FRAME_EPOCH" in segment.meta and frame in _OF_DATE:
                at = read_time(segment.meta["REF_FRAME_EPOCH"], segment.require("TIME_SYSTEM").upper(), where)
                return state_in_gcrf(frame, at, r, v)
            return state_in_gcrf(frame, epoch, r, v)
    raise UserError(f"{where} covers {' and '.join(spans)}, not {epoch.iso()}: choose an epoch within")


def _interpolate(segment: Segment, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """State at zero of ``times_s``, in the file's frame."""
    states = segment.numbers(6) * 1e3
    nearest = int(np.argmin(np.abs(times_s)))
    if abs(times_s[nearest]) < 1e-6:
        return states[nearest, :3], states[nearest, 3:]
    k = int(np.searchsorted(times_s, 0.0))
    segment.refuse_gap(times_s, k)
    near = slice(max(k - _HALF_WINDOW, 0), k + _HALF_WINDOW)
    return _hermite_at_zero(times_s[near], states[near, :3], states[near, 3:])


def _hermite_at_zero(t_s: FloatArray, r_m: FloatArray, v_m_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Value and slope at 0 of the polynomial with these values and slopes."""
    scale = float(np.max(np.abs(t_s)))
    x = t_s / scale
    powers = np.arange(2 * len(x))
    values = x[:, None] ** powers
    slopes = powers * x[:, None] ** np.maximum(powers - 1, 0)
    rows = np.linalg.solve(np.vstack([values, slopes]), np.vstack([r_m, v_m_s * scale]))
    return rows[0], rows[1] / scale


def write_oem(
    *,
    name: str,
    epochs_utc: Sequence[str],
    r_eci_m: ArrayLike,
    v_eci_m_s: ArrayLike,
    note: str = "",
    centre: str = "EARTH",
) -> str:
    """An OEM in GCRF and UTC with positions to the micrometre.

    Parameters
    ----------
    name : of the object. epochs_utc : ISO 8601 with Z, in order.
    r_eci_m, v_eci_m_s : (n, 3) from the centre. note : a comment. centre : body they count from.
    """
    lines = header("OEM", "2.0", epochs_utc[0])
    lines += [
        "META_START",
        *([f"COMMENT {note}"] if note else []),
        f"OBJECT_NAME = {name}",
        f"OBJECT_ID = {name}",
        f"CENTER_NAME = {centre}",
        "REF_FRAME = GCRF",
        "TIME_SYSTEM = UTC",
        f"START_TIME = {stamp(epochs_utc[0])}",
        f"STOP_TIME = {stamp(epochs_utc[-1])}",
        "META_STOP",
        "",
    ]
    for epoch, r, v in zip(epochs_utc, np.asarray(r_eci_m), np.asarray(v_eci_m_s), strict=True):
        numbers = [f"{x / 1e3:.9f}" for x in r] + [f"{x / 1e3:.12f}" for x in v]
        lines.append(" ".join([stamp(epoch), *numbers]))
    return "\n".join(lines) + "\n"
