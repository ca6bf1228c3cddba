"""GenICam description of the camera: the register of each feature, for generic clients."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path
from typing import TYPE_CHECKING
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from flyaround.hil.host.camera_endpoint.gvsp import formats_of
from flyaround.hil.host.camera_endpoint.registers import (
    EXPOSURE_US,
    GAIN_DB,
    HEARTBEAT_MS,
    MIN_SIDE_PX,
    PACKET_BYTES,
    RATE_HZ,
    TICKS_PER_S,
    Register,
)
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import read_regular

if TYPE_CHECKING:
    from flyaround.hil.host.camera_endpoint.registers import CameraTerms

# Maximum size of a user's description [bytes]: of its file, and of the unpacked text.
MAX_XML_BYTES, MAX_UNZIPPED_BYTES = 1 << 20, 8 << 20

# Maximum nesting of its elements; real descriptions are far flatter.
MAX_DEPTH = 32
OWN_NAME = "flyaround.xml"


def read_xml(path: Path) -> tuple[str, bytes]:
    """Read and check a user's GenICam description.

    Returns
    -------
    name : str
        Served name: the file's name without characters other than ASCII letters, digits, dots, hyphens and underscores.
    data : bytes
        Content of the file; a zip file is not unpacked.

    Raises
    ------
    UserError
        If the file cannot be read, is too long, is neither .xml nor .zip, or is not a RegisterDescription that every
        client can parse. Document types are refused, because expanding entities could exhaust a client's memory.
    """
    if path.suffix.lower() not in {".xml", ".zip"}:
        raise UserError(f"{path} is neither .xml nor .zip: a GenICam description is served as one of them")
    try:
        data = read_regular(path, MAX_XML_BYTES)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror}): name a GenICam description") from error
    _check_description(path, _unzipped(path, data) if path.suffix.lower() == ".zip" else data)
    name = "".join(c for c in path.name if c.isascii() and (c.isalnum() or c in "._-"))
    return name, data


def _unzipped(path: Path, data: bytes) -> bytes:
    """Return the only file of a zip archive.

    Raises
    ------
    UserError
        If the archive is damaged or holds another number of files, or the file is too long.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = archive.namelist()
            if len(names) != 1:
                raise UserError(f"{path} holds {len(names)} files: put the GenICam description alone into it")
            with archive.open(names[0]) as inner:
                text = inner.read(MAX_UNZIPPED_BYTES + 1)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error) as error:
        raise UserError(f"{path} is damaged ({error}): zip the GenICam description again") from error
    if len(text) > MAX_UNZIPPED_BYTES:
        raise UserError(
            f"{path} unpacks to more than {MAX_UNZIPPED_BYTES >> 20} MiB: shorten the description"
        )
    return text


def _check_description(path: Path, text: bytes) -> None:
    parser = expat.ParserCreate()
    roots: list[str] = []
    open_elements = 0

    def begin(name: str, _attributes: object) -> None:
        nonlocal open_elements
        open_elements += 1
        if not roots:
            roots.append(name)
        if open_elements > MAX_DEPTH:
            raise UserError(f"{path} nests elements deeper than {MAX_DEPTH}: GenICam descriptions do not")

    def end(_name: str) -> None:
        nonlocal open_elements
        open_elements -= 1

    def refuse(*_: object) -> None:
        raise UserError(f"{path} has a document type, which may declare entities: leave <!DOCTYPE ...> out")

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise UserError(f"{path} is not XML ({error}): correct it") from error
    if roots != ["RegisterDescription"]:
        raise UserError(
            f"{path} is not a GenICam description: its outermost element is {roots[0]}, not RegisterDescription"
        )


