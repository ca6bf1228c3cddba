"""What the tests of the camera endpoint share: pictures, an endpoint that loops them, and Aravis as its client."""

import hashlib
import json
import os
import shutil
import subprocess
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from flyaround.hil.host.camera_endpoint.genicam_xml import OWN_NAME, write_xml
from flyaround.hil.host.camera_endpoint.interface import find_interface
from flyaround.hil.host.camera_endpoint.messages import EndpointConfig
from flyaround.hil.host.camera_endpoint.pictures import LoopedPictures
from flyaround.hil.host.camera_endpoint.registers import CameraTerms
from flyaround.hil.host.camera_endpoint.simulated_camera import run_camera

CLIENT = Path(__file__).with_name("aravis_client.py")
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


class Notes(list):
    """What an endpoint says, and where boards answer."""

    answers_url = None


@contextmanager
def camera(pictures, settings, *, ledger=None, scenes=()):
    """An endpoint in its process, its pictures from a thread of this one; yields what it says."""
    opened, stop, notes = threading.Event(), threading.Event(), Notes()
    looped = LoopedPictures(pictures, bits=settings.terms.bits, exposure_s=0.01, scenes=scenes)

    def on_opened(answers_url):
        notes.answers_url = answers_url
        opened.set()

    thread = threading.Thread(
        target=run_camera,
        args=(looped, settings),
        kwargs={
            "ledger": ledger,
            "on_opened": on_opened,
            "on_note": notes.append,
            "stopped": stop.is_set,
        },
    )
    thread.start()
    try:
        assert opened.wait(60)
        yield notes
    finally:
        stop.set()
        thread.join(60)


def need_aravis():
    asked = [SYSTEM_PYTHON, "-c", "import gi; gi.require_version('Aravis', '0.8')"]
    if not Path(SYSTEM_PYTHON).exists() or subprocess.run(asked, capture_output=True, check=False).returncode:
        pytest.skip("no Aravis here: apt-get install gir1.2-aravis-0.8 python3-gi")


def aravis(*arguments, address=ADDRESS, prefix=()):
    """What the client says, as JSON; a second process that has the control is waited for once."""
    line = [*prefix, SYSTEM_PYTHON, str(CLIENT), address, *arguments]
    done = subprocess.run(line, capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


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
