"""Registers of the camera, read and written by address, with validated values.

The addresses of the first block are those of public descriptions (Aravis's ``arvgvcp.h``). From 0xA000 on they are
specific to this camera; docs/hil_camera.md lists them for authors of their own XML.
"""

from __future__ import annotations

import ipaddress
import math
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from flyaround.hil.host.camera_endpoint.gvcp import MAX_MEMORY_BYTES, RefusedError, Status
from flyaround.hil.host.camera_endpoint.gvsp import ReadoutRegion, StreamFormat, formats_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.host.camera_endpoint.interface import Interface

# Minimum side of the read region [px].
MIN_SIDE_PX = 16

# Allowed values of the writable settings, lowest and highest: ranges of an industrial camera. Packets lie between the
# largest datagram that every IPv4 host accepts (576 bytes, RFC 791) and a jumbo frame.
EXPOSURE_US = (1.0, 1e6)
GAIN_DB = (0.0, 24.0)
RATE_HZ = (0.1, 120.0)
PACKET_BYTES = (576, 9000)
HEARTBEAT_MS = (500, 60_000)

# Frequency of the time stamp counter [Hz]: ticks are nanoseconds.
TICKS_PER_S = 1_000_000_000

# Address of the GenICam description, behind all registers.
XML_ADDRESS = 0x100000

# Bits of the control privilege.
EXCLUSIVE, CONTROL = 1, 2

# Values of the acquisition mode.
CONTINUOUS, SINGLE_FRAME, MULTI_FRAME = 0, 1, 2

# Bits of the packet size register.
FIRE_TEST_PACKET, DO_NOT_FRAGMENT = 1 << 31, 1 << 30


class Register(IntEnum):
    """Addresses of four-byte registers."""

    VERSION = 0x0000
    DEVICE_MODE = 0x0004
    MAC_HIGH = 0x0008
    MAC_LOW = 0x000C
    IP_OPTIONS = 0x0010
    IP_CONFIGURATION = 0x0014
    IP_ADDRESS = 0x0024
    IP_MASK = 0x0034
    N_INTERFACES = 0x0600
    N_MESSAGE_CHANNELS = 0x0900
    N_STREAM_CHANNELS = 0x0904
    CAPABILITY = 0x0934
    HEARTBEAT_MS = 0x0938
    TICKS_HIGH = 0x093C
    TICKS_LOW = 0x0940
    TIMESTAMP_CONTROL = 0x0944
    TIMESTAMP_HIGH = 0x0948
    TIMESTAMP_LOW = 0x094C
    CONTROL_PRIVILEGE = 0x0A00
    CONTROLLER_PORT = 0x0A04
    CONTROLLER_ADDRESS = 0x0A14
    STREAM_PORT = 0x0D00
    STREAM_PACKET_BYTES = 0x0D04
    STREAM_PACKET_DELAY = 0x0D08
    STREAM_ADDRESS = 0x0D18
    STREAM_SOURCE_PORT = 0x0D1C
    SENSOR_WIDTH = 0xA000
    SENSOR_HEIGHT = 0xA004
    OFFSET_X = 0xA008
    OFFSET_Y = 0xA00C
    WIDTH = 0xA010
    HEIGHT = 0xA014
    PIXEL_FORMAT = 0xA018
    PAYLOAD_SIZE = 0xA01C
    ACQUISITION_MODE = 0xA020
    ACQUISITION_START = 0xA024
    ACQUISITION_STOP = 0xA028
    ACQUISITION_FRAME_COUNT = 0xA02C
    ACQUISITION_FRAME_RATE = 0xA030
    TRIGGER_MODE = 0xA034
    TRIGGER_SOURCE = 0xA038
    TRIGGER_SOFTWARE = 0xA03C
    EXPOSURE_TIME = 0xA040
    GAIN = 0xA044
    TRANSPORT_LOCKED = 0xA048
    FRAMES_SENT = 0xA04C


# Size of the answer to a discovery [bytes].
DISCOVERY_BYTES = 0xF8

# Addresses and sizes [bytes] of the texts: user-defined name, and URL of the description.
USER_NAME, USER_NAME_BYTES = 0x00E8, 16
XML_URL, URL_BYTES = 0x0200, 512

# Start address and size [bytes] of each block of registers.
_BLOCKS = ((0x0000, 0x0B20), (0x0D00, 0x0040), (0xA000, 0x0050))
_STREAM_SETTINGS = (Register.WIDTH, Register.HEIGHT, Register.PIXEL_FORMAT, Register.STREAM_PACKET_BYTES)
# Supported: concatenation, write memory, packet resend, serial number, user-defined name
_CAPABILITY = 1 << 0 | 1 << 1 | 1 << 2 | 1 << 30 | 1 << 31


@dataclass(frozen=True, kw_only=True)
class CameraTerms:
    """Properties of the simulated camera.

    Parameters
    ----------
    width_px : int
        Width of the detector.
    height_px : int
        Height of the detector.
    bits : int
        Bits per pixel of the detector.
    exposure_us : float
        Initial exposure time.
    rate_hz : float
        Initial frame rate.
    scenario : str
        Name of the scenario.
    target : str
        Name of the target.
    """

    width_px: int
    height_px: int
    bits: int
    exposure_us: float
    rate_hz: float
    scenario: str
    target: str


