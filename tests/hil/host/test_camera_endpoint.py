"""The camera endpoint: its packets by their bytes, what it refuses, and pictures grabbed by Aravis over loopback."""

import hashlib
import json
import os
import random
import shutil
import socket
import struct
import subprocess
import threading
import time
import tracemalloc
from contextlib import contextmanager
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest

from hil.host.camera_endpoint import gvcp
from hil.host.camera_endpoint.camera import run_camera
from hil.host.camera_endpoint.endpoint import CameraEndpoint
from hil.host.camera_endpoint.genicam_xml import OWN_NAME, read_xml, write_xml
from hil.host.camera_endpoint.gvsp import Block, ReadoutRegion, StreamFormat, formats_of, pixels_of
from hil.host.camera_endpoint.interface import find_interface
from hil.host.camera_endpoint.messages import EndpointConfig, FrameWanted, Note
from hil.host.camera_endpoint.pictures import LoopedPictures, exposed_as
from hil.host.camera_endpoint.registers import XML_ADDRESS, XML_URL, CameraTerms, Place
from simulator.errors import UserError
from simulator.scenario.load import load_scenario
from simulator.scenario.plan import plan_flight

CLIENT = Path(__file__).parents[2] / "harness" / "aravis_client.py"
SYSTEM_PYTHON = "/usr/bin/python3"
SIZE = (96, 128)
N_IMAGES = 12
# of each test process its own, so that several can run at once: the port is the protocol's
ADDRESS = f"127.18.{os.getpid() >> 8 & 0x7F}.{max(os.getpid() & 0xFF, 2)}"


def images(size=SIZE, bits=8):
    rng = np.random.default_rng(3)
    dtype = np.uint8 if bits <= 8 else np.uint16
    return [rng.integers(0, 2**bits, size).astype(dtype) for _ in range(N_IMAGES)]


def hashes(pictures):
    return [hashlib.sha256(image.tobytes()).hexdigest() for image in pictures]


def config(size=SIZE, bits=8, interface="lo", address=ADDRESS, allowed=("127.0.0.1",), **more):
    terms = CameraTerms(
        width_px=size[1],
        height_px=size[0],
        bits=bits,
        exposure_us=1e4,
        rate_hz=30.0,
        scenario="a-test",
        target="tango",
    )
    return EndpointConfig(
        interface=find_interface(interface, address),
        allowed=allowed,
        terms=terms,
        xml=write_xml(terms),
        xml_name=OWN_NAME,
        **more,
    )


@contextmanager
def camera(pictures, settings):
    """An endpoint in its process, its pictures from a thread of this one; yields what it says."""
    opened, stop, notes = threading.Event(), threading.Event(), []
    looped = LoopedPictures(pictures, bits=settings.terms.bits, exposure_s=0.01)
    thread = threading.Thread(
        target=run_camera,
        args=(looped, settings),
        kwargs={"on_opened": opened.set, "on_note": notes.append, "stopped": stop.is_set},
    )
    thread.start()
    try:
        assert opened.wait(30)
        yield notes
    finally:
        stop.set()
        thread.join(10)


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
    return status(endpoint._answer(command(0x82, struct.pack(">II", place, value)), peer))


def as_float(value):
    return int.from_bytes(struct.pack(">f", value), "big")


# --- packets ------------------------------------------------------------------------------------


def test_command_and_acknowledgement_by_their_bytes():
    request = gvcp.parse_request(bytes.fromhex("42 01 0080 0004 1234 00000a00"))
    assert request == gvcp.GvcpRequest(0x80, 0x1234, bytes.fromhex("00000a00"), wants_answer=True)
    assert gvcp.read_addresses(request.payload) == (0xA00,)
    assert gvcp.acknowledge(request, b"\0\0\0\2").hex() == "000000810004123400000002"
    refused = gvcp.acknowledge(request, status=gvcp.Status.ACCESS_DENIED)
    assert refused.hex() == "8006008100001234"


