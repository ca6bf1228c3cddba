"""What a controller may do, what it is refused, and what a hostile network gains: an endpoint in this process."""

import random
import socket
import struct
import time
import tracemalloc
from multiprocessing import Pipe

import numpy as np
import pytest
from camera_kit import ADDRESS, SIZE, config

from flyaround.hil.host.camera_endpoint import gvcp
from flyaround.hil.host.camera_endpoint.endpoint import CameraEndpoint
from flyaround.hil.host.camera_endpoint.genicam_xml import OWN_NAME
from flyaround.hil.host.camera_endpoint.gvsp import StreamFormat
from flyaround.hil.host.camera_endpoint.messages import ImageResult, Note
from flyaround.hil.host.camera_endpoint.registers import XML_ADDRESS, XML_URL, Register


@pytest.fixture
def endpoint():
    """An endpoint in this process, and the drawing side's end of its pipe."""
    ours, theirs = Pipe()
    opened = CameraEndpoint(theirs, config())
    yield opened, ours
    opened.close()
    ours.close()
    theirs.close()


PEER, OTHER = ("127.0.0.1", 50000), ("127.0.0.1", 50001)
_ids = iter(range(1, 60000))


def command(number, payload=b"", flags=1):
    return struct.pack(">BBHHH", 0x42, flags, number, len(payload), next(_ids)) + payload


def status(answer):
    return struct.unpack_from(">H", answer)[0]


def write(endpoint, place, value, peer=PEER):
    return status(endpoint.answer(command(0x82, struct.pack(">II", place, value)), peer))


def as_float(value):
    return int.from_bytes(struct.pack(">f", value), "big")


