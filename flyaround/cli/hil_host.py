"""hil host: the camera's side of the link."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
import typer

from flyaround.cli.command_line import command_line
from flyaround.cli.hil_camera import SCHEME, serve_camera
from flyaround.cli.hil_words import listening_text, summary_text
from flyaround.cli.run_options import with_run_options
from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.terminal import progress_bar, say
from flyaround.hil.host.closed_loop_run import (
    fly_without_pictures,
    frame_every,
    summary_without_pictures,
    write_steps,
)
from flyaround.hil.host.flight_run import FlightOptions, FlightRun, interval_s
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.run_terms import Provenance, terms_without_board, write_terms
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, LedgerSummary
from flyaround.hil.host.link_process.host_link import choose_pixel_format
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.measurement_noise import read_pose_noise
from flyaround.hil.host.picture_frames import pictures_in
from flyaround.hil.host.pose_link import PoseLink
from flyaround.hil.host.recording.ros_log import RosLog
from flyaround.hil.host.recording.space_packets import SpacePacketSink
from flyaround.hil.host.run import RunConfig
from flyaround.hil.host.serial_time import serial_advice
from flyaround.hil.host.truth_policy import check_access
from flyaround.hil.link.security import read_key
from flyaround.hil.navigation.closed_loop import ClosedLoopConfig
from flyaround.runs.camera import CameraRun
from flyaround.runs.document import run_fields, write_run
from flyaround.runs.host import CONNECT_S, POSE_S, HostRun, Recording
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder, write_document
from flyaround.simulator.scenario.faults import NO_FAULTS, Faults, read_faults
from flyaround.simulator.scenario.load import scenario_source
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from flyaround.hil.host.recording.recorder import Recorder
    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scenario.scenario import Scenario

# Exit code if no pose was accepted, or the board left.
EXIT_NO_ANSWERS = 3


@with_run_options
def host(
    run: HostRun,
    context: typer.Context,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")] = False,
) -> None:
    """Stream a flight to a board, or fly on its poses (--closed-loop).

    Exit codes: 1, a closed loop did not bring the chaser to its hold point; 2, a mistake, or no board connected; 3, no
    pose was accepted, or the board left for good (not with --allow-none).

    The host listens on tcp://127.0.0.1:5600, or on the address in --listen: another TCP address and port, or a serial
    line such as serial:///dev/ttyUSB0?baud=921600 (115200 baud by default).
    """
    deadline_s = run.timing.deadline_s
    if run.line.listen.startswith(SCHEME):
        _serve_as_camera(run, context)
    elif deadline_s is not None and not 0 < deadline_s < math.inf:
        raise UserError(f"--deadline is {deadline_s:g}: give seconds above 0, or leave it out")
    elif run.closed_loop.pose != "board":
        _fly_without_pictures(run, as_json=as_json)
    else:
        _stream(run, as_json=as_json)


def _stream(run: HostRun, *, as_json: bool) -> None:
    """Send the images of a flight to a board."""
    scenario = load_flyable(run.scenario, "hil host")
    link = _link(run, scenario)
    check_access(link)
    every_s = run.pictures.every_s
    plan = plan_flight(
        scenario,
        n=None if every_s is not None else (run.pictures.n or 30),
        every_s=every_s,
        seed=run.seed,
    )
    _warn_of_a_slow_line(link, plan)
    log = _path(run.recording.log)
    config = RunConfig(
        link=link,
        log_dir=log,
        connect_timeout_s=run.timing.wait_s or run.timing.timeout_s or CONNECT_S,
        deadline_s=run.timing.deadline_s,
        latency_s=run.timing.latency_s,
        send_sun=run.pictures.send_sun,
    )
    flight = FlightRun(plan, config, _flight_options(run, plan))
    if log is not None:
        write_run(empty_folder(log, option="--log"), run)
    recorders = _recorders(run.recording)
    summary = _send(flight, config, recorders, plan.target.name, as_json=as_json)
    _exit_unless_answered(summary, flight.n_frames, link.timeout_s, allow_none=run.line.allow_none)
    _exit_unless_arrived(summary)


def _link(run: HostRun, scenario: Scenario) -> LinkConfig:
    """Return the link's settings."""
    line = run.line
    return LinkConfig(
        url=line.listen,
        mode=run.timing.mode,
        truth=line.truth,
        timeout_s=run.timing.timeout_s or POSE_S,
        compression=line.encoding,
        pixel_format=line.pixel_format,
        silence_s=line.silence_s,
        max_misses=line.max_misses,
        faults=_faults(run, scenario),
        key=None if line.key is None else read_key(line.key),
    )


def _flight_options(run: HostRun, plan: Plan) -> FlightOptions:
    """Return the options of the flight rather than of the link."""
    loop, source = run.closed_loop, _path(run.pictures.source)
    if source is not None:
        pictures_in(source)
    return FlightOptions(
        closed_loop=ClosedLoopConfig(seed=plan.seed, frame_every=frame_every(run.pictures.every_s, plan))
        if loop.on
        else None,
        pose_noise=None if loop.pose_errors is None else read_pose_noise(Path(loop.pose_errors)),
        source=source,
        source_text=scenario_source(run.scenario),
        command=command_line(),
        time_code=run.pictures.time_code,
        workers=run.pictures.workers,
        device_index=run.pictures.gpu,
    )


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def _faults(run: HostRun, scenario: Scenario) -> Faults:
    """Return the faults of the given file, or else the scenario's."""
    return read_faults(Path(run.faults.file)) if run.faults.file is not None else scenario.faults or NO_FAULTS


