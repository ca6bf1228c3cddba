"""Packets and messages: round trips, damage always noticed, vectors as documented."""

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.messages import (
    Bye,
    Credit,
    Encoding,
    ErrorCode,
    ErrorMessage,
    FrameChunk,
    FrameHeader,
    Hello,
    HelloAck,
    Mode,
    PixelFormat,
    PoseMessage,
    TimeSyncReply,
    TimeSyncRequest,
    Transfer,
    TruthMessage,
    TruthPolicy,
    decode_message,
)
from flyaround.hil.link.packets.packet import (
    MAX_PAYLOAD_BYTES,
    Packet,
    PacketType,
    decode_packet,
    encode_packet,
)
from tools.docs.link_vectors import EXAMPLES, session_packets, session_text, vectors

ROOT = Path(__file__).parents[3]

u16 = st.integers(0, 2**16 - 1)
u32 = st.integers(0, 2**32 - 1)
u64 = st.integers(0, 2**64 - 1)
finite = st.floats(allow_nan=False, allow_infinity=False)


def text(size):
    """Text that a field of ``size`` bytes holds whole; control characters and line ends would arrive as spaces."""
    characters = st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"])
    return st.text(characters, max_size=size // 4)


json_object = st.dictionaries(
    st.text(max_size=8), st.one_of(finite, st.integers(), st.text(max_size=8)), max_size=4
)
hashes = st.one_of(st.just(""), st.binary(min_size=32, max_size=32).filter(any).map(bytes.hex))
metres = st.floats(-1e9, 1e9)
# of length 1: from a turn about each axis in turn
quaternions = st.tuples(*[st.floats(-3.2, 3.2)] * 3).map(
    lambda a: tuple(Rotation.from_euler("xyz", a).as_quat(scalar_first=True).tolist())
)
poses = st.builds(
    PoseMessage,
    u32,
    accepted=st.booleans(),
    reason=text(400),
    q_camera_from_target_wxyz=quaternions,
    t_camera_from_target_m=st.tuples(metres, metres, metres),
    confidence=st.floats(0.0, 1.0),
    stages_ms=st.lists(st.tuples(text(24), st.floats(0.0, 1e9)), max_size=5).map(tuple),
    receive_ns=u64,
    start_ns=u64,
    end_ns=u64,
    covariance=st.none() | st.tuples(*[st.floats(0.0, 2.0**100, width=32)] * 21),
)
directions = quaternions.map(lambda q: tuple((Rotation.from_quat(q).as_matrix()[0]).tolist()))
messages = st.one_of(
    st.builds(Hello, st.integers(0, 0x7FFF), u16, text(64), hashes, text(32), text(64), u16, st.booleans()),
    st.builds(
        HelloAck,
        json_object,
        u16,
        u16,
        st.integers(1, 16),
        st.sampled_from(Encoding),
        st.sampled_from(Mode),
        st.sampled_from(TruthPolicy),
        u16,
        u32,
        text(64),
        hashes,
        st.sampled_from(PixelFormat),
        st.booleans(),
    ),
    st.builds(TimeSyncRequest, u64),
    st.builds(TimeSyncReply, u64, u64, u64),
    st.builds(
        FrameHeader,
        u32,
        u16,
        u16,
        st.integers(1, 16),
        st.sampled_from(Encoding),
        u32,
        u32,
        finite,
        finite,
        u64,
        text(40),
        st.sampled_from(PixelFormat),
        st.integers(1, 255),
        st.integers(1, 255),
        st.tuples(u16, u16, u16, u16),
        u64,
        u64,
        u64,
        st.none() | directions,
        st.sampled_from(Transfer),
    ),
    st.builds(FrameChunk, u32, u32, u32, st.binary(max_size=300)),
    poses,
    st.builds(PoseMessage, u32, accepted=st.just(False), reason=text(400)),
    st.builds(Credit, u32, u16),
    st.builds(TruthMessage, u32, json_object),
    st.builds(Bye, text(400)),
    st.builds(ErrorMessage, st.sampled_from(ErrorCode), text(400), u32),
)


@settings(max_examples=300, deadline=None)
@given(messages, u64, u32)
def test_message_round_trip(message, session_id, sequence):
    packet = Packet(message.TYPE, message.encode(), session_id, sequence)
    back = decode_packet(encode_packet(packet))
    assert back == packet
    assert decode_message(back) == message


@pytest.mark.parametrize(("name", "message"), EXAMPLES, ids=[name for name, _ in EXAMPLES])
def test_every_single_bit_flip_is_noticed(name, message):
    data = bytearray(encode_packet(Packet(message.TYPE, message.encode(), 7, 9)))
    for bit in range(8 * len(data)):
        data[bit // 8] ^= 1 << (bit % 8)
        with pytest.raises(PacketError):
            decode_packet(bytes(data))
        data[bit // 8] ^= 1 << (bit % 8)
    decode_packet(bytes(data))


@settings(max_examples=100, deadline=None)
@given(messages, st.data())
def test_a_cut_or_longer_packet_is_noticed(message, data):
    whole = encode_packet(Packet(message.TYPE, message.encode()))
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(PacketError):
        decode_packet(whole[:cut])
    with pytest.raises(PacketError):
        decode_packet(whole + b"\0")


@pytest.mark.parametrize(("name", "message"), EXAMPLES, ids=[name for name, _ in EXAMPLES])
def test_a_payload_of_another_length_is_refused_though_its_checksum_is_right(name, message):
    payload = message.encode()
    for wrong in (payload + b"\0", payload[:-1], payload + payload, b""):
        with pytest.raises(PacketError):
            decode_message(decode_packet(encode_packet(Packet(message.TYPE, wrong))))


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(PacketType), st.binary(max_size=300))
def test_any_payload_is_read_or_refused_never_more(kind, payload):
    """A payload with a right CRC and wrong contents raises PacketError and nothing else."""
    try:
        message = decode_message(Packet(kind, payload))
    except PacketError:
        return
    assert kind == message.TYPE


def test_payload_limit():
    with pytest.raises(PacketError, match="smaller chunks"):
        encode_packet(Packet(PacketType.TRUTH, bytes(MAX_PAYLOAD_BYTES + 1)))


def test_an_accepted_pose_must_be_finite():
    with pytest.raises(PacketError, match="finite"):
        PoseMessage(1, accepted=True).encode()
    with pytest.raises(PacketError, match="finite"):
        PoseMessage(
            1,
            accepted=True,
            q_camera_from_target_wxyz=(float("nan"), 0, 0, 0),
            t_camera_from_target_m=(0, 0, 1),
        ).encode()
    # and one made by another program is refused on arrival: accepted without a pose
    payload = bytearray(PoseMessage(1, accepted=False).encode())
    payload[4] = 1
    with pytest.raises(PacketError, match="contradicts"):
        PoseMessage.decode(bytes(payload))


def test_the_published_vectors_are_those_of_this_code():
    published = json.loads((ROOT / "docs" / "hil_vectors.json").read_text())
    assert published == json.loads(json.dumps(vectors()))


def test_the_session_that_the_page_walks_is_real_bytes():
    assert session_text() + "\n" == (ROOT / "docs" / "hil_session.txt").read_text()
    for _, message, data in session_packets():
        assert decode_message(decode_packet(data)) == message
