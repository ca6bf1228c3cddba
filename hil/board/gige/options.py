"""Command-line options of a board that reads a GigE Vision camera, in addition to the common ones."""

from __future__ import annotations

from typing import Any, Dict, Tuple

from flyaround.hil.board.gige.camera import SCHEME, CameraSettings, parse_roi
from flyaround.hil.board.gige.camera_board import CameraBoardOptions
from flyaround.hil.board.options import AGENT_OPTIONS, AgentOption
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.security import read_key

TITLE = f"A camera on the network, {SCHEME}ADDRESS"
CAMERA_OPTIONS: Tuple[AgentOption, ...] = (
    AgentOption(
        "--camera",
        str,
        None,
        "CAMERA.json: intrinsics of the whole detector (default with --answer: the host's).",
        "FILE",
    ),
    AgentOption(
        "--poses",
        str,
        None,
        "Write poses here, .csv or JSON lines (default: the standard output, unless --answer).",
        "FILE",
    ),
    AgentOption(
        "--answer", str, None, "Also send poses to this host, the URL of hil camera --answers.", "URL"
    ),
    AgentOption("--frames", int, None, "Exit after N pictures.", "N"),
    AgentOption("--trigger", bool, False, "Request each picture with a software trigger."),
    AgentOption("--exposure", float, None, "Exposure time in microseconds.", "US"),
    AgentOption("--gain", float, None, "Gain in decibels.", "DB"),
    AgentOption("--rate", float, None, "Pictures a second.", "HZ"),
    AgentOption("--roi", str, None, "Region of the detector to read.", "X,Y,W,H"),
    AgentOption(
        "--pixel-format", str, None, "GenICam name of the pixel format, such as Mono8 or Mono12.", "NAME"
    ),
    AgentOption(
        "--packet-size", int, None, "Packet size of the stream in bytes; 0: the largest possible.", "BYTES"
    ),
    AgentOption(
        "--no-packet-socket",
        bool,
        False,
        "Do not use a packet socket, whose buffer is larger but which needs root.",
    ),
)
OF_HOSTS = ("window", "reconnect", "watchdog")


def check_options(url: str, given: Dict[str, Any]) -> None:
    """Raise for options of a host given with a camera URL, and vice versa.

    Parameters
    ----------
    given : dict of str to object
        Option values by `AgentOption.name`.

    Raises
    ------
    LinkError
        If an option does not apply to the URL; the message is one sentence.
    """
    at_camera = url.startswith(SCHEME)
    table = [o for o in AGENT_OPTIONS if o.name in OF_HOSTS] if at_camera else CAMERA_OPTIONS
    wrong = [option.flag for option in table if given[option.name] != option.default]
    if wrong:
        other = "a host, not with a camera" if at_camera else f"a camera ({SCHEME}ADDRESS), not with a host"
        raise LinkError(
            f"{', '.join(wrong)} {'applies' if len(wrong) == 1 else 'apply'} to {other}: leave out"
        )


def camera_board_options(given: Dict[str, Any]) -> CameraBoardOptions:
    """Return the options of a board that reads a camera.

    Parameters
    ----------
    given : dict of str to object
        Option values by `AgentOption.name`, of both tables.

    Raises
    ------
    LinkError
        If a value or the key cannot be used; the message is one sentence.
    """
    for name, least in (("timeout", 1e-9), ("silence", 1e-9), ("frames", 1), ("packet_size", 0)):
        if given[name] is not None and not given[name] >= least:
            raise LinkError(f"--{name.replace('_', '-')} {given[name]:g} is too small")
    return CameraBoardOptions(
        settings=CameraSettings(
            exposure_us=given["exposure"],
            gain_db=given["gain"],
            rate_hz=given["rate"],
            roi_px=None if given["roi"] is None else parse_roi(given["roi"]),
            pixel_format=given["pixel_format"],
            packet_bytes=given["packet_size"],
            software_trigger=given["trigger"],
            packet_socket=not given["no_packet_socket"],
        ),
        camera_file=given["camera"],
        poses_file=given["poses"],
        answer_url=given["answer"],
        key=None if given["key"] is None else read_key(given["key"]),
        timeout_s=given["timeout"],
        most_frames=given["frames"],
        silence_s=given["silence"],
    )