def write_xml(terms: CameraTerms) -> bytes:
    """Return the GenICam description of this camera's registers in `Register`.

    Returns
    -------
    bytes
        XML document, UTF-8.
    """
    nodes: list[str] = []
    categories: dict[str, list[str]] = {}

    def feature(category: str, name: str, node: str) -> None:
        categories.setdefault(category, []).append(name)
        nodes.append(node)

    def integer(
        category: str,
        name: str,
        register: Register,
        limits: tuple[object, object] | None = None,
        access: str = "RW",
        increment: int = 1,
    ) -> None:
        feature(category, name, _integer(name, limits, increment))
        nodes.append(_register(name, register, access))

    def number(category: str, name: str, register: Register, limits: tuple[float, float], unit: str) -> None:
        feature(
            category,
            name,
            f'<Float Name="{name}"><pValue>{name}Reg</pValue><Min>{limits[0]:g}</Min><Max>{limits[1]:g}</Max>'
            f"<Unit>{unit}</Unit></Float>",
        )
        nodes.append(_register(name, register, "RW", "FloatReg"))

    def choice(category: str, name: str, register: Register, entries: dict[str, int]) -> None:
        listed = "".join(
            f'<EnumEntry Name="{entry}"><Value>{value}</Value></EnumEntry>'
            for entry, value in entries.items()
        )
        feature(
            category, name, f'<Enumeration Name="{name}">{listed}<pValue>{name}Reg</pValue></Enumeration>'
        )
        nodes.append(_register(name, register, "RW"))

    def command(category: str, name: str, register: Register) -> None:
        feature(
            category,
            name,
            f'<Command Name="{name}"><pValue>{name}Reg</pValue><CommandValue>1</CommandValue></Command>',
        )
        nodes.append(_register(name, register, "RW"))

    def text(category: str, name: str, address: int, size: int, access: str = "RO") -> None:
        feature(
            category,
            name,
            f'<StringReg Name="{name}"><Address>0x{address:X}</Address><Length>{size}</Length>'
            f"<AccessMode>{access}</AccessMode><pPort>Device</pPort></StringReg>",
        )

    text("DeviceControl", "DeviceVendorName", 0x48, 32)
    text("DeviceControl", "DeviceModelName", 0x68, 32)
    text("DeviceControl", "DeviceVersion", 0x88, 32)
    text("DeviceControl", "DeviceManufacturerInfo", 0xA8, 48)
    text("DeviceControl", "DeviceID", 0xD8, 16)
    text("DeviceControl", "DeviceUserID", 0xE8, 16, "RW")

    integer("ImageFormatControl", "SensorWidth", Register.SENSOR_WIDTH, access="RO")
    integer("ImageFormatControl", "SensorHeight", Register.SENSOR_HEIGHT, access="RO")
    for side, across in (("Width", "X"), ("Height", "Y")):
        offset, size = Register[f"OFFSET_{across}"], Register[side.upper()]
        feature(
            "ImageFormatControl",
            f"{side}Max",
            _difference(f"{side}Max", f"Sensor{side}", f"Offset{across}"),
        )
        nodes.append(_difference(f"Offset{across}Max", f"Sensor{side}", side))
        integer("ImageFormatControl", side, size, (MIN_SIDE_PX, f"{side}Max"))
        integer("ImageFormatControl", f"Offset{across}", offset, (0, f"Offset{across}Max"))
    choice(
        "ImageFormatControl",
        "PixelFormat",
        Register.PIXEL_FORMAT,
        {f.name: int(f) for f in formats_of(terms.bits)},
    )

    modes = {"Continuous": 0, "SingleFrame": 1, "MultiFrame": 2}
    choice("AcquisitionControl", "AcquisitionMode", Register.ACQUISITION_MODE, modes)
    command("AcquisitionControl", "AcquisitionStart", Register.ACQUISITION_START)
    command("AcquisitionControl", "AcquisitionStop", Register.ACQUISITION_STOP)
    integer("AcquisitionControl", "AcquisitionFrameCount", Register.ACQUISITION_FRAME_COUNT, (1, 0xFFFF))
    number("AcquisitionControl", "AcquisitionFrameRate", Register.ACQUISITION_FRAME_RATE, RATE_HZ, "Hz")
    feature(
        "AcquisitionControl",
        "TriggerSelector",
        '<Enumeration Name="TriggerSelector"><EnumEntry Name="FrameStart"><Value>0</Value></EnumEntry>'
        "<Value>0</Value></Enumeration>",
    )
    choice("AcquisitionControl", "TriggerMode", Register.TRIGGER_MODE, {"Off": 0, "On": 1})
    choice("AcquisitionControl", "TriggerSource", Register.TRIGGER_SOURCE, {"Software": 0})
    command("AcquisitionControl", "TriggerSoftware", Register.TRIGGER_SOFTWARE)
    number("AcquisitionControl", "ExposureTime", Register.EXPOSURE_TIME, EXPOSURE_US, "us")
    number("AnalogControl", "Gain", Register.GAIN, GAIN_DB, "dB")

    integer("TransportLayerControl", "PayloadSize", Register.PAYLOAD_SIZE, access="RO")
    integer("TransportLayerControl", "TLParamsLocked", Register.TRANSPORT_LOCKED, (0, 1))
    integer("TransportLayerControl", "GevSCPHostPort", Register.STREAM_PORT, (0, 0xFFFF))
    feature(
        "TransportLayerControl",
        "GevSCPSPacketSize",
        _integer("GevSCPSPacketSize", PACKET_BYTES, 4)
        + _bits("GevSCPSPacketSize", Register.STREAM_PACKET_BYTES, 31, 16),
    )
    for name, bit in (("GevSCPSFireTestPacket", 0), ("GevSCPSDoNotFragment", 1)):
        feature(
            "TransportLayerControl",
            name,
            f'<Boolean Name="{name}"><pValue>{name}Reg</pValue></Boolean>'
            + _bits(name, Register.STREAM_PACKET_BYTES, bit, bit),
        )
    integer("TransportLayerControl", "GevSCPD", Register.STREAM_PACKET_DELAY, (0, TICKS_PER_S // 1000))
    integer("TransportLayerControl", "GevSCDA", Register.STREAM_ADDRESS, (0, 0xFFFFFFFF))
    integer("TransportLayerControl", "GevStreamChannelCount", Register.N_STREAM_CHANNELS, access="RO")
    integer("TransportLayerControl", "GevHeartbeatTimeout", Register.HEARTBEAT_MS, HEARTBEAT_MS)
    privileges = {"OpenAccess": 0, "ExclusiveAccess": 1, "ControlAccess": 2}
    choice("TransportLayerControl", "GevCCP", Register.CONTROL_PRIVILEGE, privileges)
    integer("TransportLayerControl", "GevTimestampTickFrequency", Register.TICKS_LOW, access="RO")

    groups = "".join(
        f'<Category Name="{name}">' + "".join(f"<pFeature>{f}</pFeature>" for f in features) + "</Category>"
        for name, features in categories.items()
    )
    root = "".join(f"<pFeature>{name}</pFeature>" for name in categories)
    body = "\n".join(nodes)
    tooltip = quoteattr(f"A camera that Flyaround simulates: {terms.scenario}")
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n'
        '<RegisterDescription ModelName="SimulatedCamera" VendorName="Flyaround" StandardNameSpace="None"'
        ' SchemaMajorVersion="1" SchemaMinorVersion="1" SchemaSubMinorVersion="0" MajorVersion="1"'
        f' MinorVersion="0" SubMinorVersion="0" ToolTip={tooltip}'
        ' ProductGuid="6b3f7d52-7a0e-4b6e-9d61-0f1c6a5e2b10" VersionGuid="e4c0b3a8-50c2-4d0b-8f0e-7f5d1a9c3b21"'
        ' xmlns="http://www.genicam.org/GenApi/Version_1_1">\n'
        f'<Category Name="Root">{root}</Category>\n{groups}\n{body}\n<Port Name="Device"></Port>\n'
        "</RegisterDescription>\n"
    ).encode()


def _integer(name: str, limits: tuple[object, object] | None, increment: int) -> str:
    limits_xml = ""
    if limits is not None:
        least, most = limits
        highest = f"<pMax>{escape(most)}</pMax>" if isinstance(most, str) else f"<Max>{most}</Max>"
        limits_xml = f"<Min>{least}</Min>{highest}<Inc>{increment}</Inc>"
    return f'<Integer Name="{name}"><pValue>{name}Reg</pValue>{limits_xml}</Integer>'


def _register(name: str, register: Register, access: str, kind: str = "IntReg") -> str:
    sign = "<Sign>Unsigned</Sign>" if kind == "IntReg" else ""
    return (
        f'<{kind} Name="{name}Reg"><Address>0x{int(register):X}</Address><Length>4</Length>'
        f"<AccessMode>{access}</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>{sign}"
        f"<Endianess>BigEndian</Endianess></{kind}>"
    )


def _bits(name: str, register: Register, lowest: int, highest: int) -> str:
    """Return the XML of some bits of a register, counted from the most significant bit (big-endian)."""
    bit_range = f"<Bit>{lowest}</Bit>" if lowest == highest else f"<LSB>{lowest}</LSB><MSB>{highest}</MSB>"
    return (
        f'<MaskedIntReg Name="{name}Reg"><Address>0x{int(register):X}</Address><Length>4</Length>'
        f"<AccessMode>RW</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>{bit_range}"
        "<Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></MaskedIntReg>"
    )


def _difference(name: str, minuend: str, part: str) -> str:
    return (
        f'<IntSwissKnife Name="{name}"><pVariable Name="WHOLE">{minuend}</pVariable>'
        f'<pVariable Name="PART">{part}</pVariable><Formula>WHOLE-PART</Formula></IntSwissKnife>'
    )
