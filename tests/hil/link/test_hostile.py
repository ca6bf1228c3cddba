"""Packets that are intact and mean harm: refused by the session's state, by size, by depth."""

import json
import math
import socket
import struct
import threading
import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import zstandard
from hil_loop import Instant
from virtual_line import virtual_pair

from flyaround.hil.board.agent import run_board
from flyaround.hil.link.errors import LinkClosed, LinkError, PacketError, ProtocolMistake
from flyaround.hil.link.packets.fields import (
    MAX_CAMERA_JSON_BYTES,
    MAX_JSON_DEPTH,
    MAX_TRUTH_JSON_BYTES,
    unpack_json,
)
from flyaround.hil.link.packets.images import (
    MAX_FRAME_BYTES,
    FrameAssembler,
    check_terms,
    supported_encodings,
)
from flyaround.hil.link.packets.messages import (
    Bye,
    Encoding,
    ErrorCode,
    ErrorMessage,
    FrameChunk,
    FrameHeader,
    Hello,
    HelloAck,
    PixelFormat,
    PoseMessage,
    TimeSyncRequest,
    TruthMessage,
    TruthPolicy,
    decode_message,
)
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.session import HOST_BEFORE_HELLO, HOST_IN_SESSION, MAX_IGNORED, Link, greet_host
from flyaround.hil.link.transports.tcp import TcpListener, TcpTransport

DEEP = b'{"a":' + b"[" * 100_000 + b"]" * 100_000 + b"}"
TERMS = HelloAck({"width_px": 64, "height_px": 48}, 64, 48)


def truth_packet(data, session_id=0):
    return Packet(PacketType.TRUTH, struct.pack("<II", 1, len(data)) + data, session_id)


# --- JSON --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (DEEP, "nested deeper than 32 levels"),
        (b"[" * 100_000, "nested deeper"),
        (b'{"a":' * 100_000, "nested deeper"),
        (b'{"a":"' + b"x" * MAX_TRUTH_JSON_BYTES + b'"}', "bytes is refused"),
        (b'{"a":' + b"1" * 100_000 + b"}", "cannot be read"),
        (b'{"a":NaN}', "not a JSON number"),
        (b'{"a":-Infinity}', "not a JSON number"),
        (b'{"a":"\xff"}', "cannot be read"),
        (b'"' + b'\\"' * 1000, "cannot be read"),
        (b"[]", "not an object"),
        (b"", "cannot be read"),
    ],
)
def test_hostile_json_is_one_sentence(data, sentence):
    with pytest.raises(PacketError, match=sentence) as caught:
        unpack_json(data, MAX_TRUTH_JSON_BYTES)
    assert len(str(caught.value)) < 200
    with pytest.raises(ProtocolMistake):
        decode_message(truth_packet(data))


def test_depth_is_counted_outside_strings_and_to_the_limit():
    brackets_in_text = {"a": "[" * 100, 'quote" [[': ["\\" * 3, '\\"' + "{" * 100]}
    assert unpack_json(json.dumps(brackets_in_text).encode(), 4096) == brackets_in_text
    levels = MAX_JSON_DEPTH - 1  # and the object around them
    fits = b'{"a":' + b"[" * levels + b"]" * levels + b"}"
    assert unpack_json(fits, 4096)["a"] == json.loads(fits)["a"]
    with pytest.raises(PacketError, match="deeper"):
        unpack_json(b'{"a":' + b"[" * (levels + 1) + b"]" * (levels + 1) + b"}", 4096)


def test_a_camera_may_take_less_than_a_truth():
    camera = {"note": "x" * MAX_CAMERA_JSON_BYTES}
    with pytest.raises(PacketError, match=f"at most {MAX_CAMERA_JSON_BYTES}"):
        HelloAck.decode(HelloAck(camera, 64, 48).encode())
    assert TruthMessage.decode(TruthMessage(1, camera).encode()).truth == camera


