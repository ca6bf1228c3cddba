"""hil camera: the simulated camera for machine-vision software."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flyaround.commands.scenario_argument import load_flown
from flyaround.commands.terminal import say
from hil.host.camera_endpoint.camera import WARNING, run_camera
from hil.host.camera_endpoint.genicam_xml import OWN_NAME, read_xml, write_xml
from hil.host.camera_endpoint.interface import check_address, find_interface
from hil.host.camera_endpoint.messages import EndpointConfig
from hil.host.camera_endpoint.pictures import DrawnPictures, check_one_channel, image_alone, loop_of
from hil.host.camera_endpoint.registers import RATE_HZ, CameraTerms
from simulator.errors import UserError
from simulator.loop import open_frames
from simulator.scenario.plan import plan_flight

SCHEME = "gige://"


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
        loss_share=loss / 100,
        loss_seed=plan.seed,
    )

    def opened() -> None:
        say(
            f"camera endpoint on {interface}, {there.address}; controllers: {', '.join(allowed)}. {WARNING}\n"
            f"Try: arv-tool-0.8 --address {there.address} control ExposureTime   or: arv-viewer-0.8   Ctrl-C ends it",
            stderr=True,
        )

    def note(sentence: str) -> None:
        say(sentence, stderr=True)

    if loop is not None:
        run_camera(loop_of(plan, device_index=gpu), config, on_opened=opened, on_note=note)
        return
    with open_frames(image_alone, processes=1, device_index=gpu, first=first, restarts=True) as producer:
        run_camera(DrawnPictures(plan, producer), config, on_opened=opened, on_note=note)


def write_xml_file(path: Path, terms: CameraTerms) -> None:
    """Write the camera's description, to start one's own from."""
    try:
        path.write_bytes(write_xml(terms))
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}): name another file") from error
    say(f"{path}: give your copy by --xml; docs/hil_camera.md lists the registers")
