"""Options of ``flyaround hil host``."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, get_args

import typer
from msgspec import Meta

from flyaround.hil.host.link_process.ipc import Compression, PixelFormatName
from flyaround.hil.link.session import SILENCE_S
from flyaround.runs.document import NOT_RECORDED, Only, Run
from flyaround.runs.fields import Count, Device, Duration, File, FlightSeed, ScenarioArgument
from flyaround.simulator.runtime.sections import Section

POSE_S, CONNECT_S = 30.0, 60.0
"""Default time-outs for a pose and for a board to connect, without ``timeout_s`` [s]."""

AtLeastTenth = Annotated[float, Meta(ge=0.1)]


class Line(Section, frozen=True, kw_only=True):
    """Line to the board."""

    listen: Annotated[
        str,
        typer.Option(
            help="tcp://HOST:PORT or serial:///DEVICE?baud=N for a board; gige://IFACE like hil camera."
        ),
    ] = "tcp://127.0.0.1:5600"
    key: Annotated[
        File | None,
        typer.Option(help="File with the key required of boards and loggers; hil key writes one."),
    ] = None
    truth: Annotated[
        Literal["separate", "inline", "off"],
        typer.Option(
            help="Ground truth: separate (own endpoint, next port), inline (with each frame) or off."
        ),
    ] = "separate"
    pixel_format: Annotated[
        PixelFormatName,
        typer.Option(
            help=f"Pixel format on the line, a GenICam name: {', '.join(get_args(PixelFormatName))} (auto: all bits)."
        ),
    ] = "auto"
    encoding: Annotated[
        Compression,
        typer.Option(
            help=f"One of {', '.join(get_args(Compression))} (auto: zstd on a serial line, else raw)."
        ),
    ] = "auto"
    silence_s: Annotated[
        Annotated[float, Meta(ge=0.5)],
        typer.Option(
            "--silence",
            help="Seconds of silence, without even a sign of life, after which the board counts as lost.",
        ),
    ] = SILENCE_S
    max_misses: Annotated[
        Annotated[int, Meta(ge=0)],
        typer.Option(
            help="Number of successive unanswered frames after which the board counts as lost; 0: never."
        ),
    ] = 3
    allow_none: Annotated[
        bool,
        typer.Option(
            "--allow-none", help="Exit with 0, not 3, if no pose was accepted or the board left for good."
        ),
    ] = False


class SentPictures(Section, frozen=True, kw_only=True):
    """Images to send."""

    n: Annotated[Count | None, typer.Option("-n", help="Frames, evenly in time (default 30).")] = None
    every_s: Annotated[
        float | None, typer.Option("--every", help="Seconds between frames, instead of -n.")
    ] = None
    source: Annotated[
        File | None,
        typer.Option(
            "--from",
            help="Send the pictures of this folder or data set in a loop, at the flight's times, instead of rendering.",
        ),
    ] = None
    send_sun: Annotated[
        bool,
        typer.Option(
            "--send-sun",
            help="Send the direction to the Sun with each frame; a chaser knows it from its star tracker.",
        ),
    ] = False
    time_code: Annotated[
        bool,
        typer.Option(
            "--time-code", help="Draw frame number and exposure time into a corner of each picture."
        ),
    ] = False
    workers: Annotated[
        Annotated[int, Meta(ge=1, le=64)],
        typer.Option(help="Number of render processes, for higher frame rates."),
        NOT_RECORDED,
    ] = 1
    gpu: Annotated[Device | None, typer.Option(help="EGL device to render on."), NOT_RECORDED] = None


class Timing(Section, frozen=True, kw_only=True):
    """Pace of the images, and time-outs for answers."""

    mode: Annotated[
        Literal["lockstep", "realtime"],
        typer.Option(
            help="lockstep: wait for each pose; realtime: paced by simulated time, after up to 15 s of warm-up."
        ),
    ] = "lockstep"
    latency_s: Annotated[
        Duration,
        typer.Option(
            "--latency",
            help="realtime: seconds from the end of the exposure to the camera's hand-over of the picture.",
        ),
    ] = 0.0
    deadline_s: Annotated[
        Duration | None,
        typer.Option(
            "--deadline",
            help="Seconds from the start of sending a frame to its pose, beyond which the deadline is missed (realtime"
            " default: the frame interval).",
        ),
    ] = None
    timeout_s: Annotated[
        AtLeastTenth | None,
        typer.Option(
            "--timeout",
            help=f"Seconds to wait for a pose (default {POSE_S:g}) and for a board (default {CONNECT_S:g}).",
        ),
    ] = None
    wait_s: Annotated[
        AtLeastTenth | None,
        typer.Option("--wait", help="Seconds to wait for the first board, instead of --timeout."),
    ] = None


class Recording(Section, frozen=True, kw_only=True):
    """Recordings of the run."""

    log: Annotated[
        File | None, typer.Option(help="New or empty folder for frames.csv and summary.json."), NOT_RECORDED
    ] = None
    mcap: Annotated[
        File | None,
        typer.Option(
            help="Also write pictures, truth, answers and timing as ROS 2 messages to this .mcap file."
        ),
        NOT_RECORDED,
    ] = None
    live: Annotated[
        Annotated[int, Meta(ge=0, le=65535)] | None,
        typer.Option(help="Serve the same messages live to Foxglove or Lichtblick on this local port."),
        NOT_RECORDED,
    ] = None
    ccsds: Annotated[
        str | None,
        typer.Option(
            help="Also write truth and answers as CCSDS space packets to a file or udp://127.0.0.1:PORT."
        ),
        NOT_RECORDED,
    ] = None


class FaultsFile(Section, frozen=True, kw_only=True):
    """Faults of the camera and the line."""

    file: Annotated[
        File | None,
        typer.Option(
            "--faults",
            help="TOML file of faults of the camera and the line, instead of the scenario's (docs/formats/faults.md).",
        ),
    ] = None


class ClosedLoop(Section, frozen=True, kw_only=True):
    """Flight on the board's poses."""

    on: Annotated[
        bool,
        typer.Option(
            "--closed-loop",
            help="Fly on the poses: each frame shows the state that the thrusters reached (docs/hil_closed_loop.md).",
        ),
    ] = False
    pose: Annotated[
        Literal["board", "truth", "noisy"],
        typer.Option(
            help="With --closed-loop: board; truth or noisy (the estimator's errors) need no board and no images."
        ),
    ] = "board"
    pose_errors: Annotated[
        File | None,
        typer.Option(
            help="With --closed-loop: metrics.json of evaluate with the assumed errors of the board's poses"
            " (default: those of hybrid)."
        ),
    ] = None