def test_picture_by_its_bytes():
    region = ReadoutRegion(x=1, y=2, width=40, height=20)
    block = Block(
        block_id=0x0102,
        timestamp_ns=0x1122334455667788,
        pixel_format=StreamFormat.Mono8,
        region=region,
        data=bytes(range(200)) * 4,
        packet_bytes=576,
    )
    assert block.n_packets == 4
    assert block.packet(0).hex() == (
        "0000 0102 01 000000 0000 0001 1122334455667788 01080001 00000028 00000014 00000001 00000002 0000 0000"
    ).replace(" ", "")
    assert block.packet(1)[:8].hex() == "0000010203000001"
    assert len(block.packet(1)) + 28 == 576
    assert block.packet(1)[8:] + block.packet(2)[8:] == block.data
    assert block.packet(3).hex() == "00000102020000030000000100000014"
    assert block.packet(2, status=0x0100)[:2].hex() == "0100"


def test_pixel_formats_hold_the_detectors_numbers():
    image = (np.arange(64 * 64, dtype=np.uint16) % 4096).reshape(64, 64)
    region = ReadoutRegion(x=8, y=4, width=16, height=32)
    part = image[4:36, 8:24]
    twelve = np.frombuffer(pixels_of(image, 12, region, StreamFormat.Mono12), "<u2").reshape(32, 16)
    assert np.array_equal(twelve, part)
    eight = np.frombuffer(pixels_of(image, 12, region, StreamFormat.Mono8), np.uint8).reshape(32, 16)
    assert np.array_equal(eight, part >> 4)
    assert formats_of(8) == (StreamFormat.Mono8,)
    assert formats_of(10) == (StreamFormat.Mono10, StreamFormat.Mono8)
    assert formats_of(11) == (StreamFormat.Mono12, StreamFormat.Mono8)


# --- control ------------------------------------------------------------------------------------


