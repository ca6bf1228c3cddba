"""Handshake, clock offset, and frames as chunks."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from virtual_line import virtual_pair

from flyaround.hil.link.clock import ClockFilter
from flyaround.hil.link.errors import FormatRefused, LinkError, PacketError
from flyaround.hil.link.packets.enums import format_mask
from flyaround.hil.link.packets.images import (
    FrameAssembler,
    chunk_count,
    chunks,
    decode_image,
    encode_image,
    supported_encodings,
)
from flyaround.hil.link.packets.messages import (
    Bye,
    Encoding,
    ErrorCode,
    FrameHeader,
    Hello,
    HelloAck,
    PixelFormat,
)
from flyaround.hil.link.packets.packet import Packet, PacketType
from flyaround.hil.link.session import Link, answer_hello, greet_host, refuse

CAMERA = {"width_px": 64, "height_px": 48}
TERMS = HelloAck(CAMERA, 64, 48, window=4, target_name="tango", target_sha256="ab" * 32)


def host_side(transport, act):
    """Run ``act(link, hello)`` once a HELLO came."""

    def serve():
        link = Link(transport)
        act(link, link.recv(5.0))

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    return thread


def test_handshake_settles_session_window_and_camera():
    board, host = virtual_pair()

    def act(link, hello):
        link.session_id = 77
        link.send(answer_hello(hello, TERMS))

    thread = host_side(host, act)
    link = Link(board)
    terms = greet_host(link, Hello(supported_encodings(), 2, "tango", "ab" * 32, "hybrid", "test"), 5.0)
    thread.join()
    assert (terms.camera, terms.window, terms.encoding, link.session_id) == (CAMERA, 2, Encoding.RAW, 77)


@pytest.mark.parametrize(
    ("offered", "wanted", "chosen"),
    [
        (0b11, (Encoding.ZSTD,), Encoding.ZSTD),
        (0b01, (Encoding.ZSTD,), Encoding.RAW),
        (0b101, (Encoding.ZSTD, Encoding.PNG), Encoding.PNG),
        (0b111, (), Encoding.RAW),
    ],
)
def test_compression_is_what_both_can_and_the_host_wants(offered, wanted, chosen):
    assert answer_hello(Hello(offered, 1), TERMS, encodings=wanted).encoding == chosen


def test_the_pixel_format_is_the_first_that_both_take():
    grey = Hello(pixel_formats=format_mask([PixelFormat.Mono8, PixelFormat.Mono16]))
    wanted = (PixelFormat.Mono12p, PixelFormat.Mono16)
    assert answer_hello(grey, TERMS, pixel_formats=wanted).pixel_format is PixelFormat.Mono16
    with pytest.raises(
        FormatRefused, match="accepts pixels as Mono8, Mono16 but the host sends RGB8: choose"
    ):
        answer_hello(grey, TERMS, pixel_formats=[PixelFormat.RGB8])


@pytest.mark.parametrize(
    ("hello", "sentence"),
    [
        (
            Hello(model_name="cygnus"),
            r"model of 'cygnus' but the host's target is 'tango': start the board with --target",
        ),
        (
            Hello(model_name="tango", model_sha256="cd" * 32),
            r"\(cdcdcdcdcdcd\) differs from the host.*copy it to the board",
        ),
    ],
)
def test_another_model_is_refused(hello, sentence):
    with pytest.raises(LinkError, match=sentence):
        answer_hello(hello, TERMS)


def test_an_unnamed_model_is_not_checked():
    assert answer_hello(Hello(), replace(TERMS, target_name="")).window == 1


def test_the_board_hears_why_it_is_refused():
    board, host = virtual_pair()
    thread = host_side(host, lambda link, _: refuse(link, ErrorCode.BUSY, "another board is connected"))
    with pytest.raises(LinkError, match="refuses: another board is connected"):
        greet_host(Link(board), Hello(), 5.0)
    thread.join()


def test_version_mismatch_is_one_sentence_at_the_board():
    board, host = virtual_pair()
    host.send_packet(Packet(PacketType.BYE, Bye("later protocol").encode(), version=9))
    with pytest.raises(
        LinkError, match="uses link protocol 9, this one 2: install the same version"
    ) as caught:
        greet_host(Link(board), Hello(), 5.0)
    assert "\n" not in str(caught.value)


def test_silence_is_one_sentence():
    board, _host = virtual_pair()
    with pytest.raises(LinkError, match=r"no flyaround host answers on it \(waited 0\.2 s\)"):
        greet_host(Link(board), Hello(), 0.2)


def test_hello_is_repeated_on_a_line_that_loses_it():
    board, host = virtual_pair(cobs=True)
    seen = []

    def act(link, hello):
        seen.append((hello, link.last_sequence))
        seen.append((link.recv(5.0), link.last_sequence))
        link.send(TERMS)

    thread = host_side(host, act)
    assert greet_host(Link(board), Hello(board="x"), 5.0, repeat_s=0.05).camera == CAMERA
    thread.join()
    assert [s for _, s in seen] == [0, 1]
    assert seen[0][0] == seen[1][0] == Hello(board="x")


def test_packets_of_an_earlier_session_are_left_out():
    a, b = virtual_pair()
    old, new, receiver = Link(a, 1), Link(a, 2), Link(b, 2)
    old.send(Bye("old"))
    new.send(Bye("new"))
    assert receiver.recv(1.0) == Bye("new")
    assert receiver.stats.stale == 1


# --- clock ---------------------------------------------------------------------------------


@settings(max_examples=200, deadline=None)
@given(
    st.integers(-(10**15), 10**15),
    st.lists(
        st.tuples(st.integers(0, 10**7), st.integers(0, 10**7), st.integers(0, 10**6)),
        min_size=1,
        max_size=16,
    ),
)
def test_offset_is_within_half_the_smallest_round_trip(offset_ns, delays):
    clock, now = ClockFilter(), 10**16
    for out, back, work in delays:
        clock.add(now, now + out + offset_ns, now + out + work + offset_ns, now + out + work + back)
        now += 10**9
    best = min(out + back for out, back, _ in delays)
    assert clock.round_trip_ns == best
    nearest = min(range(len(delays)), key=lambda k: delays[k][0] + delays[k][1])
    at = 10**16 + nearest * 10**9 + sum(delays[nearest]) // 2
    assert abs(clock.offset_at(at) - offset_ns) <= clock.offset_bound_at(at)
    assert clock.offset_bound_at(at) <= best / 2 + 2


def test_a_clock_that_runs_backwards_is_left_out():
    clock = ClockFilter()
    clock.add(100, 0, 500, 200)
    assert clock.offset_at(0) is None
    assert clock.round_trip_ns is None


def exchanges(seconds, *, ppm, seed, asymmetry_ns=40_000, every_s=0.25):
    """Round trips over a busy line: some tens of microseconds each way, now and then milliseconds on one of them."""
    rng = np.random.default_rng(seed)
    clock, offset_ns, start = ClockFilter(), 7 * 10**12, 10**13
    for k in range(int(seconds / every_s)):
        asked = start + round(k * every_s * 1e9)
        out, back = (30_000 + rng.exponential(asymmetry_ns, 2)).astype(int)
        if rng.random() < 0.3:
            out += int(rng.exponential(3e6))
        received = asked + out
        theirs = received + offset_ns + round(1e-6 * ppm * (received - start))
        clock.add(asked, theirs, theirs + 5_000, received + 5_000 + back)
    at = start + seconds * 10**9
    return clock, at, offset_ns + round(1e-6 * ppm * (at - start))


@pytest.mark.parametrize("ppm", [200.0, -37.0, 0.0])
@pytest.mark.parametrize("seed", range(5))
def test_drift_is_recovered_within_ten_ppm_over_a_minute_and_says_how_well(ppm, seed):
    clock, at, offset_ns = exchanges(60, ppm=ppm, seed=seed)
    assert abs(clock.line.drift_ppm - ppm) < 10.0
    # the uncertainty is no excuse and no boast
    assert abs(clock.line.drift_ppm - ppm) < 5 * clock.line.sigma_ppm
    assert clock.line.sigma_ppm < 2.0
    assert abs(clock.offset_at(at) - offset_ns) <= clock.offset_bound_at(at) < 100_000


def test_drift_is_not_told_from_a_second_and_its_bound_grows():
    clock, at, offset_ns = exchanges(2, ppm=90.0, seed=0)
    assert clock.line is None
    later = at + 20 * 10**9
    assert clock.offset_bound_at(later) > 1_800_000 > clock.offset_bound_at(at)
    assert abs(clock.offset_at(later) - offset_ns - 1_800_000) <= clock.offset_bound_at(later)


# --- images --------------------------------------------------------------------------------


def frame(frame_id, image, encoding, chunk_bytes):
    pixel_format = PixelFormat.Mono8 if image.dtype == np.uint8 else PixelFormat.Mono16
    data = encode_image(image, encoding, pixel_format)
    rows, columns = image.shape
    bits = 8 * image.dtype.itemsize
    count = chunk_count(len(data), chunk_bytes)
    header = FrameHeader(
        frame_id,
        columns,
        rows,
        bits,
        encoding,
        len(data),
        count,
        0.01,
        0.0,
        1,
        "2026-01-01T00:00:00Z",
        pixel_format,
    )
    parts = list(chunks(frame_id, data, chunk_bytes))
    assert len(parts) == count
    return header, parts


@pytest.mark.parametrize("encoding", list(Encoding))
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("chunk_bytes", [100, 1 << 18])
def test_image_round_trip_in_any_order(encoding, dtype, chunk_bytes):
    rng = np.random.default_rng(2)
    image = rng.integers(0, np.iinfo(dtype).max, (48, 65), dtype=dtype, endpoint=True)
    header, parts = frame(3, image, encoding, chunk_bytes)
    rng.shuffle(parts)
    assembler = FrameAssembler()
    assembler.header(header)
    done = [assembler.chunk(part) for part in parts]
    assert all(d is None for d in done[:-1])
    assert done[-1] is not None
    assert done[-1][0] == header
    np.testing.assert_array_equal(done[-1][1], image)
    assert not done[-1][1].flags.writeable
    assert assembler.lost() == []


def test_a_frame_that_misses_a_chunk_is_named_once():
    image = np.zeros((20, 20), np.uint8)
    (first, parts), (second, more) = frame(1, image, Encoding.RAW, 100), frame(2, image, Encoding.RAW, 100)
    assembler = FrameAssembler()
    assembler.header(first)
    for part in parts[:-1]:
        assembler.chunk(part)
    assembler.header(second)
    assert assembler.lost() == [1]
    for part in more:
        done = assembler.chunk(part)
    assert done is not None
    assert assembler.lost() == []


def test_packets_that_come_twice_change_nothing():
    image = np.arange(400, dtype=np.uint8).reshape(20, 20)
    assembler = FrameAssembler()
    for frame_id in (1, 2):
        header, parts = frame(frame_id, image, Encoding.RAW, 100)
        three_times = [one for one in (header, *parts) for _ in range(3)]
        done = [assembler.header(one) if one is header else assembler.chunk(one) for one in three_times]
        # the frame once, at the last chunk's first coming
        assert [k for k, d in enumerate(done) if d is not None] == [3 * len(parts)]
        # and what is late of it afterwards
        assembler.header(header)
        assert assembler.chunk(parts[0]) is None
        assert assembler.lost() == []


def test_damaged_zstd_and_lying_sizes_are_refused():
    header, parts = frame(1, np.zeros((40, 40), np.uint8), Encoding.ZSTD, 1 << 18)
    with pytest.raises(PacketError, match="damaged"):
        decode_image(b"\0" * 40, header)
    with pytest.raises(PacketError, match="unexpected size"):
        decode_image(parts[0].data, replace(header, height_px=400))
    with pytest.raises(PacketError, match="expected 1600"):
        decode_image(b"\0" * 40, replace(header, encoding=Encoding.RAW))
    with pytest.raises(PacketError, match="refused"):
        FrameAssembler().header(replace(header, total_bytes=2**31))
