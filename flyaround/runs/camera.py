"""Options of ``flyaround hil camera``."""

from __future__ import annotations

from typing import Annotated, ClassVar

import typer
from msgspec import Meta

from flyaround.hil.host.camera_endpoint.registers import RATE_HZ
from flyaround.runs.document import NOT_RECORDED, Only, Run
from flyaround.runs.fields import Device, File, FlightSeed, ScenarioArgument

_NEEDS_ANSWERS = "--log and --key concern a board's answers: also give --answers tcp://127.0.0.1:5602"


class CameraRun(Run, frozen=True, kw_only=True, tag="flyaround.run.hil-camera"):
    """Options of ``flyaround hil camera``: a simulated camera on the network."""

    RULES: ClassVar = (
        Only("log", "answers", None, _NEEDS_ANSWERS),
        Only("key", "answers", None, _NEEDS_ANSWERS),
    )
    scenario: ScenarioArgument
    interface: Annotated[str, typer.Option(help="Network interface of the camera, such as eth1 or lo.")]
    allow: Annotated[
        tuple[str, ...],
        typer.Option(help="IPv4 address of an allowed controller; repeatable (default: this machine)."),
    ] = ()
    loop: Annotated[
        Annotated[int, Meta(ge=1, le=1000)] | None,
        typer.Option(help="Render this many frames of the flight first and loop them, for high rates."),
    ] = None
    rate_hz: Annotated[
        Annotated[float, Meta(ge=RATE_HZ[0], le=RATE_HZ[1])],
        typer.Option("--rate", help="Initial frame rate, in frames per second."),
    ] = 30.0
    xml: Annotated[
        File | None,
        typer.Option(help="Serve this GenICam description (.xml or .zip) instead of the camera's own."),
    ] = None
    write: Annotated[
        File | None,
        typer.Option("--write-xml", help="Write the camera's own description to a file, and exit."),
        NOT_RECORDED,
    ] = None
    address: Annotated[
        str | None, typer.Option(help="One of the interface's IPv4 addresses (default: its first).")
    ] = None
    loss: Annotated[
        Annotated[float, Meta(ge=0, le=50)],
        typer.Option(help="Per cent of the stream's packets to drop, to test packet resend."),
    ] = 0.0
    answers: Annotated[
        str | None,
        typer.Option(
            help="Accept the poses of a board that reads the camera, for its --answer: tcp://HOST:PORT."
        ),
    ] = None
    log: Annotated[
        File | None,
        typer.Option(
            help="Folder for the ledger of pictures and answers (with --answers), as with hil host."
        ),
        NOT_RECORDED,
    ] = None
    key: Annotated[File | None, typer.Option(help="File with the key required of a board's --answer.")] = None
    seed: FlightSeed = None
    gpu: Annotated[Device | None, typer.Option(help="EGL device to render on."), NOT_RECORDED] = None
