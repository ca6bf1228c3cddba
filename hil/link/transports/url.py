"""Link URLs: parsing, and opening the line that a URL names, as the board (`connect`) or as the host (`listen`)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Dict, Tuple
from urllib.parse import parse_qs, urlsplit

from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.transports.serial_port import SerialListener, SerialTransport
from flyaround.hil.link.transports.tcp import TcpListener, connect_tcp

if TYPE_CHECKING:
    from flyaround.hil.link.transports.base import Listener, Transport


SERIAL_SHAPE = "serial:///dev/ttyUSB0?baud=921600"
SHAPES = f"tcp://127.0.0.1:5600 or {SERIAL_SHAPE}"
OPTIONS = {"tcp": (), "serial": ("baud", "rtscts")}
DEFAULT_BAUD = 115200  # the usual setting of a board's console
MAX_BAUD = 2**31 - 1  # what the driver's field holds


def parse_url(url: str) -> Tuple[str, str, int]:
    """Parse a link URL.

    Valid forms are ``tcp://127.0.0.1:5600`` and ``serial:///dev/ttyUSB0?baud=921600&rtscts=1``.

    Returns
    -------
    scheme : str
        ``tcp`` or ``serial``.
    address : str
        Host, or path of the device.
    number : int
        Port, or baud rate; 115200 unless given.

    Raises
    ------
    LinkError
        If the URL has another form.
    """
    try:
        parts = urlsplit(url)
        options = _options(url, parts.scheme, parts.query)
        if parts.scheme in OPTIONS and parts.fragment:
            raise LinkError(f"link URL {url!r} has a fragment, #{parts.fragment}: write {SHAPES}")
        if parts.scheme == "tcp":
            if parts.hostname is None or parts.port is None:
                raise LinkError(f"link URL {url!r} lacks host or port: write tcp://127.0.0.1:5600")
            if parts.path.strip("/") or "@" in parts.netloc:
                raise LinkError(f"link URL {url!r} has more than host and port: write tcp://127.0.0.1:5600")
            return "tcp", parts.hostname, parts.port
        if parts.scheme == "serial":
            if parts.netloc:
                raise LinkError(
                    f"link URL {url!r} has a host, {parts.netloc!r}: a device has three slashes, as in {SERIAL_SHAPE}"
                )
            baud = options.get("baud", DEFAULT_BAUD)
            if not parts.path.strip("/") or not 0 < baud <= MAX_BAUD:
                raise LinkError(f"link URL {url!r} lacks a device or baud rate: write {SERIAL_SHAPE}")
            return "serial", parts.path, baud
    except ValueError as error:
        raise LinkError(f"link URL {url!r} has a bad number or address ({error}): write {SHAPES}") from error
    if parts.scheme == "udp":
        raise LinkError(f"link URL {url!r} names UDP, which boards no longer use: write tcp://{parts.netloc}")
    raise LinkError(f"link URL {url!r} has an unknown scheme: write tcp://HOST:PORT or {SERIAL_SHAPE}")


def url_options(url: str) -> Dict[str, int]:
    """Return the numeric options after the question mark of a valid link URL."""
    parts = urlsplit(url)
    return _options(url, parts.scheme, parts.query)


def _options(url: str, scheme: str, query: str) -> Dict[str, int]:
    allowed = OPTIONS.get(scheme, ())
    options = parse_qs(query, keep_blank_values=True)
    for name, values in options.items():
        if scheme in OPTIONS and name not in allowed:
            raise LinkError(
                f"link URL {url!r} has an unknown option {name!r}: {scheme} knows {', '.join(allowed) or 'none'}"
            )
        if len(values) > 1:
            raise LinkError(
                f"link URL {url!r} has the option {name!r} {len(values)} times: delete all but one"
            )
        if name == "rtscts" and values[0] not in ("0", "1"):
            raise LinkError(f"link URL {url!r} has rtscts={values[0]}, allowed: 0 or 1")
    return {name: int(values[-1]) for name, values in options.items() if name in allowed}


def connect(url: str, timeout_s: float = 10.0) -> Transport:
    """Connect to a listening host, retrying until ``timeout_s`` has passed.

    Returns
    -------
    Transport
        Open line. A serial port is opened at once, without waiting for the other side.

    Raises
    ------
    LinkError
        If the URL is invalid or nobody listens there.
    """
    scheme, address, number = parse_url(url)
    if scheme == "tcp":
        return connect_tcp(address, number, timeout_s)
    return SerialTransport(address, number, rtscts=bool(url_options(url).get("rtscts")))


def listen(url: str) -> Listener:
    """Listen on a URL.

    Returns
    -------
    Listener
        Listener, whose ``url`` has the port that was chosen if ``url`` gives port 0.

    Raises
    ------
    LinkError
        If the URL is invalid, or the port or device is not available.
    """
    scheme, address, number = parse_url(url)
    if scheme == "tcp":
        return TcpListener(address, number)
    return SerialListener(address, number, rtscts=bool(url_options(url).get("rtscts")))