# --- the session's state -----------------------------------------------------------------------


def test_a_host_reads_no_truth_and_before_hello_nothing_else(monkeypatch):
    read = []
    monkeypatch.setattr(
        "flyaround.hil.link.session.decode_message", lambda packet: read.append(packet.type) or packet
    )
    board, host = virtual_pair()
    link = Link(host, accepts=HOST_BEFORE_HELLO)
    for kind in PacketType:
        board.send_packet(Packet(kind, DEEP))
    assert link.recv(0.0).type == PacketType.HELLO
    assert link.recv(0.0) is None
    assert link.stats.mistakes == len(PacketType) - 1
    link.accepts = HOST_IN_SESSION
    for kind in PacketType:
        board.send_packet(Packet(kind, DEEP))
    while link.recv(0.0) is not None:
        pass
    assert {
        PacketType.TRUTH,
        PacketType.HELLO_ACK,
        PacketType.FRAME_HEADER,
        PacketType.FRAME_CHUNK,
    }.isdisjoint(read)
    assert PacketType.POSE in read


@pytest.mark.parametrize("truth", list(TruthPolicy))
def test_a_board_reads_truth_only_where_it_was_agreed(truth):
    board, host = virtual_pair()
    host.send_packet(truth_packet(DEEP))  # before the terms
    Link(host, 9).send(replace(TERMS, truth=truth))
    link = Link(board)
    greet_host(link, Hello(), 5.0)
    Link(host, 9).send(TruthMessage(1, {"a": 1}))
    assert link.recv(0.0) == (TruthMessage(1, {"a": 1}) if truth == TruthPolicy.INLINE else None)


def test_terms_in_the_middle_of_a_session_change_nothing():
    board, host = virtual_pair()
    Link(host, 9).send(TERMS)
    link = Link(board)
    greet_host(link, Hello(), 5.0)
    Link(host, 10).send(TERMS)
    Link(host, 9).send(Bye("end"))
    assert link.recv(0.0) == Bye("end")
    assert link.session_id == 9


def test_a_flood_of_what_does_not_belong_comes_back_to_the_caller():
    """Two floods that never leave a receiver without bytes: garbage, and packets of another session."""
    a, b = virtual_pair()
    for k in range(MAX_IGNORED + 10):
        a.send_packet(Packet(PacketType.BYE, Bye("x").encode(), 77, k))
    link = Link(b, 5)
    a.send_packet(Packet(PacketType.BYE, Bye("end").encode(), 5, MAX_IGNORED + 10))
    assert link.recv(0.0) is None
    assert link.yielded  # there may be more
    # and there is; nothing of it was damaged on the line
    assert link.recv(0.0) == Bye("end")
    assert not link.yielded
    assert link.recv(0.0) is None
    assert not link.yielded
    assert (link.stats.corrupt, link.stats.stale) == (0, MAX_IGNORED + 10)

    class Endless:
        name, chunk_bytes = "endless", 1

        def get(self, _timeout_s):
            time.sleep(0.001)
            return b"\x11" * 100

    b._into = Endless()
    with pytest.raises(PacketError, match="out of step"):
        link.recv(0.0)
    start = time.monotonic()
    assert link.recv(0.1) is None
    assert time.monotonic() - start < 5.0


def test_control_characters_become_spaces():
    raw = Bye("a\rb\nc\x1b[2Jd\u2028e").encode()
    assert Bye.decode(raw).reason == "a b c [2Jd e"
    # what cannot be written in UTF-8 at all does not end the writer either
    assert Bye.decode(Bye("half \ud800 pair").encode()).reason == "half ? pair"


