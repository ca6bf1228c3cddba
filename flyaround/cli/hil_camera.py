"""hil camera: the simulated camera for machine-vision software."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from flyaround.cli.command_line import command_line
from flyaround.cli.scenario_argument import load_flown
from flyaround.cli.terminal import say
from flyaround.hil.host.camera_endpoint.camera_ledger import CameraLedger
from flyaround.hil.host.camera_endpoint.genicam_xml import OWN_NAME, read_xml, write_xml
from flyaround.hil.host.camera_endpoint.interface import check_address, find_interface
from flyaround.hil.host.camera_endpoint.messages import AnswerTerms, EndpointConfig
from flyaround.hil.host.camera_endpoint.pictures import DrawnPictures, check_one_channel, image_alone, loop_of
from flyaround.hil.host.camera_endpoint.registers import RATE_HZ, CameraTerms
from flyaround.hil.host.camera_endpoint.simulated_camera import WARNING, run_camera
from flyaround.hil.host.ledger.run_terms import FlownRecord
from flyaround.hil.host.link_process.host_link import choose_pixel_format
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.truth_policy import check_access
from flyaround.hil.link.packets.messages import HelloAck, Mode
from flyaround.hil.link.security import read_key
from flyaround.simulator.errors import UserError
from flyaround.simulator.loop import open_frames
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.scenario.load import scenario_source
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from flyaround.simulator.scenario.plan import Plan

SCHEME = "gige://"
# a picture without an answer after so long has none
ANSWER_S = 30.0


def camera(
    scenario: Annotated[str, typer.Argument(help="Built-in name or TOML file.")],
    interface: Annotated[str, typer.Option(help="Network interface to be found on, such as eth1 or lo.")],
    allow: Annotated[
        list[str] | None,
        typer.Option(
            help="IPv4 address of a controller that is answered; repeat it (default: this machine)."
        ),
    ] = None,
    loop: Annotated[
        int | None,
        typer.Option(
            min=1, max=1000, help="Draw so many frames of the flight first and loop them, for full rates."
        ),
    ] = None,
    rate_hz: Annotated[
        float,
        typer.Option(
            "--rate", min=RATE_HZ[0], max=RATE_HZ[1], help="Frames a second, until a client changes it."
        ),
    ] = 30.0,
    xml: Annotated[
        Path | None,
        typer.Option(help="Serve this GenICam description (.xml or .zip) instead of the camera's own."),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option("--write-xml", help="Write the camera's own description to a file, and end."),
    ] = None,
    address: Annotated[
        str | None, typer.Option(help="One of the interface's IPv4 addresses (default: its first).")
    ] = None,
    loss: Annotated[
        float,
        typer.Option(
            min=0, max=50, help="Per cent of the stream's packets to leave out, to try packet resend."
        ),
    ] = 0.0,
    answers: Annotated[
        str | None,
        typer.Option(
            help="Let a board that reads the camera say its poses here: tcp://HOST:PORT, for its --answer."
        ),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option(help="Folder for the ledger of pictures and answers (with --answers), as of hil host."),
    ] = None,
    key: Annotated[
        Path | None, typer.Option(help="File with the key that a board's --answer has to prove.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed (default: the scenario's).")] = None,
    gpu: Annotated[int | None, typer.Option("--gpu", help="EGL device to draw on.")] = None,
) -> None:
    """Be a camera on the network: GVCP and GVSP for Aravis, GStreamer and other clients, until Ctrl-C.

    Each picture is drawn when it is due or triggered, with the exposure and gain that the client has set; what is
    slower to draw than --rate comes as fast as it can, and --loop keeps any rate. One client controls at a time.

    The protocol has no password and an address can be forged: it is for a network that is yours alone, on the named
    interface, and answers the allowed addresses only. Written from public material; no compliance is claimed.
    """
    plan = plan_flight(load_flown(scenario, "hil camera"), n=loop or 1, seed=seed)
    check_one_channel(plan)
    first = plan.scene(0)
    terms = CameraTerms(
        width_px=first.camera.width_px,
        height_px=first.camera.height_px,
        bits=first.sensor.bits,
        exposure_us=1e6 * first.exposure_s,
        rate_hz=rate_hz,
        scenario=plan.scenario_name,
        target=plan.target.name,
    )
    if write is not None:
        write_xml_file(write, terms)
        return
    if answers is None and (log is not None or key is not None):
        raise UserError(
            "--log and --key are about a board's answers: give --answers tcp://127.0.0.1:5602, too"
        )
    there = find_interface(interface, address)
    allowed = tuple(check_address(a, "--allow") for a in allow) if allow else ()
    allowed = allowed or tuple(dict.fromkeys(("127.0.0.1", there.address)))
    name, description = (OWN_NAME, write_xml(terms)) if xml is None else read_xml(xml)
    config = EndpointConfig(
        interface=there,
        allowed=allowed,
        terms=terms,
        xml=description,
        xml_name=name,
        answers=None if answers is None else answer_terms(plan, answers, key),
        loss_share=loss / 100,
        loss_seed=plan.seed,
    )

    ledger = None
    if config.answers is not None:
        if log is not None:
            empty_folder(log, option="--log")
        flown = FlownRecord.of(plan, scenario_source(scenario), command_line())
        ledger = CameraLedger(log, config.answers.link, flown)

    def opened(answers_url: str | None) -> None:
        told = " --camera CAMERA.json" if answers_url is None else f" --answer {answers_url}"
        say(
            f"camera endpoint on {interface}, {there.address}; controllers: {', '.join(allowed)}. {WARNING}\n"
            f"Try: arv-tool-0.8 --address {there.address} control ExposureTime   or: arv-viewer-0.8   Ctrl-C ends it\n"
            f"or a board: flyaround hil board gige://{there.address} --target {plan.target.name}{told}",
            stderr=True,
        )

    def note(sentence: str) -> None:
        say(sentence, stderr=True)

    told: dict[str, Any] = {"ledger": ledger, "on_opened": opened, "on_note": note}
    try:
        if loop is not None:
            run_camera(loop_of(plan, device_index=gpu), config, **told)
            return
        with open_frames(image_alone, processes=1, device_index=gpu, first=first, restarts=True) as producer:
            drawn = DrawnPictures(plan, producer)
            drawn.warm_up()
            run_camera(drawn, config, **told)
    finally:
        if ledger is not None:
            summary = ledger.close()
            say(
                f"{summary.sent} pictures sent: {summary.accepted} accepted, {summary.declined} declined,"
                f" {summary.dropped_total} without an answer" + ("" if log is None else f"; ledger: {log}"),
                stderr=True,
            )


def answer_terms(plan: Plan, url: str, key: Path | None) -> AnswerTerms:
    """What a board is told that says its poses at ``url``."""
    if not url.startswith("tcp://"):
        raise UserError(f"--answers {url} is no TCP address: write tcp://127.0.0.1:5602")
    link = LinkConfig(
        url=url,
        mode="realtime",
        truth="off",
        timeout_s=ANSWER_S,
        key=None if key is None else read_key(str(key)),
    )
    check_access(link)
    scene = plan.scene(0)
    ack = HelloAck(
        camera=msgspec.to_builtins(scene.camera),
        width_px=scene.camera.width_px,
        height_px=scene.camera.height_px,
        bits=scene.sensor.bits,
        mode=Mode.REALTIME,
        pixel_format=choose_pixel_format(scene.sensor.bits, (), "auto"),
        target_name=plan.target.name,
        target_sha256=plan.target.sha256,
    )
    return AnswerTerms(link, ack)


def write_xml_file(path: Path, terms: CameraTerms) -> None:
    """Write the camera's description, to start one's own from."""
    try:
        path.write_bytes(write_xml(terms))
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}): name another file") from error
    say(f"{path}: give your copy by --xml; docs/hil_camera.md lists the registers")
