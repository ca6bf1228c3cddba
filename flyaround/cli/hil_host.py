"""hil host: the camera's side of the link, and what it says of a run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import msgspec
import typer
from rich.text import Text

from flyaround.cli.command_line import command_line
from flyaround.cli.hil_camera import SCHEME, camera
from flyaround.cli.scenario_argument import load_flown
from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE
from flyaround.hil.host.board_command import board_command, board_url
from flyaround.hil.host.closed_loop_run import (
    fly_without_pictures,
    frame_every,
    summary_without_pictures,
    write_steps,
    write_summary,
)
from flyaround.hil.host.flight_run import FlightOptions, FlightRun, interval_s
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.run_terms import FlownRecord, terms_without_board, write_terms
from flyaround.hil.host.ledger.summary import ClosedLoopFigures, LedgerSummary
from flyaround.hil.host.link_process.host_link import choose_pixel_format
from flyaround.hil.host.link_process.ipc import Compression, LinkConfig, PixelFormatName
from flyaround.hil.host.measurement_noise import read_pose_noise
from flyaround.hil.host.picture_frames import pictures_in
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.host.recording.ros_log import RosLog
from flyaround.hil.host.recording.space_packets import SpacePacketSink
from flyaround.hil.host.run import RunConfig
from flyaround.hil.host.serial_time import serial_advice
from flyaround.hil.host.truth_policy import check_access
from flyaround.hil.link.security import read_key
from flyaround.hil.link.session import SILENCE_S
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults, read_faults
from flyaround.simulator.scenario.load import scenario_source
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from flyaround.hil.host.recording.recorder import Recorder
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scenario.scenario import Scenario

# Seconds for a pose, and for a board to connect, where --timeout does not say.
POSE_S, CONNECT_S = 30.0, 60.0

# Exit code of a run in which no pose was accepted, or that the board left.
NO_ANSWERS = 3


def host(
    context: typer.Context,
    scenario: Annotated[str, typer.Argument(help="Built-in name or TOML file.")],
    listen: Annotated[
        str,
        typer.Option(
            help="tcp://HOST:PORT or serial:///DEVICE?baud=N for a board; gige://IFACE as hil camera."
        ),
    ] = "tcp://127.0.0.1:5600",
    n: Annotated[int | None, typer.Option("-n", min=1, help="Frames, evenly in time (default 30).")] = None,
    every_s: Annotated[
        float | None, typer.Option("--every", help="Seconds between frames, instead of -n.")
    ] = None,
    mode: Annotated[
        str,
        typer.Option(
            help="lockstep: wait for each pose; realtime: paced by simulated time, after up to 15 s of warming up."
        ),
    ] = "lockstep",
    latency_s: Annotated[
        float,
        typer.Option(
            "--latency",
            min=0.0,
            help="realtime: seconds from the end of an exposure until the camera hands its picture over.",
        ),
    ] = 0.0,
    deadline_s: Annotated[
        float | None,
        typer.Option(
            "--deadline",
            min=0.0,
            help="Seconds from the start of sending a frame to its pose, beyond which it counts as missed (realtime:"
            " the time from frame to frame).",
        ),
    ] = None,
    source: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Send the pictures of this folder or data set, in a loop, at the flight's times: nothing is drawn.",
        ),
    ] = None,
    truth: Annotated[
        str,
        typer.Option(help="separate: own endpoint, one port up; inline: with each frame; off: kept home."),
    ] = "separate",
    log: Annotated[
        Path | None, typer.Option(help="Folder for frames.csv and summary.json: new or empty.")
    ] = None,
    pixel_format: Annotated[
        str,
        typer.Option(
            help=f"GenICam name of what is sent: {', '.join(get_args(PixelFormatName))} (auto: all bits)."
        ),
    ] = "auto",
    encoding: Annotated[
        str,
        typer.Option(
            help=f"One of {', '.join(get_args(Compression))} (auto: zstd on a serial line, raw else)."
        ),
    ] = "auto",
    timeout_s: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            min=0.1,
            help=f"Seconds to wait for a pose (default {POSE_S:g}) and for a board (default {CONNECT_S:g}).",
        ),
    ] = None,
    wait_s: Annotated[
        float | None,
        typer.Option("--wait", min=0.1, help="Seconds to wait for the first board, instead of --timeout."),
    ] = None,
    silence_s: Annotated[
        float,
        typer.Option(
            "--silence",
            min=0.5,
            help="Seconds after which a board that says nothing, not even that it still works, counts as gone.",
        ),
    ] = SILENCE_S,
    max_misses: Annotated[
        int,
        typer.Option(
            "--max-misses",
            min=0,
            help="Frames in a row without an answer in time after which the board counts as gone; 0: never.",
        ),
    ] = 3,
    key: Annotated[
        Path | None,
        typer.Option(help="File with a key that boards and loggers must prove to have; hil key writes one."),
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option(
            help="Also write pictures, truth, answers and timing as ROS 2 messages to this .mcap file."
        ),
    ] = None,
    live: Annotated[
        int | None,
        typer.Option(
            min=0, max=65535, help="Serve the same live to Foxglove or Lichtblick on this local port."
        ),
    ] = None,
    ccsds: Annotated[
        str | None,
        typer.Option(
            help="Also write truth and answers as CCSDS space packets to a file or udp://127.0.0.1:PORT."
        ),
    ] = None,
    faults: Annotated[
        Path | None,
        typer.Option(
            help="TOML file of faults of the camera and the line, instead of the scenario's (docs/formats/faults.md)."
        ),
    ] = None,
    send_sun: Annotated[
        bool,
        typer.Option(
            "--send-sun",
            help="Send the direction to the Sun with each frame, as a chaser knows it from its star tracker.",
        ),
    ] = False,
    time_code: Annotated[
        bool,
        typer.Option(
            "--time-code", help="Draw frame number and exposure time into a corner of each picture."
        ),
    ] = False,
    closed_loop: Annotated[
        bool,
        typer.Option(
            "--closed-loop",
            help="Fly on the poses: each frame is drawn of what they made the thrusters do (docs/hil_closed_loop.md).",
        ),
    ] = False,
    pose: Annotated[
        str,
        typer.Option(
            help="With --closed-loop: board; truth or noisy (the estimator's errors) need no board, draw nothing."
        ),
    ] = "board",
    pose_errors: Annotated[
        Path | None,
        typer.Option(
            help="With --closed-loop: metrics.json of evaluate, whose errors the filter takes the board's poses to have"
            " (default: those of hybrid)."
        ),
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed (default: the scenario's).")] = None,
    workers: Annotated[
        int, typer.Option(min=1, max=64, help="Processes that draw in turn: more frames a second.")
    ] = 1,
    gpu: Annotated[int | None, typer.Option("--gpu", help="EGL device to draw on.")] = None,
    allow_none: Annotated[
        bool,
        typer.Option(
            "--allow-none", help="Exit 0, not 3, where no pose was accepted or the board left for good."
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
) -> None:
    """Stream a flight to a board, or fly on its poses (--closed-loop).

    Exit code 3: no pose was accepted, or the board left for good (not with --allow-none). 1: a closed loop did not
    bring the chaser to its hold point. 2: a mistake, or no board came.

    It listens on tcp://127.0.0.1:5600, or where --listen says: another TCP address and port, or a serial line such as
    serial:///dev/ttyUSB0?baud=921600 (its baud rate is 115200 unless given).
    """
    if listen.startswith(SCHEME):
        _be_camera(context, scenario, listen, seed, gpu)
        return
    if mode not in {"lockstep", "realtime"}:
        raise UserError(f"unknown mode '{mode}' in --mode; choose lockstep or realtime")
    if truth not in {"off", "separate", "inline"}:
        raise UserError(f"unknown truth '{truth}' in --truth; choose off, separate or inline")
    if n is not None and every_s is not None:
        raise UserError("hil host takes -n or --every, not both; leave one out")
    if pose not in {"board", "truth", "noisy"}:
        raise UserError(f"unknown pose '{pose}' in --pose; choose board, truth or noisy")
    if closed_loop and n is not None:
        raise UserError("a closed loop ends when the chaser arrives: give --every instead of -n, or neither")
    if closed_loop and workers > 1:
        raise UserError("a closed loop decides each frame before it is drawn: leave --workers out")
    if pose != "board" and not closed_loop:
        raise UserError(f"--pose {pose} needs --closed-loop")
    if pose_errors is not None and (not closed_loop or pose != "board"):
        raise UserError(
            "--pose-errors is of a board's poses in a closed loop: give --closed-loop, and no --pose"
        )
    if deadline_s is not None and (pose != "board" or not 0 < deadline_s < math.inf):
        raise UserError(
            f"--deadline {deadline_s:g} is of a board's answers, in seconds above 0: give such a number and no --pose,"
            " or leave it out"
        )
    if closed_loop and pose != "board":
        _fly_without_pictures(
            scenario,
            "truth" if pose == "truth" else "noisy",
            every_s,
            seed,
            log,
            faults,
            command_line(),
            as_json=as_json,
        )
        return
    if latency_s and mode != "realtime":
        raise UserError(
            "--latency is a camera's that runs by itself: give --mode realtime with it, or leave it out"
        )
    flown = load_flown(scenario, "hil host")
    link = LinkConfig(
        url=listen,
        mode="realtime" if mode == "realtime" else "lockstep",
        truth="off" if truth == "off" else "inline" if truth == "inline" else "separate",
        timeout_s=timeout_s or POSE_S,
        compression=_one_of(encoding, Compression, "--encoding"),
        pixel_format=_one_of(pixel_format, PixelFormatName, "--pixel-format"),
        silence_s=silence_s,
        max_misses=max_misses,
        faults=_faults(flown, faults),
        key=None if key is None else read_key(str(key)),
    )
    check_access(link)
    plan = plan_flight(
        flown,
        n=None if every_s is not None else (n or 30),
        every_s=every_s,
        seed=seed,
    )
    _warn_of_a_slow_line(link, plan)
    told = (
        None if not closed_loop else ClosedLoopConfig(seed=plan.seed, frame_every=frame_every(every_s, plan))
    )
    if source is not None:
        if closed_loop:
            raise UserError("a closed loop draws what was flown: leave --from or --closed-loop out")
        pictures_in(source)
    options = FlightOptions(
        closed_loop=told,
        pose_noise=None if pose_errors is None else read_pose_noise(pose_errors),
        source=source,
        source_text=scenario_source(scenario),
        command=command_line(),
        time_code=time_code,
        workers=workers,
        device_index=gpu,
    )
    config = RunConfig(
        link=link,
        log_dir=log,
        connect_timeout_s=wait_s or timeout_s or CONNECT_S,
        deadline_s=deadline_s,
        latency_s=latency_s,
        send_sun=send_sun,
    )
    flight = FlightRun(plan, config, options)
    if log is not None:
        empty_folder(log, option="--log")
    recorders = _recorders(mcap, live, ccsds, log)
    summary = _stream(flight, config, recorders, plan.target.name, as_json=as_json)
    _exit_unless_answered(summary, flight.n_frames, link.timeout_s, allow_none=allow_none)
    _exit_unless_arrived(summary)


def _faults(flown: Scenario, file: Path | None) -> Faults:
    """Those of the file where one is given, else the scenario's."""
    return read_faults(file) if file is not None else flown.faults or NO_FAULTS


