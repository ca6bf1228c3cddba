"""Reader of CCSDS messages with a single state as key = value lines: orbit parameters (OPM), mean elements (OMM)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.world.messages.ccsds import (
    HEADER_KEYS,
    TIME_SYSTEMS,
    Segment,
    first_line,
    number,
    read_time,
    refuse_unknown_key,
)
from flyaround.simulator.world.messages.ccsds_frames import require_frame

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

_AXES = ("X", "Y", "Z", "X_DOT", "Y_DOT", "Z_DOT")
_ELEMENTS = ("SEMI_MAJOR_AXIS", "ECCENTRICITY", "INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER")
_OBJECT = ("OBJECT_NAME", "OBJECT_ID", "CENTER_NAME", "REF_FRAME", "REF_FRAME_EPOCH", "TIME_SYSTEM", "EPOCH")
_CRAFT = ("MASS", "SOLAR_RAD_AREA", "SOLAR_RAD_COEFF", "DRAG_AREA", "DRAG_COEFF")
COVARIANCE = (
    "COV_REF_FRAME",
    *(f"C{a}_{b}" for k, a in enumerate(_AXES) for b in _AXES[: k + 1]),
)
_MANOEUVRE = (
    *(
        "MAN_EPOCH_IGNITION",
        "MAN_DURATION",
        "MAN_DELTA_MASS",
        "MAN_REF_FRAME",
        "MAN_DV_1",
        "MAN_DV_2",
        "MAN_DV_3",
    ),
)
KEYS = {
    "OPM": (*_OBJECT, *_AXES, *_ELEMENTS, "TRUE_ANOMALY", "MEAN_ANOMALY", "GM", *_CRAFT),
    "OMM": (
        *(*_OBJECT, "MEAN_ELEMENT_THEORY", "MEAN_MOTION", *_ELEMENTS, "MEAN_ANOMALY", "GM", *_CRAFT),
        *("EPHEMERIS_TYPE", "CLASSIFICATION_TYPE", "NORAD_CAT_ID", "ELEMENT_SET_NO", "REV_AT_EPOCH", "BSTAR"),
        *("BTERM", "AGOM", "MEAN_MOTION_DOT", "MEAN_MOTION_DDOT"),
    ),
}
"""CCSDS 502.0-B-3, tables 3-1 to 3-3 and 4-1 to 4-3."""
_UNIT = re.compile(r"(.*?)\s*\[([^\]]*)\]")
_UNITS = {
    **dict.fromkeys((*_AXES[:3], "SEMI_MAJOR_AXIS"), "km"),
    **dict.fromkeys(_AXES[3:], "km/s"),
    **dict.fromkeys(
        ("INCLINATION", "RA_OF_ASC_NODE", "ARG_OF_PERICENTER", "TRUE_ANOMALY", "MEAN_ANOMALY"), "deg"
    ),
    "GM": "km**3/s**2",
    "MEAN_MOTION": "rev/day",
}


def read_fields(text: str, source: str, kind: str) -> Segment:
    """Read the keys of an OPM or OMM in key = value form.

    Returns
    -------
    Segment
        Values as in the file, with units, in ``meta``; in ``rows`` the line number and ignition time of each
        manoeuvre. Other keys of manoeuvres, user-defined keys and comments are left out.

    Raises
    ------
    UserError
        If a line or a key is invalid.
    """
    segment = Segment(source)
    for line_number, raw in enumerate(text.splitlines(), start=1):
        line, location = raw.strip(), f"{source}, line {line_number}"
        if not line or line.startswith("COMMENT"):
            continue
        key, equals, value = (part.strip() for part in line.partition("="))
        if not equals:
            raise UserError(f"{location}: {line[:60]!r} is not of the form KEY = value")
        if key.startswith("USER_DEFINED_"):
            continue
        known_keys = (*HEADER_KEYS, f"CCSDS_{kind}_VERS", *KEYS[kind], *COVARIANCE, *_MANOEUVRE)
        refuse_unknown_key(key, known_keys, location)
        if key == "MAN_EPOCH_IGNITION":
            segment.rows.append((line_number, [value]))
        elif key not in _MANOEUVRE:
            segment.set_once(key, value, location)
    return segment


def read_value(segment: Segment, key: str) -> float:
    """Read a number of a message, and check its unit if it is stated.

    Raises
    ------
    UserError
        If it is missing, not a number, or in another unit.
    """
    text = segment.require(key)
    match = _UNIT.fullmatch(text)
    if match is not None:
        text, unit, expected = match[1], match[2].strip(), _UNITS.get(key)
        if expected is not None and unit.lower() != expected:
            raise UserError(f"{segment.where}: {key} is in {unit[:20]}, allowed: {expected}")
    return number(text, f"{segment.where}: {key}")


@dataclass(frozen=True, kw_only=True)
class OrbitParameters:
    """State of an OPM.

    Parameters
    ----------
    frame : str
        Frame of the values.
    centre : str
        Central body, in capitals.
    epoch : Instant
        Time of the state.
    frozen : Instant
        Time at which a frame of date is frozen, or the epoch.
    state : tuple of array or None
        Position [m] and velocity [m s-1], or None if there are only elements.
    elements : tuple or None
        Elements (SEMI_MAJOR_AXIS [m], ECCENTRICITY, INCLINATION, RA_OF_ASC_NODE, ARG_OF_PERICENTER and anomaly [rad]),
        True if the anomaly is the mean one, and the gravitational parameter [m3 s-2] or None; None without elements.
    unused : tuple of str
        Contents of the message that are not used, for the user.
    """

    frame: str
    centre: str
    epoch: Instant
    frozen: Instant
    state: tuple[FloatArray, FloatArray] | None
    elements: tuple[list[float], bool, float | None] | None
    unused: tuple[str, ...]


def read_opm(segment: Segment) -> OrbitParameters:
    """Read the state of an OPM's keys.

    Returns
    -------
    OrbitParameters
        State, elements or both, in SI units.

    Raises
    ------
    UserError
        If one is missing or invalid.
    """
    source = segment.where
    system = segment.require_one_of("TIME_SYSTEM", TIME_SYSTEMS)
    frame = require_frame(segment.require("REF_FRAME"), source)
    epoch = read_time(segment.require("EPOCH"), system, f"{source}: EPOCH")
    frozen = epoch
    if "REF_FRAME_EPOCH" in segment.meta:
        frozen = read_time(segment.meta["REF_FRAME_EPOCH"], system, f"{source}: REF_FRAME_EPOCH")
    state = elements = None
    if any(key in segment.meta for key in _AXES) or "SEMI_MAJOR_AXIS" not in segment.meta:
        values = np.array([read_value(segment, key) for key in _AXES]) * 1e3
        state = (values[:3], values[3:])
    if "SEMI_MAJOR_AXIS" in segment.meta:
        a_km, e, *angles = (read_value(segment, key) for key in _ELEMENTS)
        if not (a_km > 0 and 0 <= e < 1):
            raise UserError(
                f"{source}: SEMI_MAJOR_AXIS is {a_km:g} and ECCENTRICITY {e:g}, allowed: a closed orbit"
            )
        is_mean = "MEAN_ANOMALY" in segment.meta
        anomaly = read_value(segment, "MEAN_ANOMALY" if is_mean else "TRUE_ANOMALY")
        gm = read_value(segment, "GM") if "GM" in segment.meta else None
        if gm is not None and gm <= 0:
            raise UserError(f"{source}: GM is {gm:g} km**3/s**2, allowed: more than 0")
        elements = (
            [a_km * 1e3, e, *np.radians([*angles, anomaly]).tolist()],
            is_mean,
            None if gm is None else gm * 1e9,
        )
    return OrbitParameters(
        frame=frame,
        centre=segment.require("CENTER_NAME").upper(),
        epoch=epoch,
        frozen=frozen,
        state=state,
        elements=elements,
        unused=tuple(
            description
            for description, is_present in (
                ("manoeuvres (write them as [[burns]])", bool(segment.rows)),
                ("a covariance", any(key in segment.meta for key in COVARIANCE)),
                (
                    "mass and areas (write them as [forces.target])",
                    any(key in segment.meta for key in _CRAFT),
                ),
            )
            if is_present
        ),
    )


def is_state_message(text: str, kind: str) -> bool:
    """Return True if a text is a message of ``kind``, ``OPM`` or ``OMM``, in key = value form.

    Returns
    -------
    bool
        True if the first line that is neither blank nor a comment states the version of such a message.
    """
    return first_line(text).startswith(f"CCSDS_{kind}_VERS")
