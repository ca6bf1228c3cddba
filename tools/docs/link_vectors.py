"""Test vectors of the protocol: packets as bytes and as fields, for other decoders.

``python -m tools.docs.link_vectors > docs/hil_vectors.json`` writes them, and with ``--session``
``docs/hil_session.txt``.
"""

from __future__ import annotations

import dataclasses
import json
import re
import sys
import textwrap
from enum import IntEnum
from typing import Any

from flyaround.hil.link.framing import cobs
from flyaround.hil.link.framing.length_prefix import PREFIX
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
    Message,
    Mode,
    PixelFormat,
    PoseMessage,
    TimeSyncReply,
    TimeSyncRequest,
    Transfer,
    TruthMessage,
    TruthPolicy,
)
from flyaround.hil.link.packets.packet import PROTOCOL_VERSION, Packet, encode_packet

SESSION_ID = 0x0123456789ABCDEF  # any number with eight different bytes

_CAMERA = {
    "width_px": 1920,
    "height_px": 1200,
    "fx_px": 3003.41297,
    "fy_px": 3003.41297,
    "cx_px": 959.5,
    "cy_px": 599.5,
    "distortion": {"model": "none", "coefficients": []},
}

EXAMPLES: list[tuple[str, Message]] = [
    ("hello", Hello(7, 2, "tango", "5a" * 32, "svd", "bench board, aarch64", 0b01111)),
    ("hello_fields", Hello(1, 1, "tango", "5a" * 32, "mine", "a board", 1, takes_fields=True)),
    (
        "hello_ack",
        HelloAck(
            _CAMERA,
            1920,
            1200,
            8,
            Encoding.ZSTD,
            Mode.REALTIME,
            TruthPolicy.SEPARATE,
            2,
            262144,
            "tango",
            "5a" * 32,
        ),
    ),
    ("time_sync_request", TimeSyncRequest(1_000_000_007)),
    ("time_sync_reply", TimeSyncReply(1_000_000_007, 77_000_000_001, 77_000_000_900, 41)),
    (
        "frame_header",
        FrameHeader(
            41,
            1920,
            1200,
            12,
            Encoding.RAW,
            3456000,
            14,
            0.012,
            4.1,
            987654321012345,
            "2026-11-21T03:31:40.123456Z",
            PixelFormat.Mono12p,
            1,
            1,
            (8, 16, 1920, 1200),
            1041,
            1795231900117456000,
            1795231900129456000,
        ),
    ),
    (
        "frame_header_fields",
        FrameHeader(
            42,
            64,
            48,
            8,
            Encoding.RAW,
            3072,
            1,
            0.012,
            4.2,
            987654331012345,
            "2026-11-21T03:31:40.223456Z",
            sun_camera=(0.6, 0.0, -0.8),
            transfer=Transfer.SRGB,
        ),
    ),
    ("frame_chunk", FrameChunk(41, 3, 786432, bytes(range(256)))),
    (
        "pose_accepted",
        PoseMessage(
            41,
            accepted=True,
            q_camera_from_target_wxyz=(0.5, -0.5, 0.5, -0.5),
            t_camera_from_target_m=(0.125, -0.25, 9.75),
            confidence=0.875,
            stages_ms=(("gradient", 5.5), ("roi", 0.25), ("pnp", 12.125)),
            receive_ns=77_000_001_000,
            start_ns=77_000_002_000,
            end_ns=77_018_002_000,
        ),
    ),
    (
        "pose_declined",
        PoseMessage(
            42, accepted=False, reason="too few lines: 3 of at least 5", receive_ns=1, start_ns=2, end_ns=3
        ),
    ),
    (
        "pose_covariance",
        PoseMessage(
            43,
            accepted=True,
            q_camera_from_target_wxyz=(1.0, 0.0, 0.0, 0.0),
            t_camera_from_target_m=(0.0, 0.0, 9.75),
            confidence=0.5,
            receive_ns=1,
            start_ns=2,
            end_ns=3,
            covariance=tuple((k + 1) / 1024 for k in range(21)),
        ),
    ),
    ("credit", Credit(42, 2)),
    ("truth", TruthMessage(41, {"q_camera_from_target_wxyz": [0.5, -0.5, 0.5, -0.5], "seed": 7})),
    ("bye", Bye("the run is over")),
    ("error", ErrorMessage(ErrorCode.INCOMPLETE, "frame 41 lost a packet on the line", 41)),
]


