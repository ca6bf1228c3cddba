"""Command line that connects a board to a host."""

from __future__ import annotations

import socket

from flyaround.hil.link.transports.url import parse_url
from flyaround.simulator.runtime.urls import without_secrets

ANY_ADDRESS = ("0.0.0.0", "::")  # noqa: S104 - listening on all addresses is the user's choice


def board_url(url: str) -> str:
    """Return the URL that a board uses to reach a host listening on ``url``.

    Returns
    -------
    str
        URL without secrets; with this machine's name if the host listens on all addresses.
    """
    scheme, host, port = parse_url(url)
    if scheme != "serial" and host in ANY_ADDRESS:
        return f"{scheme}://{socket.gethostname()}:{port}"
    return without_secrets(url)


def board_command(url: str, target: str, *, keyed: bool) -> str:
    """Return the command that starts a board for a host that listens on ``url``.

    Returns
    -------
    str
        Command line; without ``--target`` if ``target`` is empty.
    """
    command = f"flyaround hil board {board_url(url)}"
    return command + (f" --target {target}" if target else "") + (" --key FILE" if keyed else "")