def test_a_received_text_is_no_longer_than_a_sent_one():
    for text in ("x" * 60_000, "\N{DEGREE SIGN}" * 30_000):
        data = text.encode()
        bye = Bye.decode(Bye.LAYOUT.pack(len(data), 0) + data)
        error = ErrorMessage.decode(ErrorMessage.LAYOUT.pack(0, len(data), 7) + data)
        assert bye.reason == error.text == text[: 400 // len(text[0].encode())]
        pose = PoseMessage(1, accepted=False).encode()
        long = pose[:-4] + len(data).to_bytes(2, "little") + pose[-2:] + data
        assert PoseMessage.decode(long).reason == bye.reason


# --- images ------------------------------------------------------------------------------------


def header(**changes):
    base = FrameHeader(1, 64, 48, 8, Encoding.RAW, 64 * 48, 1, 0.01, 0.0, 1, "2026-01-01T00:00:00Z")
    return replace(base, **changes)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"width_px": 65535, "height_px": 65535, "bits": 16},
            "65535 x 65535 px of 16 bits as Mono8, agreed were 64 x 48",
        ),
        ({"bits": 16, "total_bytes": 2 * 64 * 48}, "agreed were 64 x 48 px of 8 bits"),
        ({"width_px": 48, "height_px": 64}, "agreed were"),
        ({"encoding": Encoding.ZSTD}, "encoding that was not agreed"),
        ({"total_bytes": 0}, "announces 0 bytes"),
        ({"total_bytes": 64 * 48 + 1}, "announces 3073 bytes"),
        ({"total_bytes": 2**32 - 1, "chunk_count": 2**32 - 1}, "announces 4294967295 bytes"),
        ({"chunk_count": 0}, "announces 0 chunks"),
        ({"chunk_count": 2**32 - 1}, "announces 4294967295 chunks for 3072 bytes"),
    ],
)
def test_a_header_that_was_not_agreed_takes_no_memory(changes, sentence):
    assembler = FrameAssembler(TERMS)
    tracemalloc.start()
    with pytest.raises(ProtocolMistake, match=sentence) as caught:
        assembler.header(header(**changes))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert caught.value.frame_id == 1
    assert peak < 1 << 20
    # its chunks are neither kept nor told of one by one
    assert assembler.chunk(FrameChunk(1, 0, 0, b"x")) is None
    assert assembler.lost() == []
    assembler.header(header(frame_id=2))
    assert assembler.chunk(FrameChunk(2, 0, 0, bytes(64 * 48)))[1].shape == (48, 64)


def test_a_zstd_bomb_is_refused_before_it_is_unpacked():
    terms = replace(TERMS, encoding=Encoding.ZSTD)
    # one that says its size, one that hides it
    told = zstandard.ZstdCompressor(level=3).compress(bytes(1 << 24))
    hidden = zstandard.ZstdCompressor(level=3, write_content_size=False).compress(bytes(1 << 24))
    # and one that says the agreed size, and has another behind it
    lying = zstandard.ZstdCompressor(level=3).compress(bytes(64 * 48)) + told
    for bomb in (told, hidden, lying):
        assert len(bomb) < 64 * 48
        assembler = FrameAssembler(terms)
        assembler.header(header(encoding=Encoding.ZSTD, total_bytes=len(bomb)))
        tracemalloc.start()
        try:
            done = assembler.chunk(FrameChunk(1, 0, 0, bomb))
        except PacketError:
            done = None
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 1 << 20
        assert done is None or not done[1].any()


