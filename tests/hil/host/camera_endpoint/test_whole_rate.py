"""Longer: a whole camera's rate, another network namespace, a dissector."""

import contextlib
import hashlib
import os
import shutil
import subprocess
import time

import pytest
from camera_kit import (
    ADDRESS,
    N_IMAGES,
    SYSTEM_PYTHON,
    aravis,
    camera,
    config,
    hashes,
    images,
    need_aravis,
    other_namespace,
)
from programs import completed


@pytest.fixture(autouse=True)
def _before_other_programs():
    """Endpoint and client at real-time priority, where it is permitted: the rate is theirs alone."""
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(5))
    yield
    os.sched_setscheduler(0, *before)


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
    line = f"arv-camera-test-0.8 -n {ADDRESS} -f 30 -w 1024 -h 1024 --duration 6".split()
    with camera(images((1024, 1024)), config((1024, 1024))):
        for _ in range(2):  # started, stopped, started again
            done = completed(*line, timeout=60, check=True)
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


@pytest.mark.slow
def test_gstreamer_grabs_equal_pixels(tmp_path):
    if shutil.which("gst-launch-1.0") is None:
        pytest.skip("no GStreamer here: apt-get install gstreamer1.0-tools gstreamer1.0-plugins-base")
    size, file = (512, 512), tmp_path / "frames.raw"
    pictures = images(size)
    line = f"gst-launch-1.0 -q aravissrc camera-name={ADDRESS} num-buffers=30"
    line += " ! video/x-raw,format=GRAY8,width=512,height=512"
    with camera(pictures, config(size)):
        subprocess.run([*line.split(), "!", "filesink", f"location={file}"], timeout=60, check=True)
    data, known = file.read_bytes(), hashes(pictures)
    got = [data[k : k + pictures[0].nbytes] for k in range(0, len(data), pictures[0].nbytes)]
    assert len(got) == 30
    assert {hashlib.sha256(picture).hexdigest() for picture in got} == set(known)


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
            done = completed(*line, timeout=60, check=True)
            assert "10.213.7.1" in done.stdout  # by broadcast
        with camera(pictures, config(interface=interface, address=None, allowed=("10.213.7.3",))) as notes:
            assert "error" in aravis("grab", "1", address="10.213.7.1", prefix=into)
        assert any("10.213.7.2 is not an allowed controller" in note for note in notes)


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
        done = completed(*line, timeout=60, check=True)
        return len(done.stdout.splitlines())

    # the stream goes to a port of the client's choosing
    line = ["tshark", "-r", file, "-Y", f"ip.src=={ADDRESS} and udp.srcport!=3956", "-T", "fields"]
    ports = completed(*line, "-e", "udp.dstport", timeout=60, check=True).stdout.split()
    stream = [f"-dudp.port=={port},gvsp" for port in sorted(set(ports))]
    assert count("gvcp") > 50
    assert count("gvsp", *stream) > 40
    assert count("_ws.malformed or _ws.expert.severity >= 0x800000", *stream) == 0
