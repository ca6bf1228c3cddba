"""Reader of orbit mean-elements messages (OMM, CCSDS 502.0-B) as JSON and CSV, and their conversion for SGP4."""

from __future__ import annotations

import csv
import io
import json
from typing import Any

import numpy as np
from sgp4.api import WGS72, Satrec

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import refuse_deep
from flyaround.simulator.world.messages.ccsds import HEADER_KEYS, Segment, read_time, refuse_unknown_key
from flyaround.simulator.world.messages.state_message import KEYS, read_value

_CATALOGUE_KEYS = (
    *(
        "CCSDS_OMM_VERS",
        "SEMIMAJOR_AXIS",
        "PERIOD",
        "APOAPSIS",
        "PERIAPSIS",
        "OBJECT_TYPE",
        "RCS_SIZE",
        "RCSVALUE",
    ),
    *(
        "COUNTRY_CODE",
        "LAUNCH_DATE",
        "SITE",
        "DECAY_DATE",
        "DECAYED",
        "FILE",
        "GP_ID",
        "TLE_LINE0",
        "TLE_LINE1",
    ),
    *("TLE_LINE2", "ORIGINATOR", "CREATION_DATE", "COMMENT"),
)
"""Keys that web catalogues add to those of the standard."""
_THEORIES = ("SGP4", "SGP/SGP4", "SGP")
_ALLOWED_VALUES = {
    "CENTER_NAME": ("EARTH",),
    "REF_FRAME": ("TEME",),
    "TIME_SYSTEM": ("UTC",),
    "MEAN_ELEMENT_THEORY": _THEORIES,
}
_MINUTES_PER_DAY = 1440.0  # mean motion is in revolutions per day, SGP4's in radians per minute
MAX_CHARACTERS = 30_000_000
"""Largest JSON or CSV text: 30,000 objects of 500 characters are half of it. Parsed, it needs much more memory."""
_SGP4_EPOCH_JD = 2433281.5
"""Epoch of SGP4's day count, 31 December 1949."""
_MAX_CATALOGUE_NUMBER = 339_999
"""Largest catalogue number that SGP4's record can hold; it does not affect the motion."""


def read_json_objects(text: str, source: str) -> list[Segment]:
    """Read the objects of a JSON list, or a single object.

    Returns
    -------
    list of Segment
        One an object, in the order of the list, with its values as text in ``meta``; empty ones and null are left
        out.

    Raises
    ------
    UserError
        If the text is neither, too long or too deeply nested, or has an unknown key.
    """
    _refuse_long(text, source)
    refuse_deep(text.encode(), source)
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise UserError(f"{source} is not valid JSON: {error}: download it again") from error
    rows = document if isinstance(document, list) else [document]
    if not rows or not all(isinstance(row, dict) for row in rows):
        raise UserError(f"{source} is JSON, but not a list of mean elements (OMM): download it again")
    return [_segment(row, source) for row in rows]


def read_csv_objects(text: str, source: str) -> list[Segment]:
    """Read the objects of a CSV table with a header.

    Returns
    -------
    list of Segment
        One a line, in the order of the table, with its values as text in ``meta``; empty ones are left out.

    Raises
    ------
    UserError
        If the text is no such table, has no line after the header, is too long, or has an unknown key.
    """
    _refuse_long(text, source)
    try:
        rows: list[dict[Any, Any]] = list(csv.DictReader(io.StringIO(text), skipinitialspace=True))
    except csv.Error as error:
        raise UserError(f"{source} is not a table of mean elements: {error}: download it again") from error
    if not rows or any(None in row or None in row.values() for row in rows):
        raise UserError(
            f"{source} has no elements, or a line with more or fewer columns than the first: download it again"
        )
    return [_segment(row, source) for row in rows]


def _refuse_long(text: str, source: str) -> None:
    if len(text) > MAX_CHARACTERS:
        raise UserError(
            f"{source} has {len(text):,} characters of mean elements, at most {MAX_CHARACTERS:,} are read: keep the "
            "satellites that you need"
        )


def _segment(row: dict[str, Any], source: str) -> Segment:
    segment = Segment(source)
    for key, value in row.items():
        refuse_unknown_key(key, (*KEYS["OMM"], *HEADER_KEYS, *_CATALOGUE_KEYS), source)
        if isinstance(value, dict | list | bool):
            raise UserError(f"{source}: key {key} is neither a number nor text: download the file again")
        if value is not None and value != "":
            segment.meta[key] = str(value)
    return segment


def satellite_from_omm(segment: Segment) -> Satrec:
    """Build SGP4's record from the mean elements of an OMM.

    Parameters
    ----------
    segment : Segment
        Keys of the message.

    Returns
    -------
    Satrec
        Initialised record.

    Raises
    ------
    UserError
        If a key is missing, or the elements are for another theory, frame or body.
    """
    for key, allowed in _ALLOWED_VALUES.items():
        if key in segment.meta:
            segment.require_one_of(key, allowed)
    if float(segment.meta.get("EPHEMERIS_TYPE", "0") or 0) not in {0.0, 2.0}:
        raise UserError(
            f"{segment.where}: EPHEMERIS_TYPE is {segment.meta['EPHEMERIS_TYPE'][:20]}, allowed: 0 or "
            "2, which are for SGP4"
        )
    epoch = read_time(segment.require("EPOCH"), "UTC", f"{segment.where}: EPOCH")
    utc1, utc2 = epoch.utc
    keys = (
        "ECCENTRICITY",
        "ARG_OF_PERICENTER",
        "INCLINATION",
        "MEAN_ANOMALY",
        "RA_OF_ASC_NODE",
        "MEAN_MOTION",
    )
    e, argp, i, anomaly, node, motion = (read_value(segment, key) for key in keys)
    # 17 revolutions a day are an orbit at the Earth's surface
    if not (0 <= e < 1 and 0 < motion < 20):
        raise UserError(
            f"{segment.where}: ECCENTRICITY is {e:g} and MEAN_MOTION {motion:g} rev/day, allowed: 0 to 1 and 0 to 20"
        )
    name = segment.meta.get("NORAD_CAT_ID", "0")
    catalogue = int(name) if name.isascii() and name.isdigit() and len(name) < 10 else 0
    satellite = Satrec()
    satellite.sgp4init(
        WGS72,
        "i",
        catalogue if catalogue <= _MAX_CATALOGUE_NUMBER else 0,
        (utc1 - _SGP4_EPOCH_JD) + utc2,
        read_value(segment, "BSTAR"),
        *(0.0, 0.0),  # derivatives of the mean motion, which SGP4 ignores
        e,
        *np.radians([argp, i, anomaly]).tolist(),
        motion * 2 * np.pi / _MINUTES_PER_DAY,
        float(np.radians(node)),
    )
    return satellite
