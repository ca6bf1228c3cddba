"""Truth, answers and timing as CCSDS space packets, with an XTCE description for COSMOS and YAMCS.

Packets: CCSDS 133.0-B-2. Time: CCSDS 301.0-B-4, day segmented (CDS), days since 1958-01-01, milliseconds of the day,
microseconds of the millisecond; mid-exposure of the frame. Numbers are big-endian. Needs the optional dependency
``logs``.
"""

from __future__ import annotations

import math
import socket
import struct
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from flyaround.hil.host.frame_record import DURATIONS
from flyaround.hil.host.truth_policy import is_loopback
from flyaround.simulator.errors import UserError, missing_extra
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.world.time.instant import nanoseconds_utc

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.frame import Frame

XTCE_NAMESPACE = "http://www.omg.org/spec/XTCE/20180204"

# CDS time: P-field, days, milliseconds of the day, microseconds of the millisecond (CCSDS 301.0-B-4).
TIME = struct.Struct(">BHIH")

# P-field: day segmented, epoch 1958, 16-bit days, 16-bit microseconds of the millisecond.
CDS_PFIELD = 0x41

# 1958-01-01 in days since 1970-01-01.
UNIX_DAY_1958 = -4383

OUTCOMES = ("accepted", "declined", "dropped")


@dataclass(frozen=True)
class PacketField:
    """Numeric field of a packet: name, size in bits, XTCE kind and unit."""

    name: str
    bits: int
    kind: str
    unit: str = ""

    @property
    def code(self) -> str:
        """Format character for `struct`."""
        return {("float", 64): "d", ("uint", 32): "I", ("uint", 8): "B", ("enum", 8): "B"}[
            self.kind, self.bits
        ]


@dataclass(frozen=True)
class PacketKind:
    """Type of packet: name, application process and the fields after the time."""

    name: str
    apid: int
    fields: tuple[PacketField, ...]

    @property
    def layout(self) -> struct.Struct:
        """Binary layout of the fields."""
        return struct.Struct(">" + "".join(field.code for field in self.fields))


def _floats(*names: str, unit: str = "") -> tuple[PacketField, ...]:
    return tuple(PacketField(name, 64, "float", unit) for name in names)


_FRAME = PacketField("frame_id", 32, "uint")
_POSE = _floats("q_w", "q_x", "q_y", "q_z") + _floats("t_x_m", "t_y_m", "t_z_m", unit="m")

KINDS = {
    "TRUTH": PacketKind("TRUTH", 0x101, (_FRAME, *_POSE)),
    "ESTIMATE": PacketKind(
        "ESTIMATE",
        0x102,
        (
            _FRAME,
            PacketField("outcome", 8, "enum"),
            *_POSE,
            *_floats("confidence"),
            *_floats("position_error_m", unit="m"),
            *_floats("attitude_error_deg", unit="deg"),
        ),
    ),
    "TIMING": PacketKind("TIMING", 0x103, (_FRAME, *_floats(*DURATIONS, unit="ms"))),
}
"""All packets. A pose is ``camera_from_target``; unknown values are NaN."""


