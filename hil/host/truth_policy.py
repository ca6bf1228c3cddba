"""Access policy of the link: local programs, or remote ones with the key; and the address of the truth."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import replace
from typing import TYPE_CHECKING

from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.transports.url import parse_url
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.faults import ClockDrift

if TYPE_CHECKING:
    from flyaround.hil.host.link_process.ipc import LinkConfig


def default_truth_url(url: str) -> str:
    """Return the same host with the next port (port 0 stays 0); the loopback for serial lines.

    Raises
    ------
    UserError
        If the URL is invalid.
    """
    scheme, host, port = _parsed(url)
    if scheme == "serial":
        return "tcp://127.0.0.1:5601"
    host = f"[{host}]" if ":" in host else host
    return f"tcp://{host}:{port + 1 if port else 0}"


def with_truth_endpoint(link: LinkConfig) -> LinkConfig:
    """Return the link with a truth endpoint if the truth is sent separately, otherwise without.

    Raises
    ------
    UserError
        If a URL is invalid.
    """
    if link.truth != "separate":
        return replace(link, truth_url=None)
    return replace(link, truth_url=link.truth_url or default_truth_url(link.url))


def check_access(link: LinkConfig) -> None:
    """Raise UserError for an address reachable from other machines, unless a key is required.

    Raises
    ------
    UserError
        If an address is not the loopback and there is no key.
    """
    for url in (link.url, link.truth_url):
        if url is not None and link.key is None and (flaw := access_flaw(url)):
            raise UserError(flaw)
    if link.key is not None and any(isinstance(fault, ClockDrift) for fault in link.faults.line):
        raise UserError("a fault clock_drift changes signed packets: leave out the fault or the key")


def access_flaw(url: str) -> str:
    """Return why a host without a key may not listen on ``url``; empty if it may.

    Returns
    -------
    str
        That the URL is invalid, or reachable from other machines, and what to do.
    """
    try:
        if is_private(url):
            return ""
    except UserError as error:
        return str(error)
    return (
        f"{url} can be reached from other machines without authentication: give both sides a key"
        " (flyaround hil key FILE, then --key FILE), or listen on tcp://127.0.0.1:PORT"
    )


def is_private(url: str) -> bool:
    """Return True if only local programs, or the other end of a serial line, can connect to ``url``.

    Raises
    ------
    UserError
        If the URL is invalid.
    """
    scheme, host, port = _parsed(url)
    if scheme == "serial":
        return True
    return is_loopback(host, port)


def is_loopback(host: str, port: int) -> bool:
    """Return True if a host name resolves to this machine only; False if it cannot be resolved."""
    try:
        resolved = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except OSError:
        return False  # listen() reports the error
    addresses = {str(address[0]).partition("%")[0] for *_, address in resolved}
    return bool(addresses) and all(ipaddress.ip_address(a).is_loopback for a in addresses)


def _parsed(url: str) -> tuple[str, str, int]:
    try:
        return parse_url(url)
    except LinkError as error:
        raise UserError(str(error)) from error
