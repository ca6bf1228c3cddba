"""GVCP and GVSP by their bytes, and pixels as a format has them."""

import numpy as np

from flyaround.hil.host.camera_endpoint import gvcp
from flyaround.hil.host.camera_endpoint.gvsp import Block, ReadoutRegion, StreamFormat, formats_of, pixels_of


def test_command_and_acknowledgement_by_their_bytes():
    request = gvcp.parse_request(bytes.fromhex("42 01 0080 0004 1234 00000a00"))
    assert request == gvcp.GvcpRequest(0x80, 0x1234, bytes.fromhex("00000a00"), wants_answer=True)
    assert gvcp.read_addresses(request.payload) == (0xA00,)
    assert gvcp.acknowledge(request, b"\0\0\0\2").hex() == "000000810004123400000002"
    refused = gvcp.acknowledge(request, status=gvcp.Status.ACCESS_DENIED)
    assert refused.hex() == "8006008100001234"


def test_picture_by_its_bytes():
    region = ReadoutRegion(x=1, y=2, width=40, height=20)
    block = Block(
        block_id=0x0102,
        timestamp_ns=0x1122334455667788,
        pixel_format=StreamFormat.Mono8,
        region=region,
        data=bytes(range(200)) * 4,
        packet_bytes=576,
    )
    assert block.n_packets == 4
    assert block.packet(0).hex() == (
        "0000 0102 01 000000 0000 0001 1122334455667788 01080001 00000028 00000014 00000001 00000002 0000 0000"
    ).replace(" ", "")
    assert block.packet(1)[:8].hex() == "0000010203000001"
    assert len(block.packet(1)) + 28 == 576
    assert block.packet(1)[8:] + block.packet(2)[8:] == block.data
    assert block.packet(3).hex() == "00000102020000030000000100000014"
    assert block.packet(2, status=0x0100)[:2].hex() == "0100"


def test_pixel_formats_hold_the_detectors_numbers():
    image = (np.arange(64 * 64, dtype=np.uint16) % 4096).reshape(64, 64)
    region = ReadoutRegion(x=8, y=4, width=16, height=32)
    part = image[4:36, 8:24]
    twelve = np.frombuffer(pixels_of(image, 12, region, StreamFormat.Mono12), "<u2").reshape(32, 16)
    assert np.array_equal(twelve, part)
    eight = np.frombuffer(pixels_of(image, 12, region, StreamFormat.Mono8), np.uint8).reshape(32, 16)
    assert np.array_equal(eight, part >> 4)
    assert formats_of(8) == (StreamFormat.Mono8,)
    assert formats_of(10) == (StreamFormat.Mono10, StreamFormat.Mono8)
    packed = pixels_of(image, 12, region, StreamFormat.Mono12p)
    assert len(packed) == StreamFormat.Mono12p.payload_bytes(16 * 32) == 768
    # the naming convention's: eight low bits, four and four, eight high bits
    assert (packed[0], packed[1], packed[2]) == (
        part[0, 0] & 0xFF,
        part[0, 0] >> 8 | (part[0, 1] & 0xF) << 4,
        part[0, 1] >> 4,
    )
    assert formats_of(11) == (StreamFormat.Mono12, StreamFormat.Mono12p, StreamFormat.Mono8)