_HOST_STEP, _BOARD_STEP = 1_000_000, 5_000_000  # interval of the time stamps on either side [ns]
# four by two pixels; the host chooses the session id
_PIXELS = bytes([0, 16, 32, 48, 64, 80, 96, 255])
_SMALL = {**_CAMERA, "width_px": 4, "height_px": 2, "cx_px": 1.5, "cy_px": 0.5}
SESSION: list[tuple[str, Message]] = [
    ("board", Hello(1, 1, "tango", "", "mine", "a board", 1)),
    ("host", HelloAck(_SMALL, 4, 2, target_name="tango")),
    ("host", TimeSyncRequest(1 * _HOST_STEP)),
    ("board", TimeSyncReply(1 * _HOST_STEP, 1 * _BOARD_STEP, 1 * _BOARD_STEP + 1000)),
    (
        "host",
        FrameHeader(
            0,
            4,
            2,
            8,
            Encoding.RAW,
            8,
            1,
            0.01,
            0.0,
            2 * _HOST_STEP,
            "2026-11-21T03:31:40.000000Z",
            roi_px=(0, 0, 4, 2),
            exposure_start_ns=1_795_231_899_995_000_000,
            exposure_end_ns=1_795_231_900_005_000_000,
        ),
    ),
    ("host", FrameChunk(0, 0, 0, _PIXELS)),
    (
        "board",
        PoseMessage(
            0,
            accepted=True,
            q_camera_from_target_wxyz=(1.0, 0.0, 0.0, 0.0),
            t_camera_from_target_m=(0.0, 0.0, 10.0),
            confidence=0.5,
            receive_ns=2 * _BOARD_STEP,
            start_ns=2 * _BOARD_STEP + 1000,
            end_ns=3 * _BOARD_STEP,
        ),
    ),
    ("board", Credit(0, 1)),
    ("host", Bye("the run is over")),
]
"""One session in lockstep on one frame, the content of docs/hil_session.txt."""


def session_packets() -> list[tuple[str, Message, bytes]]:
    """Return side, message and packet bytes of each step of `SESSION`; each side numbers its own packets from 0."""
    counts = {"board": 0, "host": 0}
    out = []
    for side, message in SESSION:
        session_id = 0 if isinstance(message, Hello) else SESSION_ID
        out.append(
            (side, message, encode_packet(Packet(message.TYPE, message.encode(), session_id, counts[side])))
        )
        counts[side] += 1
    return out


def session_text() -> str:
    """Return the bytes of the session as text; runs of more than three zero bytes are written ``00*N``."""
    lines = []
    for side, message, data in session_packets():
        lines.append(f"{side}: {message.TYPE.name}, {len(data)} bytes")
        for name, part in (("header", data[:24]), ("payload", data[24:-4]), ("CRC-32", data[-4:])):
            runs = re.findall(rb"\0{4,}|[^\0]|\0", part, re.DOTALL)
            run_texts = [f"00*{len(run)}" if len(run) > 3 else run.hex() for run in runs]
            lines += textwrap.wrap(
                " ".join(run_texts), 108, initial_indent=f"  {name:8}", subsequent_indent=" " * 10
            )
    return "\n".join(lines)


def _plain(value: Any) -> Any:  # noqa: ANN401 - a dataclass field
    if isinstance(value, IntEnum):
        return int(value)
    return value.hex() if isinstance(value, bytes) else value


def vectors() -> dict[str, Any]:
    """Return the document: packets in hexadecimal with their fields, as sent over TCP and over a serial line."""
    entries = []
    for sequence, (name, message) in enumerate(EXAMPLES):
        data = encode_packet(Packet(message.TYPE, message.encode(), SESSION_ID, sequence))
        fields = {f.name: _plain(getattr(message, f.name)) for f in dataclasses.fields(message)}
        entries.append(
            {
                "name": name,
                "type": int(message.TYPE),
                "session_id": f"{SESSION_ID:016x}",
                "sequence": sequence,
                "fields": fields,
                "packet_hex": data.hex(),
                "tcp_hex": (PREFIX.pack(len(data)) + data).hex(),
                "serial_hex": (b"\0" + cobs.encode(data) + b"\0").hex(),
            }
        )
    return {
        "schema": "flyaround.hil_vectors",
        "version": 1,
        "protocol_version": PROTOCOL_VERSION,
        "vectors": entries,
    }


if __name__ == "__main__":
    # --session: docs/hil_session.txt
    text = session_text() if "--session" in sys.argv[1:] else json.dumps(vectors(), indent=1)
    sys.stdout.write(text + "\n")
