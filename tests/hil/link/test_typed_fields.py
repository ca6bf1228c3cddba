"""Optional fields of FRAME_HEADER and POSE: both ways, unknown, broken, and between old and new sides."""

import struct
from dataclasses import replace

import pytest

from flyaround.hil.link.errors import PacketError
from flyaround.hil.link.packets.enums import Encoding
from flyaround.hil.link.packets.messages import FrameHeader, Hello, HelloAck, PoseMessage
from flyaround.hil.link.session import answer_hello

HEADER = FrameHeader(1, 64, 48, 8, Encoding.RAW, 3072, 1, 0.01, 0.0, 1, "2026-01-01T00:00:00Z")
POSE = PoseMessage(
    1,
    accepted=True,
    reason="why",
    q_camera_from_target_wxyz=(1.0, 0.0, 0.0, 0.0),
    t_camera_from_target_m=(0.0, 0.0, 9.0),
)


def field(tag, value, length=None):
    return struct.pack("<HH", tag, len(value) if length is None else length) + value


def test_without_fields_the_bytes_are_those_of_before():
    assert len(HEADER.encode()) == 120
    assert len(POSE.encode()) == 103


@pytest.mark.parametrize("message", [HEADER, POSE])
def test_unknown_tags_are_skipped(message):
    data = message.encode() + field(700, b"later") + field(701, b"")
    assert type(message).decode(data) == message


@pytest.mark.parametrize("message", [HEADER, POSE])
@pytest.mark.parametrize(
    ("tail", "words"),
    [
        (b"\1", "ends within a field"),
        (field(700, b"abc", 4), "3 bytes left, expected 4"),
        (field(700, b"a") + field(700, b"a"), "is repeated"),
        (field(700, bytes(1021)), "at most 1024"),
    ],
)
def test_broken_fields_are_refused_in_a_sentence(message, tail, words):
    with pytest.raises(PacketError, match=words):
        type(message).decode(message.encode() + tail)


@pytest.mark.parametrize(
    ("message", "tail", "words"),
    [
        (HEADER, field(1, bytes(20)), "20 bytes, expected 24"),
        (HEADER, field(1, struct.pack("<3d", 1.0, 1.0, 0.0)), "length 1.41421"),
        (HEADER, field(1, struct.pack("<3d", float("nan"), 0.0, 0.0)), "length nan"),
        (HEADER, field(2, b"\7"), "transfer function of pixels 7"),
        (POSE, field(3, bytes(80)), "80 bytes, expected 84"),
        (POSE, field(3, struct.pack("<21f", -1.0, *[0.0] * 20)), "a negative variance"),
        (POSE, field(3, struct.pack("<21f", *[0.0] * 20, float("inf"))), "non-finite"),
    ],
)
def test_values_that_mean_nothing_are_refused(message, tail, words):
    with pytest.raises(PacketError, match=words):
        type(message).decode(message.encode() + tail)


def test_a_pose_that_is_cut_short_is_no_pose_with_fields():
    with pytest.raises(PacketError, match="does not fit its own counts"):
        PoseMessage.decode(POSE.encode()[:-1])


def test_values_are_checked_before_they_are_sent():
    with pytest.raises(PacketError, match="length 2"):
        replace(HEADER, sun_camera=(2.0, 0.0, 0.0)).encode()
    with pytest.raises(PacketError, match="cannot be sent"):
        replace(POSE, covariance=(1e39,) * 21).encode()


@pytest.mark.parametrize("takes", [False, True])
def test_fields_are_agreed_only_with_boards_that_take_them(takes):
    ack = answer_hello(Hello(takes_fields=takes), HelloAck({}, 64, 48))
    assert ack.takes_fields == takes
    # a side that knows nothing of fields finds the masks and the reserved number as they were
    assert struct.unpack_from("<H", Hello(3).encode(), 2) == (3,)
    assert struct.unpack_from("<H", HelloAck({}, 64, 48).encode(), 14) == (0,)
