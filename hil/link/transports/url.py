"""Lines by their URL: which transport it names, connecting as the board, listening as the host."""

from __future__ import annotations

from typing import TYPE_CHECKING, Tuple
from urllib.parse import parse_qs, urlsplit

from hil.link.errors import LinkError
from hil.link.transports.serial_port import SerialListener, SerialTransport
from hil.link.transports.tcp import TcpListener, connect_tcp

if TYPE_CHECKING:
    from hil.link.transports.base import Listener, Transport


def parse_url(url: str) -> Tuple[str, str, int]:
    """Scheme, host or device, and port or baud rate of a link URL.

    ``tcp://127.0.0.1:5600`` or ``serial:///dev/ttyUSB0?baud=921600``.

    Raises
    ------
    LinkError
        If the URL is neither.
    """
    parts = urlsplit(url)
    try:
        if parts.scheme == "tcp":
            if parts.hostname is None or parts.port is None:
                raise LinkError(f"link URL {url!r} lacks host or port: write tcp://127.0.0.1:5600")
            return "tcp", parts.hostname, parts.port
        if parts.scheme == "serial":
            baud = int(parse_qs(parts.query).get("baud", ["115200"])[0])
            if not parts.path or baud <= 0:
                raise LinkError(
                    f"link URL {url!r} lacks a device or baud rate: write serial:///dev/ttyUSB0?baud=921600"
                )
            return "serial", parts.path, baud
    except ValueError as error:
        raise LinkError(
            f"link URL {url!r} has a bad number ({error}): write tcp://127.0.0.1:5600"
            " or serial:///dev/ttyUSB0?baud=921600"
        ) from error
    raise LinkError(
        f"link URL {url!r} has an unknown scheme: write tcp://HOST:PORT or serial:///dev/ttyUSB0?baud=921600"
    )


def connect(url: str, timeout_s: float = 10.0) -> Transport:
    """A line to a listening host, tried until ``timeout_s`` has passed.

    Raises
    ------
    LinkError
        If the URL is bad or nobody listens there.
    """
    scheme, where, number = parse_url(url)
    if scheme == "tcp":
        return connect_tcp(where, number, timeout_s)
    return SerialTransport(where, number)


def listen(url: str) -> Listener:
    """Listen on a URL; port 0 takes a free one, named by ``Listener.url``.

    Raises
    ------
    LinkError
        If the URL is bad or the port or device is not to be had.
    """
    scheme, where, number = parse_url(url)
    if scheme == "tcp":
        return TcpListener(where, number)
    return SerialListener(where, number)