_DEADLINE_RULE = "--deadline {value:g} applies to a board's answers: leave out it or --pose"
# Options of the line, the images and the recordings, which a closed loop without a board has not.
_OF_A_BOARD = {
    "line.listen": "--listen",
    "line.key": "--key",
    "line.truth": "--truth",
    "line.pixel_format": "--pixel-format",
    "line.encoding": "--encoding",
    "line.silence_s": "--silence",
    "line.max_misses": "--max-misses",
    "line.allow_none": "--allow-none",
    "pictures.send_sun": "--send-sun",
    "pictures.time_code": "--time-code",
    "pictures.gpu": "--gpu",
    "timing.mode": "--mode",
    "timing.timeout_s": "--timeout",
    "timing.wait_s": "--wait",
    "recording.mcap": "--mcap",
    "recording.live": "--live",
    "recording.ccsds": "--ccsds",
}
_POSE_ERRORS_RULE = (
    "--pose-errors applies to a board's poses in a closed loop: give --closed-loop without --pose"
)


class HostRun(Run, frozen=True, kw_only=True, tag="flyaround.run.hil-host"):
    """Options of ``flyaround hil host``: stream a flight to a board, or fly it on the board's poses."""

    RULES: ClassVar = (
        Only(
            "pictures.n", "pictures.every_s", (None,), "hil host takes -n or --every, not both: leave one out"
        ),
        Only(
            "pictures.n",
            "closed_loop.on",
            (False,),
            "a closed loop ends when the chaser arrives: give --every instead of -n, or neither",
        ),
        Only(
            "pictures.workers",
            "closed_loop.on",
            (False,),
            "a closed loop decides each frame before it is rendered: leave out --workers",
        ),
        Only("closed_loop.pose", "closed_loop.on", (True,), "--pose {value} needs --closed-loop"),
        Only("closed_loop.pose_errors", "closed_loop.on", (True,), _POSE_ERRORS_RULE),
        Only("closed_loop.pose_errors", "closed_loop.pose", ("board",), _POSE_ERRORS_RULE),
        Only("timing.deadline_s", "closed_loop.pose", ("board",), _DEADLINE_RULE),
        Only(
            "timing.latency_s",
            "timing.mode",
            ("realtime",),
            "--latency needs a free-running camera: give --mode realtime, or leave it out",
        ),
        Only(
            "pictures.source",
            "closed_loop.on",
            (False,),
            "a closed loop renders the flown states: leave out --from or --closed-loop",
        ),
        *(
            Only(field, "closed_loop.pose", ("board",), f"{flag} applies to a board: leave out it or --pose")
            for field, flag in _OF_A_BOARD.items()
        ),
    )
    scenario: ScenarioArgument
    seed: FlightSeed = None
    line: Line = Line()
    pictures: SentPictures = SentPictures()
    timing: Timing = Timing()
    recording: Recording = Recording()
    faults: FaultsFile = FaultsFile()
    closed_loop: ClosedLoop = ClosedLoop()