def _warn_of_a_slow_line(link: LinkConfig, plan: Plan) -> None:
    """Print, before anything is rendered, the transmission time of a frame on a serial line.

    Raises
    ------
    UserError
        If no pixel format holds the images.
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


def _serve_as_camera(run: HostRun, context: typer.Context) -> None:
    """Serve the camera endpoint with its defaults: no board, no poses, no ledger."""
    listen = run.line.listen
    interface = listen.removeprefix(SCHEME).rstrip("/")
    flags = {field.name: field.flag for field in run_fields(HostRun)} | {"as_json": "--json"}
    of_camera = {"scenario", "listen", "seed", "gpu"}
    # include values equal to the default, because users who set them expect an effect
    options = [
        flag
        for name, flag in flags.items()
        if name not in of_camera
        and (source := context.get_parameter_source(name)) is not None
        # the name, because typer brings its own type or takes that of click
        and source.name != "DEFAULT"
    ]
    if options:
        raise UserError(
            f"{listen} serves a camera, but {', '.join(options)} {'concerns' if len(options) == 1 else 'concern'} a"
            f" board's link: leave out, or use flyaround hil camera {run.scenario} --interface {interface}"
        )
    serve_camera(CameraRun(scenario=run.scenario, interface=interface, seed=run.seed, gpu=run.pictures.gpu))


def _fly_without_pictures(run: HostRun, *, as_json: bool) -> None:
    """Fly a closed loop without a board and without images."""
    pose: Literal["truth", "noisy"] = "truth" if run.closed_loop.pose == "truth" else "noisy"
    scenario = load_flyable(run.scenario, "hil host")
    plan = plan_flight(scenario, n=1, seed=run.seed)
    settings = ClosedLoopConfig(seed=plan.seed, frame_every=frame_every(run.pictures.every_s, plan))
    faults = _faults(run, scenario)
    link = PoseLink.without_pictures(faults)
    log = _path(run.recording.log)
    if log is not None:
        empty_folder(log, option="--log")
    result = fly_without_pictures(plan, settings, pose, link)
    summary = summary_without_pictures(result, pose, plan.seed)
    if log is not None:
        write_run(log, run)
        record = Provenance.from_plan(plan, scenario_source(run.scenario), command_line())
        write_terms(log, terms_without_board(record, faults, summary.started_utc))
        write_steps(log, result.steps)
        write_document(log / SUMMARY_JSON, summary)
    _print_summary(summary, log, as_json=as_json)
    _exit_unless_arrived(summary)


def _exit_unless_answered(
    summary: LedgerSummary, n_frames: int, timeout_s: float, *, allow_none: bool
) -> None:
    """Exit with 3 if the board left for good or no pose was accepted, so that scripts notice."""
    if summary.ended != "completed":
        say(
            f"flyaround: the board left after {summary.sent} of {n_frames} frames ({summary.board_gone}) and"
            f" did not come back within {timeout_s:g} s: start it again, and this run with it",
            stderr=True,
        )
    elif not summary.accepted:
        say(
            f"flyaround: no pose was accepted in {summary.sent} frames: see the reasons in the ledger (--log), or"
            " give --allow-none if this is expected",
            stderr=True,
        )
    else:
        return
    if not allow_none:
        raise typer.Exit(EXIT_NO_ANSWERS)


def _exit_unless_arrived(summary: LedgerSummary) -> None:
    """Exit with 1 if a closed loop did not bring the chaser to its hold point."""
    if summary.closed_loop is not None and summary.closed_loop.outcome != "arrived":
        raise typer.Exit(1)


def _send(
    flight: FlightRun, config: RunConfig, recorders: tuple[Recorder, ...], target: str, *, as_json: bool
) -> LedgerSummary:
    """Run the host with a progress bar. Return its summary, which is printed even if the run is interrupted."""
    ends: list[LedgerSummary] = []
    n_done = 0
    with progress_bar("frames to the board", quiet=as_json) as progress:

        def count(_row: FrameRecord) -> None:
            nonlocal n_done
            n_done += 1
            progress(n_done, flight.n_frames)

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


def _recorders(recording: Recording) -> tuple[Recorder, ...]:
    """Open the run's recorders before anything is rendered, so that mistakes are reported early."""
    recorders: list[Recorder] = []
    if recording.mcap is not None or recording.live is not None:
        ros_log = RosLog(
            _path(recording.mcap), None if recording.live is None else ("127.0.0.1", recording.live)
        )
        recorders.append(ros_log)
        if recording.live is not None:
            say(f"live view: ws://127.0.0.1:{ros_log.port} in Foxglove or Lichtblick", stderr=True)
    if recording.ccsds is not None:
        log = _path(recording.log)
        recorders.append(
            SpacePacketSink(recording.ccsds, None if log is None else log / "telemetry.xtce.xml")
        )
    return tuple(recorders)


def _print_summary(summary: LedgerSummary, log: Path | None, *, as_json: bool) -> None:
    if as_json:
        typer.echo(msgspec.json.format(msgspec.json.encode(summary), indent=1).decode())
    else:
        say(summary_text(summary, log))
