"""Orbit files of a scenario: detection of their format, and the ephemeris or state that they give."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import decode_text
from flyaround.simulator.world.ephemeris.body import body_named
from flyaround.simulator.world.messages.ccsds import Segment, first_line, read_segments
from flyaround.simulator.world.messages.ccsds_frames import state_in_gcrf
from flyaround.simulator.world.messages.ephemeris import ROUNDING_S, Ephemeris
from flyaround.simulator.world.messages.ndm_xml import read_ndm
from flyaround.simulator.world.messages.oem import ephemeris_from, one_object
from flyaround.simulator.world.messages.omm import read_csv_objects, read_json_objects, satellite_from_omm
from flyaround.simulator.world.messages.state_message import (
    OrbitParameters,
    is_state_message,
    read_fields,
    read_opm,
)
from flyaround.simulator.world.messages.tle import (
    choose_set,
    is_element_file,
    read_element_sets,
    sgp4_state,
    state_from_tle,
)
from flyaround.simulator.world.orbit.propagation import Elements, state_from_elements
from flyaround.simulator.world.relative.yamanaka_ankersen import true_anomaly_after

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.world.time.instant import Instant

    State = tuple[FloatArray, FloatArray]

log = logging.getLogger(__name__)

_BINARY_SIGNATURES = (
    (b"DAF/SPK", "an SPK kernel (.bsp)", "write an OEM of it with SPICE's spk2oem or GMAT"),
    (b"NAIF/DAF", "a SPICE kernel", "write an OEM of it with SPICE's spk2oem or GMAT"),
    (b"DAF/", "a SPICE kernel", "write an OEM of the SPK with SPICE's spk2oem or GMAT"),
    (b"\x1f\x8b", "compressed by gzip", "unpack it"),
    (b"PK\x03\x04", "a zip archive", "unpack it"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd", "unpack it"),
)
_TEXT_SIGNATURES = (
    ("stk.v.", "an STK ephemeris (.e), which GMAT writes too", "export it as a CCSDS OEM"),
    (("#a", "#b", "#c", "#d"), "an SP3 orbit file", "convert it to a CCSDS OEM"),
    (("H1 CPF", "h1 cpf"), "a CPF laser-ranging prediction", "convert it to a CCSDS OEM"),
    ("CCSDS_OCM_VERS", "a CCSDS OCM", "export it as an OEM"),
    ("CCSDS_AEM_VERS", "a CCSDS AEM, an attitude", "name it by attitude.aem_file"),
    ("CCSDS_APM_VERS", "a CCSDS APM, an attitude", "give an OEM"),
    ("CCSDS_TDM_VERS", "a CCSDS TDM, tracking data", "give an OEM"),
    ("CCSDS_CDM_VERS", "a CCSDS CDM, a conjunction", "give an OEM"),
    ("<!DOCTYPE", "a web page or XML with a DTD", "download the file itself"),
    ("<html", "a web page", "download the file itself"),
    ("DAFETF NAIF", "an SPK kernel in transfer form (.xsp)", "write an OEM of it with SPICE's spk2oem"),
    ("<> ", "a vector covariance message (VCM)", "convert it to a CCSDS OEM or OPM"),
    ("*****", "Horizons' text", "set its format to OEM, or write an OEM of its vectors"),
    ("API VERSION", "Horizons' text", "write a CCSDS OEM of its vectors"),
)
_TEXT_MARKERS = (
    ("$$SOE", "Horizons' text", "write a CCSDS OEM of its vectors"),
    ("BEGIN Ephemeris", "an STK ephemeris (.e)", "export it as a CCSDS OEM"),
    ("RINEX VERSION", "a RINEX file", "convert it to a CCSDS OEM"),
)

_ORBIT_TOLERANCE = 0.01
"""Relative tolerance between the position of a state and of its Keplerian elements, because both are rounded."""

SUPPORTED_FORMATS = "CCSDS OEM, OPM and OMM (key = value or XML), OMM as JSON or CSV, and two-line elements"


def read_orbit_file(
    data: bytes, source: str, epoch: Instant, *, centre: str = "earth", satellite: str | None = None
) -> Ephemeris | State:
    """Read an orbit file: an ephemeris, or position [m] and velocity [m s-1] in GCRS at the epoch.

    Parameters
    ----------
    data : bytes
        Contents of the file.
    source : str
        Name of the file in error messages.
    epoch : Instant
        Origin of times.
    centre : str, optional
        Required central body.
    satellite : str, optional
        Name or number, if there are several.

    Raises
    ------
    UserError
        If the format is not supported (the message names it), or the file has a mistake.
    """
    text = _decode(data, source)
    start = first_line(text)
    is_text, is_xml = start.startswith("CCSDS_OEM_VERS"), start.startswith("<")
    if is_text or is_xml:
        kind, segments = ("oem", read_segments(text, source, "OEM")) if is_text else read_ndm(text, source)
        if kind == "oem":
            states = ephemeris_from(segments, source, epoch, centre=centre.upper(), satellite=satellite)
            states.refuse_impossible(body_named(centre))
            return states
        segment = _select_segment(segments, source, satellite)
        return _opm_state(segment, epoch, centre) if kind == "opm" else _omm_state(segment, epoch, centre)
    if is_state_message(text, "OPM"):
        return _opm_state(read_fields(text, source, "OPM"), epoch, centre)
    if is_state_message(text, "OMM"):
        return _omm_state(read_fields(text, source, "OMM"), epoch, centre)
    if start.startswith(("{", "[")):
        return _omm_state(_select_segment(read_json_objects(text, source), source, satellite), epoch, centre)
    if "MEAN_MOTION" in start and "," in start:
        return _omm_state(_select_segment(read_csv_objects(text, source), source, satellite), epoch, centre)
    if is_element_file(text):
        _require_earth(centre, source, "two-line elements are")
        elements = choose_set(read_element_sets(text, source), satellite, source)
        return state_from_tle(elements.line1, elements.line2, epoch)
    hint = " (its keys must be in capitals)" if start.upper().startswith("CCSDS_") else ""
    raise UserError(f"{source} is not in a known orbit format{hint}: supported are {SUPPORTED_FORMATS}")


def _decode(data: bytes, source: str) -> str:
    """Decode a text file; raise if it is in a format that is recognised but not supported."""
    for magic, kind, way_out in _BINARY_SIGNATURES:
        if data.startswith(magic):
            raise UserError(f"{source} is {kind}: {way_out}")
    text = decode_text(data, source)
    start = first_line(text)
    if not start:
        raise UserError(f"{source} is empty: supported are {SUPPORTED_FORMATS}")
    matches = [row[1:] for row in _TEXT_SIGNATURES if start.startswith(row[0])]
    matches += [row[1:] for row in _TEXT_MARKERS if row[0] in text[:100_000]]
    for what, remedy in matches:
        raise UserError(f"{source} is {what}, which is not supported: {remedy}")
    return text


def _select_segment(segments: list[Segment], source: str, satellite: str | None) -> Segment:
    """Return the selected object, or the only one."""
    by_number = [
        s
        for s in segments
        if satellite and s.meta.get("NORAD_CAT_ID", "").lstrip("0") == satellite.lstrip("0")
    ]
    selected = by_number or one_object(segments, source, satellite)
    if len(selected) > 1:
        raise UserError(
            f"{source} has {len(selected)} sets of elements of one object: keep the one nearest to the epoch"
        )
    return selected[0]


def _require_earth(centre: str, source: str, what: str) -> None:
    if centre != "earth":
        raise UserError(f"{source}: {what} about the Earth, and orbit.centre is {centre}: remove the key")


def _omm_state(segment: Segment, epoch: Instant, centre: str) -> State:
    _require_earth(centre, segment.where, "mean elements for SGP4 are")
    return sgp4_state(satellite_from_omm(segment), epoch, f"the mean elements of {segment.where}")


def _opm_state(segment: Segment, epoch: Instant, centre: str) -> State:
    opm, source = read_opm(segment), segment.where
    body = body_named(centre)
    if opm.centre != centre.upper():
        raise UserError(f"{source}: CENTER_NAME is {opm.centre}, allowed: {centre.upper()} (orbit.centre)")
    if abs(opm.epoch.minus(epoch)) > ROUNDING_S:
        raise UserError(
            f"{source} has the state of {opm.epoch.iso()}, and the scenario starts at {epoch.iso()}: set epoch_utc to "
            "the state's, or give an OEM"
        )
    r, v = opm.state or _state_of_elements(opm, body.mu_m3_s2)
    if opm.state is not None and opm.elements is not None:
        r_from_elements = _state_of_elements(opm, body.mu_m3_s2)[0]
        if float(np.linalg.norm(r_from_elements - r)) > _ORBIT_TOLERANCE * float(np.linalg.norm(r)):
            raise UserError(
                f"{source}: the Keplerian elements put the craft {np.linalg.norm(r_from_elements - r) / 1e3:.0f} km "
                "from X, Y, Z: remove those that are wrong"
            )
    if opm.unused:
        log.warning("%s has %s: not used", source, ", ".join(opm.unused))
    return state_in_gcrf(opm.frame, opm.frozen, r, v)


def _state_of_elements(opm: OrbitParameters, mu_m3_s2: float) -> State:
    assert opm.elements is not None  # noqa: S101 - an OPM has one of the two
    (a, e, i, node, argp, anomaly), mean, gm = opm.elements
    mu = mu_m3_s2 if gm is None else gm
    orbit = Elements(
        semi_major_axis_m=a,
        eccentricity=e,
        inclination_rad=i,
        raan_rad=node,
        argument_of_perigee_rad=argp,
        true_anomaly_rad=0.0 if mean else anomaly,
    )
    if mean:
        orbit = replace(orbit, true_anomaly_rad=true_anomaly_after(orbit, anomaly / np.sqrt(mu / a**3), mu))
    return state_from_elements(orbit, mu)