def _one_of(value: str, kind: Any, option: str) -> Any:  # noqa: ANN401 - a Literal and one of its values
    """The value where the type has it; names are taken in any case.

    Raises
    ------
    UserError
        If it has not.
    """
    for known in get_args(kind):
        if known.lower() == value.lower():
            return known
    raise UserError(
        f"unknown {option[2:].replace('-', ' ')} '{value}' in {option}; choose {', '.join(get_args(kind))}"
    )


def _warn_of_a_slow_line(link: LinkConfig, plan: Plan) -> None:
    """Say before anything is drawn how long a frame takes on a serial line.

    Raises
    ------
    UserError
        If no pixel format holds the pictures.
    """
    scene = plan.scene(0)
    pixel_format = choose_pixel_format(
        scene.sensor.bits, () if plan.bands == "mono" else (3,), link.pixel_format
    )
    size_px = scene.camera.width_px, scene.camera.height_px
    every_s = interval_s(plan) if link.mode == "realtime" else None
    advice = serial_advice(link, size_px, scene.sensor.bits, pixel_format, every_s)
    if advice is not None:
        say(f"flyaround: {advice}", stderr=True)


def _be_camera(context: typer.Context, scenario: str, listen: str, seed: int | None, gpu: int | None) -> None:
    """The camera endpoint with its defaults: it has no board, no poses and so no ledger."""
    interface = listen.removeprefix(SCHEME).rstrip("/")
    given = [
        option.opts[0]
        for option in context.command.params
        if option.name not in {"scenario", "listen", "seed", "gpu"}
        and getattr(context.get_parameter_source(option.name or ""), "name", "") == "COMMANDLINE"
    ]
    if given:
        raise UserError(
            f"{listen} serves a camera, and {', '.join(given)} {'is' if len(given) == 1 else 'are'} about a board's"
            f" link: leave out; flyaround hil camera {scenario} --interface {interface} has options of its own"
        )
    camera(scenario, interface, seed=seed, gpu=gpu)


