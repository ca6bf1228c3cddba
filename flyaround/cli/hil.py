"""hil bundle, key, report and audit: files of the loop, written and read without a board."""

from __future__ import annotations

import json
import os
import secrets
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from flyaround.cli.terminal import say
from flyaround.hil.host.audit import MAX_REPORTED, audit_pictures, pictures_of
from flyaround.hil.host.bundle import write_bundle
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.report import write_report
from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.library import load_target


def bundle(
    path: Annotated[Path, typer.Argument(help="File to write, e.g. board.pyz.")],
    targets: Annotated[
        list[str] | None,
        typer.Option("--target", help="Target whose model is included (default tango); repeatable."),
    ] = None,
) -> None:
    """Write one file that runs on a board with only Python 3.9, numpy and OpenCV 4.6."""
    if path.is_dir():
        raise UserError(f"{path} is a folder: name the file to write, e.g. {path / 'board.pyz'}")
    names = list(dict.fromkeys(targets or ["tango"]))
    size = write_bundle(path, [load_target(name) for name in names])
    say(f"{path}: {size / 1000:.0f} kB. On the board: python3 {path.name} tcp://HOST:5600 --model {names[0]}")


def make_key(
    path: Annotated[Path, typer.Argument(help="File to write; copy it to the board.")],
) -> None:
    """Write a new key for hil host --key and hil board --key."""
    if path.exists():
        raise UserError(
            f"{path} exists already: name another file, because both sides would need the new key"
        )
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise UserError(f"{path} cannot be written ({error.strerror}): name another file") from error
    with os.fdopen(descriptor, "w") as file:
        file.write(secrets.token_hex(32) + "\n")
    say(f"{path}: copy it to the board in a secure way, and give it to both sides with --key")


def report(
    folder: Annotated[Path, typer.Argument(help="Folder written by hil host --log.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the path of the page as JSON.")] = False,
) -> None:
    """Write a page with plots from a ledger: latency, jitter, drops by cause."""
    page = write_report(folder)
    if as_json:
        typer.echo(json.dumps({"report": str(page)}))
    else:
        say(f"report: {page}")


def audit(
    folder: Annotated[Path, typer.Argument(help="Folder written by hil host --time-code --log.")],
    pictures: Annotated[
        Path, typer.Argument(help="Images saved by a board: a folder of PNG files, or an MCAP file.")
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Compare a ledger with the time codes in the images; exit 1 unless they agree in every frame."""
    agreement = audit_pictures(read_ledger(folder), pictures_of(pictures))
    if as_json:
        typer.echo(json.dumps({**asdict(agreement), "passed": agreement.passed}))
    else:
        say(f"{agreement.pictures} pictures: {agreement.agree} agree with the ledger in number and time")
        for what, names in (
            ("without a readable code", agreement.unreadable),
            ("wrong", agreement.wrong),
            ("come twice", agreement.twice),
            ("answered frames without a picture", agreement.missing),
        ):
            if names:
                more = ", ..." if len(names) > MAX_REPORTED else ""
                say(f"{len(names)} {what}: {', '.join(str(name) for name in names[:MAX_REPORTED])}{more}")
    if not agreement.passed:
        raise typer.Exit(1)