class Registers:
    """Register memory of the camera.

    Parameters
    ----------
    terms : CameraTerms
        Properties of the simulated camera.
    interface : Interface
        Network interface of the endpoint.
    source_port : int
        Port from which the stream is sent.
    xml : bytes
        GenICam description that is served.
    xml_name : str
        File name under which it is served.
    """

    def __init__(
        self, terms: CameraTerms, interface: Interface, source_port: int, xml: bytes, xml_name: str
    ) -> None:
        self.terms = terms
        self.formats = formats_of(terms.bits)
        self.acquiring = False
        self._xml = xml + bytes(-len(xml) % 4)
        self._blocks = [(start, bytearray(size)) for start, size in _BLOCKS]
        mac = interface.mac
        values = {
            Register.VERSION: 1 << 16,
            Register.DEVICE_MODE: 0x80000001,
            Register.MAC_HIGH: int.from_bytes(mac[:2], "big"),
            Register.MAC_LOW: int.from_bytes(mac[2:], "big"),
            Register.IP_OPTIONS: 1,
            Register.IP_CONFIGURATION: 1,
            Register.IP_ADDRESS: int(ipaddress.IPv4Address(interface.address)),
            Register.IP_MASK: int(ipaddress.IPv4Address(interface.mask)),
            Register.N_INTERFACES: 1,
            Register.N_STREAM_CHANNELS: 1,
            Register.CAPABILITY: _CAPABILITY,
            Register.HEARTBEAT_MS: 3000,
            Register.TICKS_LOW: TICKS_PER_S,
            Register.STREAM_PACKET_BYTES: min(1500, interface.mtu) & ~3,
            Register.STREAM_SOURCE_PORT: source_port,
            Register.SENSOR_WIDTH: terms.width_px,
            Register.SENSOR_HEIGHT: terms.height_px,
            Register.WIDTH: terms.width_px,
            Register.HEIGHT: terms.height_px,
            Register.PIXEL_FORMAT: int(self.formats[0]),
            Register.ACQUISITION_FRAME_COUNT: 1,
        }
        for register, value in values.items():
            self[register] = value
        self._set_number(Register.ACQUISITION_FRAME_RATE, terms.rate_hz)
        self._set_number(Register.EXPOSURE_TIME, min(max(terms.exposure_us, EXPOSURE_US[0]), EXPOSURE_US[1]))
        for address, text, size in (
            (0x0048, "Flyaround", 32),
            (0x0068, "Simulated camera", 32),
            (0x0088, "1", 32),
            (0x00A8, f"{terms.scenario}: {terms.target}", 48),
            (0x00D8, interface.address, 16),
            (XML_URL, f"Local:{xml_name};{XML_ADDRESS:X};{len(xml):X}", URL_BYTES),
        ):
            self._set_text(address, text, size)
        self._set_payload_size()
        self._checks = self._make_checks()

    # --- access by the camera ---------------------------------------------------------------

    def __getitem__(self, register: Register) -> int:
        """Return the value of a register."""
        block, offset = self._find(register, 4)
        (value,) = struct.unpack_from(">I", block, offset)
        return int(value)

    def __setitem__(self, register: Register, value: int) -> None:
        block, offset = self._find(register, 4)
        assert isinstance(block, bytearray)  # noqa: S101 - the XML is not a register
        struct.pack_into(">I", block, offset, value & 0xFFFFFFFF)

    def number(self, register: Register) -> float:
        """Return the value of a register that holds a float."""
        return _as_float(self[register])

    @property
    def region(self) -> ReadoutRegion:
        """Region of the detector that is read."""
        return ReadoutRegion(
            x=self[Register.OFFSET_X],
            y=self[Register.OFFSET_Y],
            width=self[Register.WIDTH],
            height=self[Register.HEIGHT],
        )

    @property
    def pixel_format(self) -> StreamFormat:
        """Pixel format of the stream."""
        return StreamFormat(self[Register.PIXEL_FORMAT])

    @property
    def discovery(self) -> bytes:
        """Contents of the answer to a discovery: the first registers."""
        return self.read(0, DISCOVERY_BYTES)

    # --- access by a controller -------------------------------------------------------------

    def read(self, address: int, count: int) -> bytes:
        """Return bytes at an address, both multiples of four.

        Raises
        ------
        RefusedError
            If address or count is not aligned, or the span is not in one block.
        """
        if address % 4 or count % 4:
            raise RefusedError(Status.BAD_ALIGNMENT)
        if not 0 < count <= MAX_MEMORY_BYTES:
            raise RefusedError(Status.INVALID_PARAMETER)
        block, offset = self._find(address, count)
        return bytes(block[offset : offset + count])

    def write(self, address: int, data: bytes) -> list[Register]:
        """Write values, and return the registers that were written.

        Raises
        ------
        RefusedError
            If a register does not exist, is read-only or locked, or the value is not allowed. Registers before the
            refused one keep their new values.
        """
        if address == USER_NAME and len(data) == USER_NAME_BYTES:
            self._blocks[0][1][address : address + len(data)] = data
            return []
        if address % 4 or len(data) % 4:
            raise RefusedError(Status.BAD_ALIGNMENT)
        if not data or len(data) > MAX_MEMORY_BYTES:
            raise RefusedError(Status.INVALID_PARAMETER)
        self._find(address, len(data))
        written = []
        for offset in range(0, len(data), 4):
            (value,) = struct.unpack_from(">I", data, offset)
            written.append(self.write_register(address + offset, value))
        return written

    def write_register(self, address: int, value: int) -> Register:
        """Write one value, and return its register.

        Raises
        ------
        RefusedError
            As for `write`.
        """
        if address % 4:
            raise RefusedError(Status.BAD_ALIGNMENT)
        self._find(address, 4)
        check = self._checks.get(address)
        if check is None:
            raise RefusedError(Status.WRITE_PROTECT)
        register = Register(address)
        if self.acquiring and register in _STREAM_SETTINGS:
            raise RefusedError(Status.BUSY)
        if not check(value):
            raise RefusedError(Status.INVALID_PARAMETER)
        self[register] = value
        self._set_payload_size()
        return register

    def _make_checks(self) -> dict[int, Callable[[int], bool]]:
        """Return the checks of writable registers; all others are read-only."""
        terms = self.terms
        return {
            Register.HEARTBEAT_MS: lambda v: HEARTBEAT_MS[0] <= v <= HEARTBEAT_MS[1],
            Register.TIMESTAMP_CONTROL: lambda v: v in {1, 2},
            Register.CONTROL_PRIVILEGE: lambda v: v in {0, EXCLUSIVE, CONTROL, EXCLUSIVE | CONTROL},
            Register.STREAM_PORT: lambda v: v <= 0xFFFF,
            Register.STREAM_PACKET_BYTES: lambda v: (
                PACKET_BYTES[0] <= v & 0xFFFF <= PACKET_BYTES[1] and not v & 0x3FFF0000
            ),
            Register.STREAM_PACKET_DELAY: lambda v: v <= TICKS_PER_S // 1000,  # a millisecond
            Register.STREAM_ADDRESS: lambda v: (
                v <= 0xFFFFFFFF
            ),  # the endpoint compares it with its controller's address
            Register.OFFSET_X: lambda v: v + self[Register.WIDTH] <= terms.width_px,
            Register.OFFSET_Y: lambda v: v + self[Register.HEIGHT] <= terms.height_px,
            Register.WIDTH: lambda v: MIN_SIDE_PX <= v <= terms.width_px - self[Register.OFFSET_X],
            Register.HEIGHT: lambda v: MIN_SIDE_PX <= v <= terms.height_px - self[Register.OFFSET_Y],
            Register.PIXEL_FORMAT: lambda v: v in self.formats,
            Register.ACQUISITION_MODE: lambda v: v in {CONTINUOUS, SINGLE_FRAME, MULTI_FRAME},
            Register.ACQUISITION_START: lambda v: v == 1,
            Register.ACQUISITION_STOP: lambda v: v == 1,
            Register.ACQUISITION_FRAME_COUNT: lambda v: 1 <= v <= 0xFFFF,
            Register.ACQUISITION_FRAME_RATE: lambda v: _within(v, RATE_HZ),
            Register.TRIGGER_MODE: lambda v: v in {0, 1},
            Register.TRIGGER_SOURCE: lambda v: v == 0,
            Register.TRIGGER_SOFTWARE: lambda v: v == 1,
            Register.EXPOSURE_TIME: lambda v: _within(v, EXPOSURE_US),
            Register.GAIN: lambda v: _within(v, GAIN_DB),
            Register.TRANSPORT_LOCKED: lambda v: v in {0, 1},
        }

    def _find(self, address: int, count: int) -> tuple[bytearray | bytes, int]:
        """Return the block that contains a span, and the offset in it."""
        blocks: list[tuple[int, bytearray | bytes]] = [*self._blocks, (XML_ADDRESS, self._xml)]
        for start, block in blocks:
            if start <= address and address + count <= start + len(block):
                return block, address - start
        raise RefusedError(Status.INVALID_ADDRESS)

    def _set_text(self, address: int, text: str, size: int) -> None:
        raw = text.encode("utf-8")[: size - 1].decode("utf-8", "ignore").encode()
        self._blocks[0][1][address : address + size] = raw.ljust(size, b"\0")

    def _set_number(self, register: Register, value: float) -> None:
        self[register] = int.from_bytes(struct.pack(">f", value), "big")

    def _set_payload_size(self) -> None:
        r = self.region
        self[Register.PAYLOAD_SIZE] = self.pixel_format.payload_bytes(r.width * r.height)


def _as_float(value: int) -> float:
    (number,) = struct.unpack(">f", value.to_bytes(4, "big"))
    return float(number)


def _within(value: int, limits: tuple[float, float]) -> bool:
    number = _as_float(value)
    # registers hold single precision, in which a limit is not exact
    return math.isfinite(number) and limits[0] * (1 - 1e-6) <= number <= limits[1] * (1 + 1e-6)
