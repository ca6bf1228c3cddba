"""A GenICam client by Aravis's Python binding, for the system's interpreter: aravis_client.py ADDRESS COMMAND...

``grab N [FEATURE=VALUE...]`` prints one line of JSON with a SHA-256 of each picture; ``hold`` takes control, streams,
and waits to be killed; ``trigger N`` asks for N pictures by software trigger. ``save FILE`` writes one picture's bytes.
``features NAME...|NAME=VALUE...`` sets the latter and prints what all are afterwards.
"""

import hashlib
import json
import sys
import time
from pathlib import Path

import gi

gi.require_version("Aravis", "0.8")
from gi.repository import Aravis  # noqa: E402 - the version is asked for first

PLAIN_BYTES = 100_000
"""Pictures that the system's usual receive buffer holds; larger ones ask for a packet socket."""

PATIENCE_US, RETENTION_US = 10_000_000, 2_500_000
"""For the next picture, and for packets that were lost and are sent again: a busy machine may take seconds."""


def say(what):
    """One line of JSON."""
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def set_feature(camera, text):
    """Set one feature by the type of what is written."""
    name, value = text.split("=")
    if value.replace(".", "", 1).isdigit():
        kind = camera.set_float if "." in value else camera.set_integer
        kind(name, float(value) if "." in value else int(value))
    else:
        camera.set_string(name, value)


def features(camera, arguments):
    """What features are, after those with a value were set."""
    names = [text.split("=")[0] for text in arguments]
    for text in arguments:
        if "=" in text:
            set_feature(camera, text)
    device = camera.get_device()
    values = {}
    for name in names:
        node = device.get_feature(name)
        kind = "" if node is None else node.get_node_name()
        if kind == "Float":
            values[name] = camera.get_float(name)
        elif kind in {"Integer", "IntReg", "MaskedIntReg"}:
            values[name] = camera.get_integer(name)
        elif kind in {"Enumeration", "StringReg"}:
            values[name] = camera.get_string(name)
        else:
            values[name] = None
    return values


def main():
    """Do what the command line says."""
    address, command, *arguments = sys.argv[1:]
    try:
        camera = Aravis.Camera.new(address)
    except gi.repository.GLib.Error as error:
        say({"error": str(error)})
        return 1
    if not camera.get_device().is_controller():
        say({"error": "no control"})
        return 1
    if command == "features":
        say(features(camera, arguments))
        return 0
    n = int(arguments[0]) if command in {"grab", "trigger"} else 1
    for text in arguments[1:]:
        set_feature(camera, text)
    if camera.get_payload() < PLAIN_BYTES:
        # before its filter is set, a packet socket hears what other programs say on this interface
        camera.gv_set_stream_options(Aravis.GvStreamOption.PACKET_SOCKET_DISABLED)
    stream = camera.create_stream(None, None)
    stream.set_property("frame-retention", RETENTION_US)
    size = camera.get_payload()
    for _ in range(20):
        stream.push_buffer(Aravis.Buffer.new_allocate(size))
    if command == "trigger":
        camera.set_trigger("Software")
    camera.start_acquisition()
    frames, failed = [], 0
    if command == "hold":
        say("held")
        time.sleep(60)
    while len(frames) < n and failed < 20:
        if command == "trigger":
            time.sleep(0.02)
            camera.software_trigger()
        buffer = stream.timeout_pop_buffer(PATIENCE_US)
        if buffer is None or buffer.get_status() != Aravis.BufferStatus.SUCCESS:
            failed += 1
        else:
            data = buffer.get_data()
            if command == "save":
                Path(arguments[0]).write_bytes(data)
            frames.append(
                {
                    "sha256": hashlib.sha256(data).hexdigest(),
                    "size": [buffer.get_image_width(), buffer.get_image_height()],
                    "format": buffer.get_image_pixel_format(),
                    "mean": sum(data) / len(data),
                    "number": buffer.get_frame_id(),
                    "timestamp_ns": buffer.get_timestamp(),
                }
            )
        if buffer is not None:
            stream.push_buffer(buffer)
    resent = stream.get_info_uint64_by_name("n_resent_packets")
    camera.stop_acquisition()
    say({"frames": frames, "failed": failed, "resent": resent})
    return 0


if __name__ == "__main__":
    sys.exit(main())
