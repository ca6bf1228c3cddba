"""The C header against the test vectors: an independent reader of the same bytes."""

import json
import math
import struct
from pathlib import Path

import pytest
from c_program import compiled
from programs import completed

from flyaround.hil.link.packets.packet import Packet, encode_packet
from tools.docs.link_vectors import EXAMPLES

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def decode(tmp_path_factory):
    """Hexadecimal packets in, one list of (name, value) per packet out."""
    source = Path(__file__).with_name("test_link_c_decoder.c")
    program = compiled(source, tmp_path_factory.mktemp("c"), "-Wconversion", "-Wno-sign-conversion")

    def run(packets):
        done = completed(program, input="\n".join(packets) + "\n", check=True)
        assert done.stderr == ""
        return [
            [(name, value) for name, _, value in (item.partition("=") for item in line.split())]
            for line in done.stdout.splitlines()
        ]

    return run


VECTORS = json.loads((ROOT / "docs" / "hil_vectors.json").read_text())["vectors"]


def expected_value(name, got, want):
    """Whether the C program's text of a field is the vector's value."""
    if isinstance(want, bool):
        return int(got) == int(want)
    if isinstance(want, int):
        return int(got) == want
    if isinstance(want, float):
        return math.isclose(float(got), want, rel_tol=0, abs_tol=0)
    if isinstance(want, dict):
        return json.loads(bytes.fromhex(got)) == want
    assert isinstance(want, str)
    return (
        got == want
        if name in {"data", "model_sha256", "target_sha256"}
        else bytes.fromhex(got).decode() == want
    )


@pytest.mark.parametrize("line", ["packet_hex", "serial_hex"])
def test_every_vector_every_field(decode, line):
    answers = decode([v[line] for v in VECTORS])
    assert len(answers) == len(VECTORS) == 15
    for vector, answer in zip(VECTORS, answers, strict=True):
        got = dict(answer)
        assert got["status"] == "0"
        assert got["payload_status"] == "0"
        assert got["resealed"] == "1"  # the C writer gives the same bytes
        assert int(got["type"]) == vector["type"]
        assert got["session"] == vector["session_id"]
        assert int(got["sequence"]) == vector["sequence"]
        fields = dict(vector["fields"])
        for name, prefix in (("q_camera_from_target_wxyz", "q"), ("t_camera_from_target_m", "t")):
            if name in fields:
                want = fields.pop(name)
                values = [float(v) for n, v in answer if n == prefix]
                assert int(got["has_pose"]) == (want is not None)
                assert values == (want if want is not None else [0.0] * len(values))
        for name, prefix in (("sun_camera", "sun"), ("covariance", "covariance")):
            if name in fields:
                want = fields.pop(name)
                values = [float(v) for n, v in answer if n == prefix]
                assert int(got[f"has_{prefix}"]) == (want is not None)
                assert values == (want if want is not None else [0.0] * len(values))
        if "roi_px" in fields:
            assert [int(v) for n, v in answer if n == "roi"] == list(fields.pop("roi_px"))
        if "stages_ms" in fields:
            names = [bytes.fromhex(v).decode() for n, v in answer if n == "stage"]
            ms = [float(v) for n, v in answer if n == "ms"]
            assert list(map(list, zip(names, ms, strict=True))) == fields.pop("stages_ms")
        for name, want in fields.items():
            assert expected_value(name, got[name], want), (vector["name"], name)


@pytest.mark.parametrize(
    ("name", "tail", "taken"),
    [
        ("frame_header", struct.pack("<HH3s", 700, 3, b"new"), True),
        ("frame_header", struct.pack("<HH2s", 700, 3, b"ne"), False),
        ("frame_header", struct.pack("<HH20s", 1, 20, b""), False),
        ("frame_header", struct.pack("<HH1021s", 700, 1021, b""), False),
        ("frame_header", b"\1", False),
        ("pose_declined", struct.pack("<HH3s", 700, 3, b"new"), True),
        ("pose_declined", struct.pack("<HH80s", 3, 80, b""), False),
        ("pose_declined", b"\1\2\3", False),
    ],
)
def test_unknown_fields_are_skipped_and_broken_ones_refused(decode, name, tail, taken):
    message = dict(EXAMPLES)[name]
    (answer,) = decode([encode_packet(Packet(message.TYPE, message.encode() + tail)).hex()])
    assert dict(answer)["payload_status"] == ("0" if taken else "-6")


def test_every_damaged_vector_is_refused(decode):
    packets = []
    for vector in VECTORS:
        data = bytearray.fromhex(vector["packet_hex"])
        for at in range(0, len(data), 7):
            data[at] ^= 0x10
            packets.append(data.hex())
            data[at] ^= 0x10
        packets.append(data[:-1].hex())
    assert all(int(dict(answer)["status"]) < 0 for answer in decode(packets))
