"""Streams of packets: any cut, any garbage, any headers, in linear time; COBS against the package of that name."""

import random
import struct
import zlib

import pytest
from cobs import cobs as reference
from hypothesis import given, settings
from hypothesis import strategies as st

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.framing import cobs
from flyaround.hil.link.framing.cobs import CobsFraming
from flyaround.hil.link.framing.length_prefix import PREFIX, LengthFraming
from flyaround.hil.link.packets.messages import Bye
from flyaround.hil.link.packets.packet import HEADER, MAGIC, OVERHEAD_BYTES, Packet, PacketType

FRAMINGS = {"length": LengthFraming, "cobs": CobsFraming, "pure cobs": lambda: CobsFraming(pure=True)}
each_framing = pytest.mark.parametrize("make", FRAMINGS.values(), ids=FRAMINGS.keys())
bytes_with_zeros = st.lists(st.one_of(st.just(0), st.integers(0, 255)), max_size=700).map(bytes)


@settings(max_examples=300, deadline=None)
@given(bytes_with_zeros)
def test_cobs_agrees_with_the_package(data):
    stuffed = cobs.encode(data)
    assert stuffed == reference.encode(data)
    assert 0 not in stuffed
    assert cobs.decode(stuffed) == data


@pytest.mark.parametrize("size", [0, 1, 253, 254, 255, 507, 508, 509, 762])
@pytest.mark.parametrize("tail", [b"", b"\0", b"\1"])
def test_cobs_at_block_edges(size, tail):
    data = b"\x07" * size + tail
    assert cobs.encode(data) == reference.encode(data)
    assert cobs.decode(cobs.encode(data)) == data


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300))
def test_cobs_refuses_what_the_package_refuses(data):
    try:
        expected = reference.decode(data)
    except reference.DecodeError:
        expected = None
    if data == b"":
        expected = None  # an empty frame is no packet
    try:
        got = cobs.decode(data)
    except PacketError:
        got = None
    assert got == expected


def packets(count, seed):
    rng = random.Random(seed)
    return [Packet(PacketType.TRUTH, rng.randbytes(rng.randrange(400)), 5, k) for k in range(count)]


def drain(framing):
    """All packets that are there, and how often damage was reported."""
    got, damage = [], 0
    while True:
        try:
            packet = framing.next_packet()
        except PacketError:
            damage += 1
            continue
        if packet is None:
            return got, damage
        got.append(packet)


@each_framing
@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_cuts_do_not_matter(make, seed):
    sent, framing = packets(12, seed), make()
    stream = b"".join(framing.encode(p) for p in sent)
    rng, got, at = random.Random(seed), [], 0
    while at < len(stream):
        step = rng.randrange(1, 200)
        framing.feed(stream[at : at + step])
        more, damage = drain(framing)
        assert damage == 0
        got += more
        at += step
    assert got == sent


@each_framing
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), kind=st.sampled_from(["flip", "insert", "delete", "garbage"]))
def test_the_stream_is_found_again_after_damage(make, seed, kind):
    """One damaged place costs at most the packets it touches; nothing wrong is ever accepted."""
    rng, sent, framing = random.Random(seed), packets(8, seed), make()
    parts = [framing.encode(p) for p in sent]
    hurt = rng.randrange(6)
    part = bytearray(parts[hurt])
    at = rng.randrange(len(part))
    if kind == "flip":
        part[at] ^= 1 << rng.randrange(8)
    elif kind == "insert":
        part.insert(at, rng.randrange(256))
    elif kind == "delete":
        del part[at]
    else:
        part = bytearray(rng.randbytes(150) + b"FLYA" + rng.randbytes(60))
    framing.feed(b"".join([*parts[:hurt], bytes(part), *parts[hurt + 1 :]]))
    got, damage = drain(framing)
    # an inserted zero before the first byte or after the last is harmless on a serial line
    assert damage >= 1 or got == sent
    assert all(p in sent for p in got)
    missing = [p.sequence for p in sent if p not in got]
    # a length-prefixed neighbour may lose its prefix to an inserted or deleted byte; no more than that
    assert set(missing) <= {hurt, hurt + 1}


