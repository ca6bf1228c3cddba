"""Streams of packets: any cut, any garbage; COBS against the package of that name."""

from __future__ import annotations

import random

import pytest
from cobs import cobs as reference
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.link import cobs
from hil.link.errors import PacketError
from hil.link.framing import CobsFraming, LengthFraming
from hil.link.packets import Packet, PacketType

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


def packets(count: int, seed: int) -> list[Packet]:
    rng = random.Random(seed)
    return [Packet(PacketType.TRUTH, rng.randbytes(rng.randrange(400)), 5, k) for k in range(count)]


def drain(framing) -> tuple[list[Packet], int]:
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
@pytest.mark.parametrize("rate", [1e-4, 1e-3])
def test_noisy_line_no_false_accept(make, rate):
    rng, sent, framing = random.Random(11), packets(600, 3), make()
    stream = bytearray(b"".join(framing.encode(p) for p in sent))
    for k in range(len(stream)):
        if rng.random() < rate:
            stream[k] ^= 1 << rng.randrange(8)
    framing.feed(bytes(stream))
    framing.feed(b"".join(framing.encode(p) for p in sent[-1:]))
    got, damage = drain(framing)
    known = {p.sequence: p for p in sent}
    assert damage > 0
    assert all(known[p.sequence] == p for p in got)
    expected = (1 - rate) ** (len(stream) / len(sent))
    assert len(got) / len(sent) > expected - 0.06


@each_framing
def test_endless_garbage_is_not_hoarded(make):
    framing = make()
    for _ in range(40):
        framing.feed(b"\x55" * (1 << 18))
        drain(framing)
    assert len(framing._buffer) < 6 << 20