def test_discovery_and_description(endpoint):
    camera, _ = endpoint
    answer = camera.answer(command(0x0002, flags=0x11), PEER)
    assert struct.unpack_from(">HHH", answer) == (0, 3, 0xF8)
    assert socket.inet_ntoa(answer[8 + 0x24 : 8 + 0x28]) == ADDRESS
    url = camera._registers.read(XML_URL, 512).rstrip(b"\0").decode()
    name, at, length = url.removeprefix("Local:").split(";")
    assert (name, int(at, 16)) == (OWN_NAME, XML_ADDRESS)
    xml = b""
    for k in range(0, int(length, 16), 512):
        count = min(512, -(-(int(length, 16) - k) // 4) * 4)
        answer = camera.answer(command(0x84, struct.pack(">II", XML_ADDRESS + k, count)), PEER)
        xml += answer[12:]
    assert xml[: int(length, 16)] == camera._config.xml


def test_one_controller(endpoint):
    camera, pipe = endpoint
    assert write(camera, Register.WIDTH, 64) == gvcp.Status.ACCESS_DENIED
    assert write(camera, Register.CONTROL_PRIVILEGE, 2) == 0
    assert write(camera, Register.WIDTH, 64) == 0
    assert write(camera, Register.CONTROL_PRIVILEGE, 2, OTHER) == gvcp.Status.ACCESS_DENIED
    assert write(camera, Register.WIDTH, 32, OTHER) == gvcp.Status.ACCESS_DENIED
    read = command(0x80, struct.pack(">I", Register.WIDTH))
    assert struct.unpack(">I", camera.answer(read, OTHER)[8:]) == (64,)
    assert write(camera, Register.CONTROL_PRIVILEGE, 0) == 0
    assert write(camera, Register.CONTROL_PRIVILEGE, 1, OTHER) == 0
    # exclusive: others may not even read
    assert (
        status(camera.answer(command(0x80, struct.pack(">I", Register.WIDTH)), PEER))
        == gvcp.Status.ACCESS_DENIED
    )
    said = [pipe.recv().sentence for _ in range(4)]
    assert "was refused control" in said[1]


def test_control_ends_with_the_heartbeat(endpoint):
    camera, pipe = endpoint
    assert write(camera, Register.CONTROL_PRIVILEGE, 2) == 0
    assert write(camera, Register.HEARTBEAT_MS, 500) == 0
    assert write(camera, Register.STREAM_PORT, 4000) == 0
    camera._last_command_s -= 1.0
    camera.step()
    assert camera._registers[Register.STREAM_PORT] == 0
    assert write(camera, Register.CONTROL_PRIVILEGE, 2, OTHER) == 0
    assert "sent no heartbeat" in [pipe.recv().sentence for _ in range(2)][1]


def test_settings_reach_the_next_picture(endpoint):
    camera, pipe = endpoint
    write(camera, Register.CONTROL_PRIVILEGE, 2)
    for place, value in (
        (Register.EXPOSURE_TIME, as_float(2500.0)),
        (Register.GAIN, as_float(6.0)),
        (Register.TRIGGER_MODE, 1),
        (Register.ACQUISITION_START, 1),
    ):
        assert write(camera, place, value) == 0
    camera.step()
    assert isinstance(pipe.recv(), Note)
    assert not pipe.poll()  # it waits for its trigger
    assert write(camera, Register.WIDTH, 32) == gvcp.Status.BUSY
    assert write(camera, Register.TRIGGER_SOFTWARE, 1) == 0
    camera.step()
    wanted = pipe.recv()
    assert wanted.exposure_s == pytest.approx(2.5e-3)
    assert wanted.gain_db == 6.0


def test_no_picture_leaves_before_its_exposure_is_over(endpoint):
    camera, pipe = endpoint
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5.0)
        write(camera, Register.CONTROL_PRIVILEGE, 2)
        here = int.from_bytes(socket.inet_aton("127.0.0.1"), "big")
        for place, value in (
            (Register.STREAM_PORT, receiver.getsockname()[1]),
            (Register.STREAM_ADDRESS, here),
            (Register.EXPOSURE_TIME, as_float(2e5)),
            (Register.ACQUISITION_START, 1),
        ):
            assert write(camera, place, value) == 0
        begun_s = time.monotonic()
        camera.step()
        assert isinstance(pipe.recv(), Note)
        wanted = pipe.recv()
        pipe.send(ImageResult(wanted.request_id, np.zeros(SIZE, np.uint8)))
        while camera._registers[Register.FRAMES_SENT] == 0:
            camera.step()
        assert time.monotonic() - begun_s >= 0.19
        camera.step()
        assert receiver.recv(2000)[4] == 1  # its leader


def test_repeated_command_is_carried_out_once(endpoint):
    camera, _ = endpoint
    write(camera, Register.CONTROL_PRIVILEGE, 2)
    for place in (Register.TRIGGER_MODE, Register.ACQUISITION_START):
        write(camera, place, 1)
    trigger = command(0x82, struct.pack(">II", Register.TRIGGER_SOFTWARE, 1))
    first = camera.answer(trigger, PEER)
    camera._acquisition.triggered = False
    assert camera.answer(trigger, PEER) == first
    assert not camera._acquisition.triggered


def test_what_is_refused(endpoint):
    camera, _ = endpoint
    write(camera, Register.CONTROL_PRIVILEGE, 2)
    for place, value, refusal in (
        (Register.WIDTH, 8, gvcp.Status.INVALID_PARAMETER),
        (Register.WIDTH, SIZE[1] + 1, gvcp.Status.INVALID_PARAMETER),
        (Register.OFFSET_X, 1, gvcp.Status.INVALID_PARAMETER),
        (Register.PIXEL_FORMAT, StreamFormat.Mono16, gvcp.Status.INVALID_PARAMETER),
        (Register.EXPOSURE_TIME, as_float(float("nan")), gvcp.Status.INVALID_PARAMETER),
        (Register.EXPOSURE_TIME, as_float(-1.0), gvcp.Status.INVALID_PARAMETER),
        (Register.GAIN, as_float(float("inf")), gvcp.Status.INVALID_PARAMETER),
        (Register.STREAM_PACKET_BYTES, 10, gvcp.Status.INVALID_PARAMETER),
        (Register.STREAM_PACKET_BYTES, 1 << 31 | 20000, gvcp.Status.INVALID_PARAMETER),
        (Register.SENSOR_WIDTH, 64, gvcp.Status.WRITE_PROTECT),
        (0x0006, 64, gvcp.Status.BAD_ALIGNMENT),
        (0xFFFFFFFC, 1, gvcp.Status.INVALID_ADDRESS),
        (XML_ADDRESS, 1, gvcp.Status.WRITE_PROTECT),
        # pictures are sent to the controller and to no third machine
        (Register.STREAM_ADDRESS, 0xC0000201, gvcp.Status.INVALID_PARAMETER),
    ):
        assert write(camera, place, value) == refusal, (place, value)
    for payload, refusal in (
        (struct.pack(">II", 0, 0), gvcp.Status.INVALID_PARAMETER),
        (struct.pack(">II", 0, 0xFFFC), gvcp.Status.INVALID_PARAMETER),
        (struct.pack(">II", 0, 6), gvcp.Status.BAD_ALIGNMENT),
        (struct.pack(">II", 0xFFFFFF00, 512), gvcp.Status.INVALID_ADDRESS),
        (struct.pack(">II", 0x9000, 512), gvcp.Status.INVALID_ADDRESS),
        (b"", gvcp.Status.INVALID_HEADER),
    ):
        assert status(camera.answer(command(0x84, payload), PEER)) == refusal, payload
    across = struct.pack(">I2I", Register.CONTROL_PRIVILEGE, 2, 0)
    assert status(camera.answer(command(0x86, across), PEER)) == gvcp.Status.ACCESS_DENIED
    assert status(camera.answer(command(0x1234), PEER)) == gvcp.Status.NOT_IMPLEMENTED


def test_strangers_are_not_answered(endpoint):
    camera, pipe = endpoint
    for k in range(100):
        assert camera.answer(command(0x0002, flags=0x11), (f"10.0.0.{k}", 5)) is None
    told = 0
    while pipe.poll():
        assert "not an allowed controller" in pipe.recv().sentence
        told += 1
    assert told == 16  # nobody fills the log


def test_hostile_packets_take_no_memory(endpoint):
    camera, pipe = endpoint
    write(camera, Register.CONTROL_PRIVILEGE, 2)
    rng = random.Random(5)
    numbers = (0x0002, 0x0040, 0x0080, 0x0082, 0x0084, 0x0086, 0x0004, 0xFFFF)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(3000):
            payload = rng.randbytes(rng.randrange(0, 560))
            if rng.random() < 0.5:  # addresses near real ones
                payload = (
                    struct.pack(">I", rng.choice(list(Register)) + rng.randrange(-8, 8) & 0xFFFFFFFF)
                    + payload
                )
            datagram = bytearray(command(rng.choice(numbers), payload, flags=rng.randrange(256)))
            if rng.random() < 0.3:
                datagram[rng.randrange(len(datagram))] ^= 1 << rng.randrange(8)
            answer = camera.answer(bytes(datagram), PEER if rng.random() < 0.8 else OTHER)
            assert answer is None or len(answer) <= gvcp.MAX_BYTES
            while pipe.poll():
                pipe.recv()
        # a request for sixteen million packets
        camera.answer(command(0x0040, struct.pack(">HHII", 0, 1, 0, 0xFFFFFF)), PEER)
        now, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert now - before < 200_000
    assert peak - before < 500_000
