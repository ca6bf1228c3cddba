"""What a run leaves for other tools, read back by programs that are not ours."""

import itertools
import json
import math
import socket
from dataclasses import replace

import numpy as np
import pytest
from hil_loop import Instant, Loop, board, made_frame
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from space_packet_parser import SpacePacket, load_xtce  # noqa: F401 - the type that its generator gives
from space_packet_parser.generators import ccsds_generator

from flyaround.hil.host.recording.ros_log import RosLog
from flyaround.hil.host.recording.space_packets import KINDS, SpacePacketSink, cds_time
from flyaround.hil.host.report import write_report
from flyaround.simulator.errors import UserError
from flyaround.simulator.world.time.instant import nanoseconds_utc

N = 6
EPOCHS = [f"2026-08-20T09:30:0{k}.{k}23456Z" for k in range(N)]
Q = (0.5, -0.5, 0.5, 0.5)


class Declines(Instant):
    """Declines the third frame."""

    def estimate(self, image):
        found = super().estimate(image)
        found.stages_ms = {"prepare": 1.5, "decide": 0.25}
        if image[0, 0] == 2:
            found.accepted, found.reason = False, "too dark"
        return found


def flight(dtype=np.uint8):
    rng = np.random.default_rng(3)
    for k in range(N):
        image = rng.integers(0, np.iinfo(dtype).max, (48, 64), endpoint=True).astype(dtype)
        image[0, 0] = k
        frame = made_frame(k, image, every_s=1.0, q=Q, t_m=(0.1, -0.2, 3.0 + k))
        scene = replace(frame.scene, epoch_utc=EPOCHS[k])
        yield replace(frame, scene=scene)


def run_with(*recorders, **options):
    summary = Loop(board(Declines)).run(flight(), recorders=recorders, truth="off", **options)
    assert (summary.accepted, summary.declined) == (N - 1, 1)
    return list(flight())


