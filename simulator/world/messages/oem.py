"""Reader and writer of CCSDS orbit ephemeris messages (OEM, CCSDS 502.0-B)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.ephemeris.body import body_names
from flyaround.simulator.world.messages.ccsds import Segment, header, read_segments, read_time, stamp
from flyaround.simulator.world.messages.ccsds_frames import require_frame
from flyaround.simulator.world.messages.ephemeris import Ephemeris, Piece

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from flyaround.simulator.world.time.instant import Instant

_DEFAULT_LINES = 8  # lines per Hermite polynomial if the message names no interpolation
_MAX_LINES = 20  # largest number of lines per polynomial
_FRAMES_OF_DATE = ("TEME", "TOD")
"""Frames of date, which a message may freeze at its REF_FRAME_EPOCH."""
_ACCELERATION_LINE_LENGTH = 9  # position, velocity and acceleration


def read_oem(
    text: str, source: str, epoch: Instant, *, centre: str = "EARTH", satellite: str | None = None
) -> Ephemeris:
    """Read an ephemeris in key = value form.

    Parameters
    ----------
    text : str
        Contents of the file.
    source : str
        Name of the file in error messages.
    epoch : Instant
        Origin of times.
    centre : str, optional
        Required central body.
    satellite : str, optional
        Name or identifier, if there are several.

    Returns
    -------
    Ephemeris
        The object's segments in order of time, as states in GCRF from the centre of ``centre`` at seconds since
        ``epoch``. The file need not cover ``epoch``.

    Raises
    ------
    UserError
        If the file is not an OEM about that body in a known frame and time system, has an unknown key, or its lines are
        out of order.
    """
    return ephemeris_from(
        read_segments(text, source, "OEM"), source, epoch, centre=centre, satellite=satellite
    )


def ephemeris_from(
    segments: Sequence[Segment], source: str, epoch: Instant, *, centre: str, satellite: str | None
) -> Ephemeris:
    """Build the ephemeris of a message's segments; parameters and errors as in `read_oem`.

    Returns
    -------
    Ephemeris
        The selected object's segments in order of time; times are seconds since ``epoch``.
    """
    selected = one_object(segments, source, satellite)
    pieces = sorted((_piece(s, epoch, centre) for s in selected), key=lambda p: p.first_s)
    return Ephemeris(where=source, epoch=epoch, pieces=pieces)


def one_object(segments: Sequence[Segment], source: str, satellite: str | None) -> Sequence[Segment]:
    """Select the segments of one object by name or identifier, by default of the only object.

    Returns
    -------
    sequence of Segment
        Segments in the order given.

    Raises
    ------
    UserError
        If there are several and none is selected, or the selected one is missing.
    """
    names = [(s.meta.get("OBJECT_NAME", ""), s.meta.get("OBJECT_ID", "")) for s in segments]
    available = ", ".join(dict.fromkeys(f"{name} ({number})" for name, number in names[:10]))
    if satellite is not None:
        requested_name = satellite.strip().upper()
        selected = [
            s for s, n in zip(segments, names, strict=True) if requested_name in {x.upper() for x in n}
        ]
        if not selected:
            raise UserError(f"{source} has no object {satellite!r}: it has {available}")
        segments, names = selected, [n for n in names if requested_name in {x.upper() for x in n}]
    if len({number for _, number in names}) > 1:
        raise UserError(f"{source} has several objects: choose one by key orbit.satellite, of {available}")
    return segments


def _piece(segment: Segment, epoch: Instant, required_centre: str) -> Piece:
    centre = segment.require("CENTER_NAME").upper()
    if centre != required_centre:
        hint = f', or set orbit.centre to "{centre.lower()}"' if centre.lower() in body_names() else ""
        raise UserError(f"{segment.where}: CENTER_NAME is {centre}, allowed: {required_centre}{hint}")
    frame = require_frame(segment.require("REF_FRAME"), segment.where)
    system = segment.require("TIME_SYSTEM").upper()
    times = segment.times_s(epoch)
    frozen = None
    if "REF_FRAME_EPOCH" in segment.meta and frame in _FRAMES_OF_DATE:
        frozen = read_time(segment.meta["REF_FRAME_EPOCH"], system, segment.where)
    states = segment.numbers(6, (6, _ACCELERATION_LINE_LENGTH)) * 1e3
    first, last = segment.usable_span_s(times, epoch)
    method, lines = _interpolation(segment)
    if len(times) == 1 and method != "HERMITE":
        method, lines = "HERMITE", 1
    return Piece(
        segment=segment,
        frame=frame,
        frozen=frozen,
        times_s=times,
        states=states,
        method=method,
        lines=min(lines, len(times)),
        first_s=first,
        last_s=last,
    )


def _interpolation(segment: Segment) -> tuple[str, int]:
    """Return the method, and the number of lines of its polynomials."""
    if "INTERPOLATION" not in segment.meta:
        return "HERMITE", _DEFAULT_LINES
    method = segment.require_one_of("INTERPOLATION", ("HERMITE", "LAGRANGE", "LINEAR"))
    if method == "LINEAR":
        return method, 2
    text = segment.require("INTERPOLATION_DEGREE")
    degree = int(text) if text.isascii() and text.isdigit() and len(text) < 4 else 0
    lines = degree // 2 + 1 if method == "HERMITE" else degree + 1
    if not degree >= 1 or lines > _MAX_LINES:
        max_degree = 2 * _MAX_LINES - 1 if method == "HERMITE" else _MAX_LINES - 1
        raise UserError(f"{segment.where}: INTERPOLATION_DEGREE is {text[:20]}, allowed: 1 to {max_degree}")
    return method, max(lines, 2)


def write_oem(
    *,
    name: str,
    epochs_utc: Sequence[str],
    r_eci_m: ArrayLike,
    v_eci_m_s: ArrayLike,
    note: str = "",
    centre: str = "EARTH",
) -> str:
    """Write an OEM in GCRF and UTC with positions to the micrometre.

    Parameters
    ----------
    name : str
        Name of the object.
    epochs_utc : sequence of str
        ISO 8601 with Z, in order.
    r_eci_m : array_like
        (n, 3) positions from the centre [m].
    v_eci_m_s : array_like
        (n, 3) velocities [m s-1].
    note : str, optional
        Text of the message's comment.
    centre : str, optional
        Central body.

    Returns
    -------
    str
        Text of the message: one segment, a line for each state [km], [km s-1] in their order, and a line feed at the
        end.
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
