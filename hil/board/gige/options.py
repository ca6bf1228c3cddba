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


def check_options(url: str, values: Dict[str, Any]) -> None:
    """Raise for options of a host given with a camera URL, and vice versa.

    Parameters
    ----------
    url : str
        URL of the host or camera.
    values : dict of str to object
        Option values by `AgentOption.name`.

    Raises
    ------
    LinkError
        If an option does not apply to the URL; the message is one sentence.
    """
    at_camera = url.startswith(SCHEME)
    table = [o for o in AGENT_OPTIONS if o.name in OF_HOSTS] if at_camera else CAMERA_OPTIONS
    wrong = [option.flag for option in table if values[option.name] != option.default]
    if wrong:
        other = "a host, not to a camera" if at_camera else f"a camera ({SCHEME}ADDRESS), not to a host"
        raise LinkError(
            f"{', '.join(wrong)} {'applies' if len(wrong) == 1 else 'apply'} to {other}: omit"
            f" {'it' if len(wrong) == 1 else 'them'}"
        )


def camera_board_options(values: Dict[str, Any]) -> CameraBoardOptions:
    """Return the options of a board that reads a camera.

    Parameters
    ----------
    values : dict of str to object
        Option values by `AgentOption.name`, of both tables.

    Returns
    -------
    CameraBoardOptions
        Checked options.

    Raises
    ------
    LinkError
        If a value or the key cannot be used; the message is one sentence.
    """
    for name, least in (("timeout", 1e-9), ("silence", 1e-9), ("frames", 1), ("packet_size", 0)):
        if values[name] is not None and not values[name] >= least:
            raise LinkError(f"--{name.replace('_', '-')} {values[name]:g} is too small")
    return CameraBoardOptions(
        settings=CameraSettings(
            exposure_us=values["exposure"],
            gain_db=values["gain"],
            rate_hz=values["rate"],
            roi_px=None if values["roi"] is None else parse_roi(values["roi"]),
            pixel_format=values["pixel_format"],
            packet_bytes=values["packet_size"],
            software_trigger=values["trigger"],
            packet_socket=not values["no_packet_socket"],
        ),
        camera_file=values["camera"],
        poses_file=values["poses"],
        answer_url=values["answer"],
        key=None if values["key"] is None else read_key(values["key"]),
        timeout_s=values["timeout"],
        most_frames=values["frames"],
        silence_s=values["silence"],
    )