def test_chunks_that_leave_holes_make_no_frame():
    assembler = FrameAssembler(TERMS)
    half = b"x" * (32 * 48)
    for index, offset, data in [
        (0, 0, half[:-1]),  # too short, so that the last would have to be longer
        (0, 0, half + half),  # leaves the last nothing
        (0, 1, half),
        (1, 0, half),
        (1, 32 * 48, half[:-1]),
        (2, 64 * 48, b"x"),
        (1, 32 * 48 + 1, half),
        (0, 0, b""),
    ]:
        assembler.header(header(chunk_count=2))
        with pytest.raises(ProtocolMistake, match="do not cover 3072 bytes") as caught:
            assembler.chunk(FrameChunk(1, index, offset, data))
        assert caught.value.frame_id == 1
        # told once, by the mistake
        assert assembler.chunk(FrameChunk(1, 1, 32 * 48, half)) is None
        assert assembler.lost() == []
    assembler.header(header(frame_id=2, chunk_count=2))
    assert assembler.chunk(FrameChunk(2, 1, 32 * 48, half)) is None
    assert assembler.chunk(FrameChunk(2, 1, 32 * 48, half)) is None  # twice the same counts once
    assert assembler.chunk(FrameChunk(2, 0, 0, half))[1].all()


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"width_px": 65535, "height_px": 65535}, "too large for this board: at most 128 MiB"),
        ({"width_px": 0}, "cannot be sent"),
        ({"bits": 0}, "cannot be sent"),
        ({"bits": 9}, "cannot be sent: use 1 to 8 bits in this format"),
        (
            {"camera": {"width_px": 10**9, "height_px": 10**9}},
            "do not fit the camera, whose width_px is 1000000000",
        ),
        ({"camera": {"height_px": [[]]}}, "do not fit the camera"),
    ],
)
def test_terms_that_no_board_can_keep_are_refused(changes, sentence):
    terms = replace(TERMS, **{"camera": {}, **changes})
    with pytest.raises(LinkError, match=sentence):
        check_terms(terms, supported_encodings())
    with pytest.raises(LinkError, match="did not offer"):
        check_terms(replace(TERMS, encoding=Encoding.ZSTD), 1 << Encoding.RAW)
    check_terms(TERMS, supported_encodings())


def test_the_largest_image_is_8192_squared_of_two_bytes():
    check_terms(HelloAck({}, 8192, 8192, 16, pixel_format=PixelFormat.Mono16), 1)
    assert MAX_FRAME_BYTES == 2 * 8192**2


def test_a_frame_header_holds_finite_times():
    with pytest.raises(PacketError, match="not finite"):
        FrameHeader.decode(header(t_s=math.nan).encode())


def test_a_host_that_ignores_the_window_fills_no_memory():
    """Eight frames at once to a board that holds two: what it has no room for is told, not kept."""
    gate, listener, summaries = threading.Event(), TcpListener("127.0.0.1", 0), []

    class Gated(Instant):
        def estimate(self, image):
            assert gate.wait(30.0)
            return super().estimate(image)

    board = threading.Thread(
        target=lambda: summaries.append(run_board(listener.url, make_estimator=Gated, window=2)), daemon=True
    )
    board.start()
    link = Link(listener.accept(30.0), 7)
    assert isinstance(link.recv(30.0), Hello)
    link.send(replace(TERMS, window=60_000))
    # the session's terms hold for its frames, too
    link.send(header(frame_id=99, width_px=4096, height_px=4096, bits=16, total_bytes=1 << 25))
    while isinstance(refused := link.recv(30.0), TimeSyncRequest):
        pass
    assert (refused.code, refused.frame_id) == (ErrorCode.FORMAT, 99)
    for k in range(8):
        link.send(header(frame_id=k))
        link.send(FrameChunk(k, 0, 0, bytes(64 * 48)))
        if k == 0:
            time.sleep(0.2)  # the first is in work; either way no more than three are taken
    busy = []
    while len(busy) < 5:
        told = link.recv(30.0)
        if isinstance(told, TimeSyncRequest):
            continue
        assert isinstance(told, ErrorMessage)
        assert told.code == ErrorCode.BUSY
        busy.append(told.frame_id)
    gate.set()
    answered = []
    while len(answered) < 3:
        told = link.recv(30.0)
        if isinstance(told, PoseMessage):
            answered.append(told.frame_id)
        elif isinstance(told, ErrorMessage):  # the first was not in work yet
            busy.append(told.frame_id)
            answered.append(None)
    assert sorted({*busy, *answered} - {None}) == list(range(8))
    assert 7 in busy
    link.send(Bye("enough"))
    board.join(30.0)
    assert summaries[0].goodbye
    assert summaries[0].frames in (2, 3)
    link.transport.close()
    listener.close()