def cds_time(epoch_utc: str) -> bytes:
    """Return a UTC time as eight bytes of CDS, after its P-field."""
    days, nanoseconds = divmod(nanoseconds_utc(epoch_utc), 86_400_000_000_000)
    ms, ns = divmod(nanoseconds, 1_000_000)
    return TIME.pack(CDS_PFIELD, days - UNIX_DAY_1958, ms, ns // 1000)


class SpacePacketSink:
    """Sink of packets: a file, or UDP datagrams.

    Parameters
    ----------
    target : str
        Path of a file, or ``udp://HOST:PORT`` on this machine.
    xtce : Path, optional
        Path of the XTCE description; by default next to the file.

    Raises
    ------
    UserError
        If the optional dependency is not installed, the file exists, or the address belongs to another machine: packets
        carry the truth, and datagrams cannot be authenticated.
    """

    def __init__(self, target: str, xtce: Path | None = None) -> None:
        from pathlib import Path  # noqa: PLC0415 - at run time needed here only

        try:
            from spacepackets.ccsds.spacepacket import PacketType, SpacePacketHeader  # noqa: PLC0415 - optional dependency
        except ImportError as error:
            raise missing_extra("--ccsds", "logs", error) from error
        self._header, self._telemetry = SpacePacketHeader, PacketType.TM
        self._counts = dict.fromkeys(KINDS, 0)
        self._socket: socket.socket | None = None
        self._file: Any = None
        if target.startswith("udp://"):
            parts = urlsplit(target)
            if not parts.hostname or parts.port is None:
                raise UserError(f"{target} is not an address: write udp://127.0.0.1:PORT")
            if not is_loopback(parts.hostname, parts.port):
                raise UserError(
                    f"{target} is another machine: packets carry the truth, and their receiver is not authenticated: "
                    "send them to 127.0.0.1, or write a file"
                )
            self._address = (parts.hostname, parts.port)
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        else:
            path = Path(target)
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                self._file = path.open("xb", buffering=0)
            except FileExistsError as error:
                raise UserError(f"{path} exists already: name another file") from error
            xtce = path.with_suffix(".xtce.xml") if xtce is None else xtce
        if xtce is not None:
            write_atomic(xtce, xtce_document())

    def frame(self, frame: Frame) -> None:
        """Write the true pose of a frame."""
        if frame.truth is not None:
            truth = frame.truth
            values = (frame.number, *truth.q_camera_from_target_wxyz, *truth.t_camera_from_target_m)
            self._send("TRUTH", frame.scene.epoch_utc, values)

    def row(self, frame: Frame, row: FrameRecord) -> None:
        """Write the answer to a frame, and its times."""
        nan = math.nan
        outcome = OUTCOMES.index(row.outcome.split(":")[0])
        pose = (*(row.q_wxyz or (nan,) * 4), *(row.t_m or (nan,) * 3))
        rest = [nan if v is None else v for v in (row.confidence, row.E_T_m, row.E_R_deg)]
        epoch = frame.scene.epoch_utc
        self._send("ESTIMATE", epoch, (row.frame_id, outcome, *pose, *rest))
        times = [getattr(row, name) for name in DURATIONS]
        self._send("TIMING", epoch, (row.frame_id, *(nan if v is None else v for v in times)))

    def _send(self, name: str, epoch_utc: str, values: tuple[float, ...]) -> None:
        kind = KINDS[name]
        data = cds_time(epoch_utc) + kind.layout.pack(*values)
        header = self._header(
            self._telemetry, kind.apid, self._counts[name], len(data) - 1, sec_header_flag=True
        )
        self._counts[name] = (self._counts[name] + 1) & 0x3FFF
        packet = bytes(header.pack()) + data
        if self._socket is not None:
            self._socket.sendto(packet, self._address)
        else:
            self._file.write(packet)

    def close(self) -> None:
        """Close the file or socket."""
        if self._socket is not None:
            self._socket.close()
        if self._file is not None:
            self._file.close()


def xtce_document() -> bytes:
    """Return the XTCE 1.2 (OMG) description: an abstract container, and three that restrict its APID."""
    ET.register_namespace("xtce", XTCE_NAMESPACE)
    system = _element(None, "SpaceSystem", name="Flyaround")
    telemetry = _element(system, "TelemetryMetaData")
    types = _element(telemetry, "ParameterTypeSet")
    parameters = _element(telemetry, "ParameterSet")
    containers = _element(telemetry, "ContainerSet")
    heads = (
        ("VERSION", 3),
        ("TYPE", 1),
        ("SEC_HDR_FLG", 1),
        ("PKT_APID", 11),
        ("SEQ_FLGS", 2),
        ("SRC_SEQ_CTR", 14),
        ("PKT_LEN", 16),
        ("CDS_PFIELD", 8),
        ("CDS_DAYS", 16),
        ("CDS_MS_OF_DAY", 32),
        ("CDS_US_OF_MS", 16),
    )
    base = _element(containers, "SequenceContainer", name="CCSDSPacket", abstract="true")
    entries = _element(base, "EntryList")
    for name, bits in heads:
        _parameter(types, parameters, entries, name, PacketField(name, bits, "uint"))
    for kind in KINDS.values():
        container = _element(containers, "SequenceContainer", name=kind.name)
        entries = _element(container, "EntryList")
        for field in kind.fields:
            _parameter(types, parameters, entries, f"{kind.name}_{field.name}", field)
        parent = _element(container, "BaseContainer", containerRef="CCSDSPacket")
        criteria = _element(parent, "RestrictionCriteria")
        _element(
            criteria, "Comparison", parameterRef="PKT_APID", value=str(kind.apid), useCalibratedValue="false"
        )
    ET.indent(system)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(system) + b"\n"


def _element(parent: ET.Element | None, tag: str, **attributes: str) -> ET.Element:
    name = f"{{{XTCE_NAMESPACE}}}{tag}"
    return ET.Element(name, attributes) if parent is None else ET.SubElement(parent, name, attributes)


def _parameter(
    types: ET.Element, parameters: ET.Element, entries: ET.Element, name: str, field: PacketField
) -> None:
    kind = {"float": "FloatParameterType", "uint": "IntegerParameterType", "enum": "EnumeratedParameterType"}
    signed = {"signed": "false"} if field.kind == "uint" else {}
    size = {"sizeInBits": str(field.bits)} if field.kind == "float" else {}
    type_element = _element(types, kind[field.kind], name=f"{name}_Type", **signed, **size)
    units = _element(type_element, "UnitSet")
    if field.unit:
        _element(units, "Unit").text = field.unit
    if field.kind == "float":
        _element(type_element, "FloatDataEncoding", sizeInBits=str(field.bits))
    else:
        _element(type_element, "IntegerDataEncoding", sizeInBits=str(field.bits), encoding="unsigned")
    if field.kind == "enum":
        labels = _element(type_element, "EnumerationList")
        for value, label in enumerate(OUTCOMES):
            _element(labels, "Enumeration", value=str(value), label=label)
    _element(parameters, "Parameter", name=name, parameterTypeRef=f"{name}_Type")
    _element(entries, "ParameterRefEntry", parameterRef=name)
