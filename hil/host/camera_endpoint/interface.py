"""Network interface of a camera endpoint, and the addresses that may control it."""

from __future__ import annotations

import fcntl
import ipaddress
import socket
import struct
from dataclasses import dataclass

from flyaround.simulator.errors import UserError

# From Linux's <linux/sockios.h> and <linux/in.h>; Python's socket module does not define them
_ADDRESS, _BROADCAST, _MASK, _MTU, _MAC = 0x8915, 0x8919, 0x891B, 0x8921, 0x8927
MTU_DISCOVER, MTU_DO, MTU_DONT = 10, 2, 0


@dataclass(frozen=True, kw_only=True)
class Interface:
    """Network interface with its name and properties."""

    name: str
    address: str
    broadcast: str
    mask: str
    mtu: int
    mac: bytes


def find_interface(name: str, address: str | None = None) -> Interface:
    """Return a network interface of this machine.

    Parameters
    ----------
    name : str
        Name of the interface, such as ``eth1``.
    address : str, optional
        One of its addresses other than the first (on ``lo``, any that begins with 127).

    Returns
    -------
    Interface
        Name, address, mask and MTU of the interface.

    Raises
    ------
    UserError
        If there is no interface of that name, or it has no IPv4 address.
    """
    names = [interface_name for _, interface_name in socket.if_nameindex()]
    if name not in names:
        raise UserError(f"there is no network interface '{name}': this machine has {', '.join(names)}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:

        def ask(request: int) -> bytes:
            return fcntl.ioctl(probe.fileno(), request, struct.pack("256s", name.encode()))[16:24]

        try:
            first = socket.inet_ntoa(ask(_ADDRESS)[4:8])
        except OSError as error:
            raise UserError(
                f"network interface {name} has no IPv4 address; give it one, or choose another"
            ) from error
        mtu = struct.unpack_from("i", ask(_MTU))[0]
        return Interface(
            name=name,
            address=first if address is None else check_address(address, "--address"),
            broadcast=socket.inet_ntoa(ask(_BROADCAST)[4:8]),
            mask=socket.inet_ntoa(ask(_MASK)[4:8]),
            mtu=min(int(mtu), 0xFFFF),
            mac=ask(_MAC)[2:8],
        )


def check_address(text: str, option: str) -> str:
    """Return an IPv4 address in its canonical form.

    Returns
    -------
    str
        Four decimal numbers with dots.

    Raises
    ------
    UserError
        If the text is not an IPv4 address.
    """
    try:
        return str(ipaddress.IPv4Address(text))
    except ValueError:
        raise UserError(f"{option} {text} is not an IPv4 address: write one such as 192.168.1.10") from None


def open_socket(interface: Interface, address: str, port: int) -> socket.socket:
    """Return a UDP socket that receives and sends through one interface only.

    Raises
    ------
    UserError
        If the port is in use, or the address does not belong to the interface.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        # other endpoints on other addresses of the interface receive the same broadcasts
        if address in {"255.255.255.255", interface.broadcast}:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.name.encode() + b"\0")
        opened.bind((address, port))
    except OSError as error:
        opened.close()
        raise UserError(
            f"UDP port {port} of {address} on {interface.name} cannot be opened ({error.strerror}):"
            " is another camera endpoint running there?"
        ) from error
    return opened
