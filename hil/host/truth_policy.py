"""Where ground truth may go: to an endpoint of its own, with each frame, or nowhere, and not over a network."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import replace
from typing import TYPE_CHECKING

from hil.link.errors import LinkError
from hil.link.transports.url import parse_url
from simulator.errors import UserError

if TYPE_CHECKING:
    from hil.host.link_process.ipc import LinkConfig


def default_truth_url(url: str) -> str:
    """Same host, next port (port 0 stays 0); the loopback for serial lines.

    Raises
    ------
    UserError
        If the URL is bad.
    """
    scheme, host, port = _parsed(url)
    if scheme != "tcp":
        return "tcp://127.0.0.1:5601"
    host = f"[{host}]" if ":" in host else host
    return f"tcp://{host}:{port + 1 if port else 0}"


def with_truth_endpoint(link: LinkConfig) -> LinkConfig:
    """The link with a truth endpoint when truth travels separately, and with none otherwise.

    Raises
    ------
    UserError
        If a URL is bad.
    """
    if link.truth != "separate":
        return replace(link, truth_url=None)
    return replace(link, truth_url=link.truth_url or default_truth_url(link.url))


def truth_kept_home(link: LinkConfig) -> tuple[LinkConfig, str]:
    """The link with its truth off where others on a network could ask for it, and the sentence that says so.

    Whoever connects is answered, so truth, inline or on its own port, is for this machine's loopback and for serial
    lines alone.

    Raises
    ------
    UserError
        If a URL is bad.
    """
    if link.truth == "off":
        return link, ""
    for url in (link.url, with_truth_endpoint(link).truth_url):
        if url is not None and not is_private(url):
            return replace(link, truth="off", truth_url=None), (
                f"{url} can be reached from other machines and whoever connects is answered, so ground truth stays"
                " here (--truth off): listen on tcp://127.0.0.1:PORT to have it sent"
            )
    return link, ""


def is_private(url: str) -> bool:
    """Whether only this machine's programs, or the other end of a serial line, can connect to ``url``.

    Raises
    ------
    UserError
        If the URL is bad.
    """
    scheme, host, port = _parsed(url)
    if scheme != "tcp":
        return True
    return is_loopback(host, port)


def is_loopback(host: str, port: int) -> bool:
    """Whether a host's name means this machine alone; false where it means nothing."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except OSError:
        return False  # listening there will say what is wrong with it
    addresses = {str(address[0]).partition("%")[0] for *_, address in found}
    return bool(addresses) and all(ipaddress.ip_address(a).is_loopback for a in addresses)


def _parsed(url: str) -> tuple[str, str, int]:
    try:
        return parse_url(url)
    except LinkError as error:
        raise UserError(str(error)) from error