def test_discovery_and_description(endpoint):
    camera, _ = endpoint
    answer = camera._answer(command(0x0002, flags=0x11), PEER)
    assert struct.unpack_from(">HHH", answer) == (0, 3, 0xF8)
    assert socket.inet_ntoa(answer[8 + 0x24 : 8 + 0x28]) == ADDRESS
    url = camera._registers.read(XML_URL, 512).rstrip(b"\0").decode()
    name, at, length = url.removeprefix("Local:").split(";")
    assert (name, int(at, 16)) == (OWN_NAME, XML_ADDRESS)
    xml = b""
    for k in range(0, int(length, 16), 512):
        count = min(512, -(-(int(length, 16) - k) // 4) * 4)
        answer = camera._answer(command(0x84, struct.pack(">II", XML_ADDRESS + k, count)), PEER)
        xml += answer[12:]
    assert xml[: int(length, 16)] == camera._config.xml


def test_one_controller(endpoint):
    camera, pipe = endpoint
    assert write(camera, Place.WIDTH, 64) == gvcp.Status.ACCESS_DENIED
    assert write(camera, Place.CONTROL_PRIVILEGE, 2) == 0
    assert write(camera, Place.WIDTH, 64) == 0
    assert write(camera, Place.CONTROL_PRIVILEGE, 2, OTHER) == gvcp.Status.ACCESS_DENIED
    assert write(camera, Place.WIDTH, 32, OTHER) == gvcp.Status.ACCESS_DENIED
    read = command(0x80, struct.pack(">I", Place.WIDTH))
    assert struct.unpack(">I", camera._answer(read, OTHER)[8:]) == (64,)
    assert write(camera, Place.CONTROL_PRIVILEGE, 0) == 0
    assert write(camera, Place.CONTROL_PRIVILEGE, 1, OTHER) == 0
    # exclusive: others may not even read
    assert (
        status(camera._answer(command(0x80, struct.pack(">I", Place.WIDTH)), PEER))
        == gvcp.Status.ACCESS_DENIED
    )
    said = [pipe.recv().sentence for _ in range(4)]
    assert "asked for control" in said[1]


def test_control_ends_with_the_heartbeat(endpoint):
    camera, pipe = endpoint
    assert write(camera, Place.CONTROL_PRIVILEGE, 2) == 0
    assert write(camera, Place.HEARTBEAT_MS, 500) == 0
    assert write(camera, Place.STREAM_PORT, 4000) == 0
    camera._heard_s -= 1.0
    camera.step()
    assert camera._registers[Place.STREAM_PORT] == 0
    assert write(camera, Place.CONTROL_PRIVILEGE, 2, OTHER) == 0
    assert "said nothing" in [pipe.recv().sentence for _ in range(2)][1]


def test_settings_reach_the_next_picture(endpoint):
    camera, pipe = endpoint
    write(camera, Place.CONTROL_PRIVILEGE, 2)
    for place, value in (
        (Place.EXPOSURE_TIME, as_float(2500.0)),
        (Place.GAIN, as_float(6.0)),
        (Place.TRIGGER_MODE, 1),
        (Place.ACQUISITION_START, 1),
    ):
        assert write(camera, place, value) == 0
    camera.step()
    assert isinstance(pipe.recv(), Note)
    assert not pipe.poll()  # it waits for its trigger
    assert write(camera, Place.WIDTH, 32) == gvcp.Status.BUSY
    assert write(camera, Place.TRIGGER_SOFTWARE, 1) == 0
    camera.step()
    wanted = pipe.recv()
    assert wanted.exposure_s == pytest.approx(2.5e-3)
    assert wanted.gain_db == 6.0


def test_repeated_command_is_carried_out_once(endpoint):
    camera, _ = endpoint
    write(camera, Place.CONTROL_PRIVILEGE, 2)
    for place in (Place.TRIGGER_MODE, Place.ACQUISITION_START):
        write(camera, place, 1)
    trigger = command(0x82, struct.pack(">II", Place.TRIGGER_SOFTWARE, 1))
    first = camera._answer(trigger, PEER)
    camera._triggered = False
    assert camera._answer(trigger, PEER) == first
    assert not camera._triggered


def test_what_is_refused(endpoint):
    camera, _ = endpoint
    write(camera, Place.CONTROL_PRIVILEGE, 2)
    for place, value, refusal in (
        (Place.WIDTH, 8, gvcp.Status.INVALID_PARAMETER),
        (Place.WIDTH, SIZE[1] + 1, gvcp.Status.INVALID_PARAMETER),
        (Place.OFFSET_X, 1, gvcp.Status.INVALID_PARAMETER),
        (Place.PIXEL_FORMAT, StreamFormat.Mono16, gvcp.Status.INVALID_PARAMETER),
        (Place.EXPOSURE_TIME, as_float(float("nan")), gvcp.Status.INVALID_PARAMETER),
        (Place.EXPOSURE_TIME, as_float(-1.0), gvcp.Status.INVALID_PARAMETER),
        (Place.GAIN, as_float(float("inf")), gvcp.Status.INVALID_PARAMETER),
        (Place.STREAM_PACKET_BYTES, 10, gvcp.Status.INVALID_PARAMETER),
        (Place.STREAM_PACKET_BYTES, 1 << 31 | 20000, gvcp.Status.INVALID_PARAMETER),
        (Place.SENSOR_WIDTH, 64, gvcp.Status.WRITE_PROTECT),
        (0x0006, 64, gvcp.Status.BAD_ALIGNMENT),
        (0xFFFFFFFC, 1, gvcp.Status.INVALID_ADDRESS),
        (XML_ADDRESS, 1, gvcp.Status.WRITE_PROTECT),
        # pictures are sent to the controller and to no third machine
        (Place.STREAM_ADDRESS, 0xC0000201, gvcp.Status.INVALID_PARAMETER),
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
        assert status(camera._answer(command(0x84, payload), PEER)) == refusal, payload
    across = struct.pack(">I2I", Place.CONTROL_PRIVILEGE, 2, 0)
    assert status(camera._answer(command(0x86, across), PEER)) == gvcp.Status.ACCESS_DENIED
    assert status(camera._answer(command(0x1234), PEER)) == gvcp.Status.NOT_IMPLEMENTED


def test_strangers_are_not_answered(endpoint):
    camera, pipe = endpoint
    for k in range(100):
        assert camera._answer(command(0x0002, flags=0x11), (f"10.0.0.{k}", 5)) is None
    told = 0
    while pipe.poll():
        assert "not among" in pipe.recv().sentence
        told += 1
    assert told == 16  # nobody fills the log


def test_hostile_packets_take_no_memory(endpoint):
    camera, pipe = endpoint
    write(camera, Place.CONTROL_PRIVILEGE, 2)
    rng = random.Random(5)
    numbers = (0x0002, 0x0040, 0x0080, 0x0082, 0x0084, 0x0086, 0x0004, 0xFFFF)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(3000):
            payload = rng.randbytes(rng.randrange(0, 560))
            if rng.random() < 0.5:  # addresses near real ones
                payload = (
                    struct.pack(">I", rng.choice(list(Place)) + rng.randrange(-8, 8) & 0xFFFFFFFF) + payload
                )
            datagram = bytearray(command(rng.choice(numbers), payload, flags=rng.randrange(256)))
            if rng.random() < 0.3:
                datagram[rng.randrange(len(datagram))] ^= 1 << rng.randrange(8)
            answer = camera._answer(bytes(datagram), PEER if rng.random() < 0.8 else OTHER)
            assert answer is None or len(answer) <= gvcp.MOST_BYTES
            while pipe.poll():
                pipe.recv()
        # a request for sixteen million packets
        camera._answer(command(0x0040, struct.pack(">HHII", 0, 1, 0, 0xFFFFFF)), PEER)
        now, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert now - before < 200_000
    assert peak - before < 500_000


# --- what a setting does ------------------------------------------------------------------------


def wanted(number=0, exposure_s=0.01, gain_db=0.0):
    return FrameWanted(request_id=1, number=number, t_s=0.0, exposure_s=exposure_s, gain_db=gain_db)


def test_looped_pictures_take_exposure_and_gain():
    image = np.array([[10, 20, 100, 255]], np.uint8)
    looped = LoopedPictures([image], bits=8, exposure_s=0.01, black_dn=10)
    assert looped.take(wanted(3)) is image
    assert looped.take(wanted(exposure_s=0.02)).tolist() == [[10, 30, 190, 255]]
    assert looped.take(wanted(gain_db=20 * np.log10(0.5))).tolist() == [[10, 15, 55, 132]]


def test_drawn_scenes_take_exposure_and_gain():
    scene = plan_flight(load_scenario("tango-limb"), n=1).scene(0)
    changed = exposed_as(scene, wanted(exposure_s=0.005, gain_db=6.0))
    assert changed.exposure_s == 0.005
    assert scene.sensor.full_scale_j_m2_sr / changed.sensor.full_scale_j_m2_sr == pytest.approx(
        1.9953, abs=1e-3
    )
    # what is amplified is signal and noise alike
    assert changed.sensor.gaussian_variance / scene.sensor.gaussian_variance == pytest.approx(3.981, abs=1e-3)


def test_interfaces_and_descriptions_are_checked(tmp_path):
    with pytest.raises(UserError, match="no network interface"):
        find_interface("nothing0")
    with pytest.raises(UserError, match="no IPv4 address"):
        find_interface("lo", "example.org")
    with pytest.raises(UserError, match="neither"):
        read_xml(tmp_path / "camera.txt")
    (tmp_path / "own camera.xml").write_text("<RegisterDescription/>")
    assert read_xml(tmp_path / "own camera.xml") == ("owncamera.xml", b"<RegisterDescription/>")
    (tmp_path / "own camera.xml").write_text("<html/>")
    with pytest.raises(UserError, match="RegisterDescription"):
        read_xml(tmp_path / "own camera.xml")


# --- by Aravis ----------------------------------------------------------------------------------


def need_aravis():
    asked = [SYSTEM_PYTHON, "-c", "import gi; gi.require_version('Aravis', '0.8')"]
    if not Path(SYSTEM_PYTHON).exists() or subprocess.run(asked, capture_output=True, check=False).returncode:
        pytest.skip("no Aravis here: apt-get install gir1.2-aravis-0.8 python3-gi")


def aravis(*arguments, address=ADDRESS, prefix=()):
    """What the client says, as JSON; a second process that has the control is waited for once."""
    line = [*prefix, SYSTEM_PYTHON, str(CLIENT), address, *arguments]
    done = subprocess.run(line, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_aravis_grabs_equal_pixels_despite_loss():
    need_aravis()
    pictures = images()
    with camera(pictures, config(loss_share=0.05, loss_seed=2)) as notes:
        got = aravis("grab", str(N_IMAGES))
        assert got["failed"] == 0
        assert got["resent"] > 0
        assert {frame["sha256"] for frame in got["frames"]} <= set(hashes(pictures))
        assert len(got["frames"]) == N_IMAGES
        # again, with a region and twice the exposure
        got = aravis("grab", "2", "Width=32", "Height=16", "OffsetX=8", "ExposureTime=5000.0")
        assert [frame["size"] for frame in got["frames"]] == [[32, 16]] * 2
        assert got["frames"][0]["mean"] == pytest.approx(64, abs=10)
    assert sum("gave control back" in note for note in notes) == 2


def test_second_client_is_refused_and_a_killed_one_is_followed():
    need_aravis()
    with camera(images(), config()) as notes:
        line = [SYSTEM_PYTHON, str(CLIENT), ADDRESS, "hold"]
        with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as holder:
            assert holder.stdout.readline() == '"held"\n'
            assert "error" in aravis("grab", "1")
            holder.kill()
        until = time.monotonic() + 10
        while not any("said nothing" in note for note in notes) and time.monotonic() < until:
            time.sleep(0.05)
        assert aravis("trigger", "3")["failed"] == 0
    assert any("refused" in note for note in notes)


# --- longer: a whole camera's rate, the network, a dissector --------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.0, 0.01, 0.05])
def test_every_pixel_arrives_at_30_hz_despite_loss(loss):
    need_aravis()
    pictures = images((1024, 1024))
    with camera(pictures, config((1024, 1024), loss_share=loss)):
        got = aravis("grab", "150")
    assert got["failed"] == 0
    assert got["resent"] > 0 or not loss  # on a busy machine its socket may lose some of its own
    numbers = [frame["number"] for frame in got["frames"]]
    known = hashes(pictures)
    assert [known.index(frame["sha256"]) for frame in got["frames"]] == [(k - 1) % N_IMAGES for k in numbers]
    span_s = (got["frames"][-1]["timestamp_ns"] - got["frames"][0]["timestamp_ns"]) * 1e-9
    assert (numbers[-1] - numbers[0]) / span_s == pytest.approx(30, rel=0.1)


@pytest.mark.slow
def test_aravis_camera_test_has_no_failed_frame():
    if shutil.which("arv-camera-test-0.8") is None:
        pytest.skip("no arv-camera-test-0.8 here: apt-get install aravis-tools")
    line = [
        "arv-camera-test-0.8",
        "-n",
        ADDRESS,
        "-f",
        "30",
        "-w",
        "1024",
        "-h",
        "1024",
        "--duration",
        "6",
    ]
    with camera(images((1024, 1024)), config((1024, 1024))):
        for _ in range(2):  # started, stopped, started again
            done = subprocess.run(line, capture_output=True, text=True, timeout=60, check=True)
            said = dict(row.split("=") for row in done.stdout.splitlines() if row.startswith("n_"))
            counts = {name.strip(): int(value) for name, value in said.items()}
            assert counts["n_completed_buffers"] > 150
            for none in (
                "n_failures",
                "n_aborted",
                "n_missing_frames",
                "n_size_mismatch_errors",
                "n_error_packets",
            ):
                assert counts[none] == 0, none


@contextmanager
def other_namespace():
    """A network namespace with one line to this one: its name, this end's interface."""
    name, near, far = f"fa{os.getpid()}", f"fa{os.getpid()}a", f"fa{os.getpid()}b"
    lines = [
        f"netns add {name}",
        f"link add {near} type veth peer name {far} netns {name}",
        f"addr add 10.213.7.1/24 dev {near} broadcast 10.213.7.255",
        f"link set {near} up",
        f"-n {name} addr add 10.213.7.2/24 dev {far} broadcast 10.213.7.255",
        f"-n {name} link set {far} up",
    ]
    try:
        for line in lines:
            if shutil.which("ip") is None:
                pytest.skip("no ip here")
            if subprocess.run(["ip", *line.split()], capture_output=True, check=False).returncode:
                pytest.skip(f"no network namespaces here: ip {line}")
        yield name, near
    finally:
        subprocess.run(["ip", "link", "del", near], capture_output=True, check=False)
        subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


@pytest.mark.slow
def test_from_another_network_namespace():
    need_aravis()
    pictures = images()
    with other_namespace() as (name, interface):
        into = ("ip", "netns", "exec", name)
        settings = config(interface=interface, address=None, allowed=("10.213.7.2",))
        with camera(pictures, settings):
            got = aravis("grab", "10", address="10.213.7.1", prefix=into)
            assert got["failed"] == 0
            assert {frame["sha256"] for frame in got["frames"]} <= set(hashes(pictures))
            found = "import gi; gi.require_version('Aravis', '0.8'); from gi.repository import Aravis as A;"
            found += (
                "A.update_device_list(); print([A.get_device_address(k) for k in range(A.get_n_devices())])"
            )
            line = [*into, SYSTEM_PYTHON, "-c", found]
            done = subprocess.run(line, capture_output=True, text=True, timeout=60, check=True)
            assert "10.213.7.1" in done.stdout  # by broadcast
        with camera(pictures, config(interface=interface, address=None, allowed=("10.213.7.3",))) as notes:
            assert "error" in aravis("grab", "1", address="10.213.7.1", prefix=into)
        assert any("10.213.7.2 is not among" in note for note in notes)


@pytest.mark.slow
def test_a_dissector_finds_nothing_malformed(tmp_path):
    need_aravis()
    if shutil.which("tshark") is None:
        pytest.skip("no tshark here: apt-get install tshark")
    file = tmp_path / "camera.pcap"
    watch = ["tshark", "-i", "lo", "-w", str(file), "-f", f"host {ADDRESS} and udp"]
    with subprocess.Popen(watch, stderr=subprocess.PIPE, text=True) as capture:
        for said in capture.stderr:
            if "Capturing on" in said:
                break
            if "permission" in said.lower():
                pytest.skip("capturing is not permitted here")
        time.sleep(1.0)
        with camera(images(), config(loss_share=0.05)):
            assert aravis("grab", "5", "GevSCPSPacketSize=1400")["failed"] == 0
        time.sleep(1.0)
        capture.terminate()
        capture.communicate(timeout=20)

    def count(expression, *more):
        line = ["tshark", "-r", str(file), *more, "-Y", expression]
        done = subprocess.run(line, capture_output=True, text=True, timeout=60, check=True)
        return len(done.stdout.splitlines())

    # the stream goes to a port of the client's choosing
    ports = subprocess.run(
        [
            "tshark",
            "-r",
            str(file),
            "-Y",
            f"ip.src=={ADDRESS} and udp.srcport!=3956",
            "-T",
            "fields",
            "-e",
            "udp.dstport",
        ],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    ).stdout.split()
    stream = [f"-dudp.port=={port},gvsp" for port in sorted(set(ports))]
    assert count("gvcp") > 50
    assert count("gvsp", *stream) > 40
    assert count("_ws.malformed or _ws.expert.severity >= 0x800000", *stream) == 0