def _fly_without_pictures(
    scenario: str,
    pose: Literal["truth", "noisy"],
    every_s: float | None,
    seed: int | None,
    log: Path | None,
    faults: Path | None,
    command: tuple[str, ...],
    *,
    as_json: bool,
) -> None:
    """A closed loop that needs no board and draws nothing."""
    flown = load_flown(scenario, "hil host")
    plan = plan_flight(flown, n=1, seed=seed)
    told = ClosedLoopConfig(seed=plan.seed, frame_every=frame_every(every_s, plan))
    struck = _faults(flown, faults)
    link = PoseLink.without_pictures(struck)
    if log is not None:
        empty_folder(log, option="--log")
    result = fly_without_pictures(plan, told, pose, link)
    summary = summary_without_pictures(result, pose, plan.seed)
    if log is not None:
        record = FlownRecord.of(plan, scenario_source(scenario), command)
        write_terms(log, terms_without_board(record, struck, summary.started_utc))
        write_steps(log, result.steps)
        write_summary(log, summary)
    _print_summary(summary, log, as_json=as_json)
    _exit_unless_arrived(summary)


def _exit_unless_answered(
    summary: LedgerSummary, n_frames: int, timeout_s: float, *, allow_none: bool
) -> None:
    """Exit 3 if the board left for good or accepted no pose: a script must not take that for a whole run."""
    if summary.ended != "completed":
        say(
            f"flyaround: the board left after {summary.sent} of {n_frames} frames ({summary.board_gone}) and"
            f" did not come back within {timeout_s:g} s: start it again, and this run with it",
            stderr=True,
        )
    elif not summary.accepted:
        say(
            f"flyaround: no pose was accepted in {summary.sent} frames: look at the reasons in the ledger (--log), or"
            " give --allow-none if that is as it should be",
            stderr=True,
        )
    else:
        return
    if not allow_none:
        raise typer.Exit(NO_ANSWERS)