def read(path):
    """Read each message by a library that did not write it: topic, time [ns], message."""
    with path.open("rb") as file:
        for _, channel, message, decoded in make_reader(
            file, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            yield channel.topic, message.log_time, decoded


def test_mcap_is_read_by_mcap_ros2_support(tmp_path):
    path = tmp_path / "run.mcap"
    frames = run_with(RosLog(path))
    by_topic = {}
    for topic, stamp_ns, message in read(path):
        by_topic.setdefault(topic, []).append((stamp_ns, message))
    assert {topic: len(found) for topic, found in by_topic.items()} == {
        "/camera/image_raw": N,
        "/camera/camera_info": N,
        "/truth/pose": N,
        "/estimate/pose": N - 1,
        "/tf": 2 * N - 1,
        "/timing": N,
    }
    for k, (stamp_ns, image) in enumerate(by_topic["/camera/image_raw"]):
        assert stamp_ns == nanoseconds_utc(EPOCHS[k])
        assert image.header.stamp.sec * 10**9 + image.header.stamp.nanosec == stamp_ns
        assert (image.encoding, image.header.frame_id) == ("mono8", "camera_optical")
        pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
        assert np.array_equal(pixels, frames[k].image)
    info = by_topic["/camera/camera_info"][0][1]
    camera = frames[0].scene.camera
    assert list(info.k) == [camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1]
    assert (info.width, info.height, info.distortion_model) == (64, 48, "plumb_bob")
    pose = by_topic["/truth/pose"][4][1].pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (0.1, -0.2, 7.0)
    assert (pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z) == Q
    timing = [message for _, message in by_topic["/timing"]]
    assert [t.outcome for t in timing] == ["accepted", "accepted", "declined", *["accepted"] * 3]
    assert timing[2].reason == "too dark"
    assert timing[0].stage_names == ["prepare", "decide"]
    assert list(timing[0].stage_ms) == [1.5, 0.25]
    assert all(0 < t.board_total_ms < t.e2e_ms for t in timing)
    children = {m.transforms[0].child_frame_id for _, m in by_topic["/tf"]}
    assert children == {"target", "target_estimate"}


def test_16_bits_keep_their_bytes(tmp_path):
    log = RosLog(tmp_path / "deep.mcap")
    frame = next(iter(flight(np.uint16)))
    log.frame(frame)
    log.close()
    found = [message for topic, _, message in read(tmp_path / "deep.mcap") if topic == "/camera/image_raw"]
    assert found[0].encoding == "mono16"
    assert np.array_equal(np.frombuffer(found[0].data, "<u2").reshape(48, 64), frame.image)


def test_live_view_is_a_websocket():
    log = RosLog(None, ("127.0.0.1", 0))
    try:
        with socket.create_connection(("127.0.0.1", log.port), timeout=5) as client:
            client.sendall(
                b"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
                b"Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
            )
            answer = client.recv(4096)
        assert answer.startswith(b"HTTP/1.1 101")
        # RFC 6455, section 1.3: the answer to that very key
        assert b"s3pPLMBiTxaQ9kYGzzhZRbK+xOo=" in answer
        log.frame(next(iter(flight())))
    finally:
        log.close()


def test_space_packets_are_read_by_their_description(tmp_path):
    path = tmp_path / "telemetry.bin"
    run_with(SpacePacketSink(str(path)))
    definition = load_xtce(tmp_path / "telemetry.xtce.xml")
    with path.open("rb") as stream:
        found = [definition.parse_bytes(binary) for binary in ccsds_generator(stream)]
    names = {kind.apid: name for name, kind in KINDS.items()}
    by_name = {name: [p for p in found if names[p["PKT_APID"]] == name] for name in KINDS}
    assert {name: len(packets) for name, packets in by_name.items()} == {
        "TRUTH": N,
        "ESTIMATE": N,
        "TIMING": N,
    }
    for k, truth in enumerate(by_name["TRUTH"]):
        assert (truth["SRC_SEQ_CTR"], truth["TRUTH_frame_id"]) == (k, k)
        assert truth["TRUTH_t_z_m"] == 3.0 + k
        assert tuple(truth[f"TRUTH_q_{c}"] for c in "wxyz") == Q
        # days since 1958 and the time of day, by hand: 2026-08-20 is day 25068
        assert truth["CDS_DAYS"] == 25068
        assert truth["CDS_MS_OF_DAY"] == ((9 * 60 + 30) * 60 + k) * 1000 + k * 100 + 23
        assert truth["CDS_US_OF_MS"] == 456
    assert [p["ESTIMATE_outcome"] for p in by_name["ESTIMATE"]][:3] == ["accepted", "accepted", "declined"]
    assert by_name["ESTIMATE"][0]["ESTIMATE_position_error_m"] == pytest.approx(math.hypot(0.1, 0.2, 2.0))
    assert all(p["TIMING_e2e_ms"] > 0 for p in by_name["TIMING"])
    assert math.isnan(by_name["TIMING"][0]["TIMING_send_lag_ms"])


def test_space_packets_as_datagrams():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ground:
        ground.bind(("127.0.0.1", 0))
        ground.settimeout(5)
        sink = SpacePacketSink(f"udp://127.0.0.1:{ground.getsockname()[1]}")
        sink.frame(next(iter(flight())))
        data = ground.recv(2048)
        sink.close()
    assert int.from_bytes(data[:2], "big") & 0x7FF == KINDS["TRUTH"].apid
    assert int.from_bytes(data[4:6], "big") + 7 == len(data)
    assert data[6:14] == cds_time(EPOCHS[0])[:8]


def test_truth_does_not_leave_this_machine():
    for target in ("udp://192.0.2.1:5700", "udp://127.0.0.1", "udp://:5700"):
        with pytest.raises(UserError, match=r"another machine|not an address"):
            SpacePacketSink(target)


def test_files_that_are_there_are_kept(tmp_path):
    for name, make in (("a.mcap", RosLog), ("a.bin", lambda p: SpacePacketSink(str(p)))):
        path = tmp_path / name
        path.write_bytes(b"mine")
        with pytest.raises(UserError, match="name another"):
            make(path)
        assert path.read_bytes() == b"mine"


def test_a_recorder_that_fails_does_not_end_the_run(tmp_path, caplog):
    class Full:
        def frame(self, frame):
            if frame.number == 2:
                raise OSError(28, "No space left on device")

        def row(self, frame, row):
            pass

        def close(self):
            closed.append(self)
            raise OSError(28, "No space left on device")

    closed = []
    with pytest.raises(UserError, match="No space left on device; the run continued to its end"):
        run_with(Full(), log_dir=tmp_path / "log")
    assert len(closed) == 1
    assert "Full stops: " in caplog.text
    page = write_report(tmp_path / "log")
    trace = json.loads((page.parent / "trace.json").read_text())
    spans = [e for e in trace["traceEvents"] if e["ph"] == "X"]
    assert {e["name"] for e in spans} >= {"frame 0", "prepare", "decide", "pose 5"}
    # spans of one track follow each other
    for track in {(e["pid"], e["tid"]) for e in spans}:
        own = [e for e in spans if (e["pid"], e["tid"]) == track]
        assert all(a["ts"] + a["dur"] <= b["ts"] + 1e-3 for a, b in itertools.pairwise(own))