def test_a_peer_that_takes_a_byte_now_and_then_is_given_up():
    with socket.create_server(("127.0.0.1", 0)) as server:
        client = socket.create_connection(server.getsockname())
        client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        peer, _ = server.accept()
    done = threading.Event()

    def sip():
        while not done.wait(0.002):
            peer.recv(4096)

    reader = threading.Thread(target=sip, daemon=True)
    reader.start()
    line = TcpTransport(client, "tcp://test", send_stall_s=20.0, send_packet_s=0.2)

    def flood():
        for k in range(100):
            line.send_packet(Packet(PacketType.FRAME_CHUNK, bytes(1 << 22), 7, k))

    with pytest.raises(LinkClosed, match=r"in more than 0\.2 s: it hangs or the network is too slow"):
        flood()
    line.close()
    done.set()
    reader.join(5.0)
    peer.close()


# --- poses -------------------------------------------------------------------------------------


def pose(q=(1.0, 0.0, 0.0, 0.0), t=(0.0, 0.0, 5.0), confidence=0.5, stages=((("a", 1.0)),)):
    """A POSE as a board of another make may write it: nothing is checked."""
    fixed = PoseMessage.LAYOUT.pack(7, 1, 1, len(stages), confidence, *q, *t, 1, 2, 3, 0, 0)
    return fixed + b"".join(PoseMessage.STAGE.pack(name.encode(), ms) for name, ms in stages)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"q": (2.0, 0.0, 0.0, 0.0)}, "quaternion of a POSE has length 2: make it 1"),
        ({"q": (0.0, 0.0, 0.0, 0.0)}, "has length 0"),
        ({"q": (1.0011, 0.0, 0.0, 0.0)}, "has length 1.0011"),
        ({"q": (0.9989, 0.0, 0.0, 0.0)}, "has length 0.9989"),
        ({"q": (1e308,) * 4}, "has length inf"),
        ({"q": (math.nan, 0.0, 0.0, 1.0)}, "not finite"),
        ({"t": (0.0, math.inf, 1.0)}, "not finite"),
        ({"t": (0.0, 1e300, 1.0)}, "beyond 1e"),
        ({"confidence": 1.0000001}, "confidence of a POSE is 1: it must be 0 to 1"),
        ({"confidence": -0.1}, "confidence of a POSE is -0.1"),
        ({"confidence": math.nan}, "not finite"),
        ({"stages": (("a", -1.0),)}, "has a negative duration"),
        ({"stages": (("a", math.inf),)}, "not finite"),
    ],
)
def test_a_pose_that_no_estimator_means_is_a_mistake_about_its_frame(changes, sentence):
    with pytest.raises(ProtocolMistake, match=sentence) as caught:
        decode_message(Packet(PacketType.POSE, pose(**changes)))
    assert caught.value.frame_id == 7


def test_poses_within_tolerance_pass_as_they_are():
    for length in (0.9991, 1.0, 1.0009):
        q = tuple(np.float32(length) * np.float32(0.5) for _ in range(4))
        assert PoseMessage.decode(pose(q=q)).q_camera_from_target_wxyz == q
    for confidence in (0.0, 1.0):
        assert PoseMessage.decode(pose(confidence=confidence)).confidence == confidence


def test_our_own_boards_do_not_write_such_poses():
    for changes in ({"q_camera_from_target_wxyz": (2.0, 0, 0, 0)}, {"confidence": 1.5}):
        fields = {"q_camera_from_target_wxyz": (1.0, 0, 0, 0), "t_camera_from_target_m": (0, 0, 1), **changes}
        with pytest.raises(PacketError):
            PoseMessage(1, accepted=True, **fields).encode()