def _exit_unless_arrived(summary: LedgerSummary) -> None:
    """Exit 1 where a closed loop did not bring the chaser to its hold point."""
    if summary.closed_loop is not None and summary.closed_loop.outcome != "arrived":
        raise typer.Exit(1)


def _stream(
    flight: FlightRun, config: RunConfig, recorders: tuple[Recorder, ...], target: str, *, as_json: bool
) -> LedgerSummary:
    """Run the host with a progress bar; its summary, printed also where the run is interrupted."""
    ends: list[LedgerSummary] = []
    done = 0
    with progress_bar("frames to the board", quiet=as_json) as progress:

        def count(_row: FrameRecord) -> None:
            nonlocal done
            done += 1
            progress(done, flight.n_frames)

        def end(summary: LedgerSummary) -> None:
            if summary.ended in {"completed", "board_lost", "interrupted"}:
                ends.append(summary)

        def listening(url: str, truth_url: str | None) -> None:
            keyed = config.link.key is not None
            say(listening_text(url, truth_url, target, keyed=keyed), stderr=True)

        try:
            flight.run(recorders=recorders, on_row=count, on_listening=listening, on_end=end)
        finally:
            for summary in ends:
                _print_summary(summary, config.log_dir, as_json=as_json)
    return ends[0]


