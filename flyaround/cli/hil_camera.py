"""hil camera: the simulated camera for machine-vision software."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from flyaround.cli.command_line import command_line
from flyaround.cli.run_options import with_run_options
from flyaround.cli.scenario_argument import load_flyable
from flyaround.cli.terminal import say
from flyaround.hil.host.camera_endpoint.camera_ledger import CameraLedger
from flyaround.hil.host.camera_endpoint.genicam_xml import OWN_NAME, read_xml, write_xml
from flyaround.hil.host.camera_endpoint.interface import check_address, find_interface
from flyaround.hil.host.camera_endpoint.messages import AnswerTerms, EndpointConfig
from flyaround.hil.host.camera_endpoint.pictures import (
    RenderedPictures,
    check_one_channel,
    pixels_only,
    render_loop,
)
from flyaround.hil.host.camera_endpoint.registers import CameraTerms
from flyaround.hil.host.camera_endpoint.simulated_camera import WARNING, run_camera
from flyaround.hil.host.ledger.run_terms import Provenance
from flyaround.hil.host.link_process.host_link import choose_pixel_format
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.truth_policy import check_access
from flyaround.hil.link.packets.messages import HelloAck, Mode
from flyaround.hil.link.security import read_key
from flyaround.runs.camera import CameraRun
from flyaround.runs.document import write_run
from flyaround.simulator.errors import UserError
from flyaround.simulator.loop import open_frames
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.scenario.load import scenario_source
from flyaround.simulator.scenario.plan import plan_flight

if TYPE_CHECKING:
    from flyaround.simulator.scenario.plan import Plan

SCHEME = "gige://"
# Time-out for a pose [s].
ANSWER_S = 30.0


@with_run_options
def camera(run: CameraRun) -> None:
    """Serve a GigE camera on the network (GVCP and GVSP, for Aravis, GStreamer and other clients) until Ctrl-C.

    Each image is rendered when it is due or triggered, with the exposure and gain set by the client. If rendering is
    slower than --rate, images come as fast as possible; --loop sustains any rate. One client controls at a time.

    The protocol has no password, and addresses can be forged. Use it on a private network; it listens on the named
    interface and answers the allowed addresses only. Written from public material; no compliance is claimed.
    """
    serve_camera(run)


def serve_camera(run: CameraRun) -> None:
    """Serve a flight's images until Ctrl-C."""
    plan = plan_flight(load_flyable(run.scenario, "hil camera"), n=run.loop or 1, seed=run.seed)
    check_one_channel(plan)
    terms = _terms(plan, run.rate_hz)
    if run.write is not None:
        write_xml_file(Path(run.write), terms)
        return
    config = _config(plan, terms, run)
    ledger = _ledger(plan, config, run)

    def opened(answers_url: str | None) -> None:
        say(_opened_text(config, plan, run.interface, answers_url), stderr=True)

    def note(sentence: str) -> None:
        say(sentence, stderr=True)

    callbacks: dict[str, Any] = {"ledger": ledger, "on_opened": opened, "on_note": note}
    try:
        if run.loop is not None:
            run_camera(render_loop(plan, device_index=run.gpu), config, **callbacks)
            return
        with open_frames(
            pixels_only, processes=1, device_index=run.gpu, first=plan.scene(0), restarts=True
        ) as producer:
            pictures = RenderedPictures(plan, producer)
            pictures.warm_up()
            run_camera(pictures, config, **callbacks)
    finally:
        if ledger is not None:
            summary = ledger.close()
            say(
                f"{summary.sent} pictures sent: {summary.accepted} accepted, {summary.declined} declined,"
                f" {summary.dropped_total} without an answer"
                + ("" if run.log is None else f"; ledger: {run.log}"),
                stderr=True,
            )


def _terms(plan: Plan, rate_hz: float) -> CameraTerms:
    """Return the camera's initial settings."""
    first = plan.scene(0)
    return CameraTerms(
        width_px=first.camera.width_px,
        height_px=first.camera.height_px,
        bits=first.sensor.bits,
        exposure_us=1e6 * first.exposure_s,
        rate_hz=rate_hz,
        scenario=plan.scenario_name,
        target=plan.target.name,
    )


def _config(plan: Plan, terms: CameraTerms, run: CameraRun) -> EndpointConfig:
    """Return the camera's interface, and the addresses that it answers."""
    interface = find_interface(run.interface, run.address)
    addresses = tuple(check_address(a, "--allow") for a in run.allow)
    name, description = (OWN_NAME, write_xml(terms)) if run.xml is None else read_xml(Path(run.xml))
    key = None if run.key is None else Path(run.key)
    return EndpointConfig(
        interface=interface,
        allowed=addresses or tuple(dict.fromkeys(("127.0.0.1", interface.address))),
        terms=terms,
        xml=description,
        xml_name=name,
        answers=None if run.answers is None else answer_terms(plan, run.answers, key),
        loss_share=run.loss / 100,
        loss_seed=plan.seed,
    )


def _ledger(plan: Plan, config: EndpointConfig, run: CameraRun) -> CameraLedger | None:
    """Return the ledger of a board's answers, or None without ``--answers``."""
    if config.answers is None:
        return None
    log = None if run.log is None else Path(run.log)
    if log is not None:
        write_run(empty_folder(log, option="--log"), run)
    record = Provenance.from_plan(plan, scenario_source(run.scenario), command_line())
    return CameraLedger(log, config.answers.link, record)


def _opened_text(config: EndpointConfig, plan: Plan, interface: str, answers_url: str | None) -> str:
    """Return the camera's address, its allowed controllers, and a command to type."""
    address = config.interface.address
    options = " --camera CAMERA.json" if answers_url is None else f" --answer {answers_url}"
    return (
        f"camera endpoint on {interface}, {address}; controllers: {', '.join(config.allowed)}. {WARNING}\n"
        f"Try: arv-tool-0.8 --address {address} control ExposureTime   or: arv-viewer-0.8   Stop with Ctrl-C\n"
        f"or a board: flyaround hil board gige://{address} --target {plan.target.name}{options}"
    )


def answer_terms(plan: Plan, url: str, key: Path | None) -> AnswerTerms:
    """Return the handshake for a board that sends its poses to ``url``."""
    if not url.startswith("tcp://"):
        raise UserError(f"--answers {url} is not a TCP address: write tcp://127.0.0.1:5602")
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
    """Write the camera's GenICam description, as a template for your own."""
    try:
        path.write_bytes(write_xml(terms))
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}): name another file") from error
    say(f"{path}: use your copy with --xml; docs/hil_camera.md lists the registers")