@each_framing
def test_endless_garbage_is_not_hoarded(make):
    framing = make()
    for _ in range(40):
        framing.feed(b"\x55" * (1 << 18))
        drain(framing)
    assert len(framing._buffer) < 6 << 20


def nested_headers(total):
    """Headers inside each other, each of a packet to the end of all, with a wrong CRC."""
    size = PREFIX.size + HEADER.size
    out = bytearray()
    for left in range(total, size + 4, -size):
        length = left - PREFIX.size
        payload = length - OVERHEAD_BYTES
        out += PREFIX.pack(length) + HEADER.pack(MAGIC, 2, PacketType.FRAME_CHUNK, 0, 5, 0, payload)
    return bytes(out + bytes(total - len(out)))


@pytest.mark.parametrize("step", [1 << 22, 1460])
def test_nested_headers_are_read_twice_at_most(step, monkeypatch):
    """4 MB of 150,000 nested headers: what is checked by CRC is counted, for a count does not depend on the machine."""
    checked, really = 0, zlib.crc32

    def crc32(data, value=0):
        nonlocal checked
        checked += len(data)
        return really(data, value)

    monkeypatch.setattr("flyaround.hil.link.packets.packet.zlib.crc32", crc32)
    stream = nested_headers((1 << 22) - 1024)
    assert stream.count(MAGIC) > 149_000
    framing, damage = LengthFraming(), 0
    for at in range(0, len(stream), step):
        framing.feed(stream[at : at + step])
        damage += drain(framing)[1]
    assert damage < 10  # one stretch of damage is told a few times, not at each header
    good = Packet(PacketType.BYE, Bye("after").encode(), 5)
    for _ in range(2):
        framing.feed(framing.encode(good))
    assert good in drain(framing)[0]
    # every byte once, what is read again within its credit, and the bytes of a last candidate
    assert checked < 5 * len(stream)


def test_an_honest_packet_inside_a_failed_one_is_still_found():
    """A damaged length swallows what follows; it is given back while that costs little."""
    framing = LengthFraming()
    inner = [Packet(PacketType.BYE, Bye(str(k)).encode(), 5, k) for k in range(3)]
    stream = b"".join(framing.encode(p) for p in inner)
    payload = len(stream)
    liar = PREFIX.pack(payload + OVERHEAD_BYTES) + HEADER.pack(MAGIC, 2, 6, 0, 5, 0, payload)
    framing.feed(liar + stream + b"\0\0\0\0")
    got, damage = drain(framing)
    assert got == inner
    assert damage == 1


def test_packets_of_an_unknown_type_are_dropped_whole():
    """Their CRC is right: what looks like a packet inside them is their payload."""
    framing = LengthFraming()
    good = Packet(PacketType.BYE, Bye("hidden").encode(), 5)
    for version, kind in ((2, 99), (1, 10)):
        inner = framing.encode(good)
        header = HEADER.pack(MAGIC, version, kind, 0, 5, 0, len(inner))
        data = header + inner + struct.pack("<I", zlib.crc32(header + inner))
        framing.feed(PREFIX.pack(len(data)) + data)
    got, damage = drain(framing)
    assert (got, damage, len(framing._buffer)) == ([], 2, 0)


@pytest.mark.parametrize(
    "garbage",
    [b"", b"\x01" * 40, b"\0" * 31, b"FLYA" * 9, b"x" * 33 + b"FLY", b"y" * 29 + b"\x4c\0\0\0FL"],
    ids=["none", "bytes", "zeros", "magics", "magic cut", "prefix and magic cut"],
)
def test_a_packet_split_anywhere_after_garbage_arrives(garbage):
    """What may be a prefix and the beginning of a magic is kept while the rest is on its way."""
    packet = Packet(PacketType.BYE, Bye("whole").encode(), 5, 3)
    stream = garbage + LengthFraming().encode(packet)
    for cut in range(len(stream)):
        for second in (cut, min(cut + 3, len(stream))):
            framing, got = LengthFraming(), []
            for part in (stream[:cut], stream[cut:second], stream[second:]):
                framing.feed(part)
                got += drain(framing)[0]
            assert got == [packet], (garbage, cut, second)