def _recorders(
    mcap: Path | None, live: int | None, ccsds: str | None, log: Path | None
) -> tuple[Recorder, ...]:
    """What else listens to the run, opened now so that a mistake is told before anything is drawn."""
    recorders: list[Recorder] = []
    if mcap is not None or live is not None:
        ros_log = RosLog(mcap, None if live is None else ("127.0.0.1", live))
        recorders.append(ros_log)
        if live is not None:
            say(f"live view: ws://127.0.0.1:{ros_log.port} in Foxglove or Lichtblick", stderr=True)
    if ccsds is not None:
        recorders.append(SpacePacketSink(ccsds, None if log is None else log / "telemetry.xtce.xml"))
    return tuple(recorders)


def _print_summary(summary: LedgerSummary, log: Path | None, *, as_json: bool) -> None:
    if as_json:
        typer.echo(msgspec.json.format(msgspec.json.encode(summary), indent=1).decode())
    else:
        say(summary_text(summary, log))


def listening_text(url: str, truth_url: str | None, target: str, *, keyed: bool = False) -> str:
    """Where a host listens, and what to type on the board."""
    there, key = board_url(url), " --key FILE" if keyed else ""
    lines = [
        f"listening on {url}; on the board type",
        f"  {board_command(url, target, keyed=keyed)}",
        f"or, with the file that flyaround hil bundle board.pyz --target {target} writes,",
        f"  python3 board.pyz {there} --model {target}{key}",
    ]
    if url.startswith("serial"):
        lines.append("with the board's own name of the line in place of this machine's")
    if truth_url is not None:
        lines.append(f"ground truth, for loggers alone: {truth_url}")
    return "\n".join(lines)


def _closed_loop_text(c: ClosedLoopFigures) -> Text:
    """Outcome, and why; red where the chaser did not arrive."""
    reason = f": {c.reason}" if c.reason else ""
    figures = (
        f" after {c.duration_s:.0f} s, {c.final_error_m:.3f} m and {c.final_error_deg:.2f} deg off the hold point;"
        f" nearest {c.min_range_m:.2f} m, {c.keep_out_violations} periods inside the keep-out sphere,"
        f" {c.delta_v_m_s:.3f} m/s spent"
    )
    return Text.assemble((c.outcome + reason, "" if c.outcome == "arrived" else "red"), figures)


def summary_text(s: LedgerSummary, log: Path | None) -> Text:
    """The summary in a few lines; red is what should not be."""
    causes = ", ".join(f"{n} {cause}" for cause, n in s.dropped.items())
    dropped = f"{s.dropped_total} dropped" + (f" ({causes})" if causes else "")
    lines: list[str | Text] = []
    if s.closed_loop is not None:
        lines.append(_closed_loop_text(s.closed_loop))
    if s.sent or s.closed_loop is None:
        lines.append(f"{s.sent} frames sent: {s.accepted} accepted, {s.declined} declined, {dropped}")
    if s.accepted_known:
        wrong = f"{s.accepted_wrong} of {s.accepted_known} accepted poses are wrong"
        limits = f" (beyond {COARSE_DEG:g} deg or {COARSE_SHARE:.0%} of the range)"
        lines.append(Text.assemble((wrong, "red" if s.accepted_wrong else ""), limits))
    if s.median_E_T_m is not None and s.median_E_R_deg is not None:
        lines.append(f"median error of accepted poses: {s.median_E_T_m:.3g} m, {s.median_E_R_deg:.3g} deg")
    if s.e2e_ms_p50 is not None:
        lines.append(
            f"latency: p50 {s.e2e_ms_p50:.1f} ms, p99 {s.e2e_ms_p99:.1f} ms, largest {s.e2e_ms_max:.1f} ms;"
            f" on the board p50 {s.board_total_ms_p50:.1f} ms"
        )
    if s.deadline_misses is not None:
        lines.append(f"not answered within the deadline of {s.deadline_ms:.0f} ms: {s.deadline_misses}")
    if s.handover_error_ms_p99 is not None:
        late = f"; {s.late} frame(s) were not drawn in time" if s.late else ""
        lines.append(
            f"handed over {s.latency_ms:g} ms after exposure, off by p99 {s.handover_error_ms_p99:.3g} ms, at most"
            f" {s.handover_error_ms_max:.3g} ms{late}"
        )
    if log is not None:
        lines.append(f"ledger: {log}; a page with plots: flyaround hil report {log}")
    return Text("\n").join(Text(line) if isinstance(line, str) else line for line in lines)
