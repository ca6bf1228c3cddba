"""Agent as a service: exit codes, notifications to systemd, and the unit file."""

from __future__ import annotations

import contextlib
import os
import shlex
import socket
import threading
from enum import IntEnum
from pathlib import Path
from typing import Callable, List

# notifications within a service manager's watchdog time
BEATS = 3.0

# default time after which an estimator counts as stuck [s]
WATCHDOG_S = 60.0


class ExitCode(IntEnum):
    """Exit code of the agent; docs/hil_board.md has the table."""

    ORDERLY = 0
    HOST_VANISHED = 1
    MISTAKE = 2
    WATCHDOG = 3
    NO_SESSION = 4
    INTERRUPTED = 130
    TERMINATED = 143


class ServiceManager:
    """Service manager that started the agent, by the socket of ``sd_notify(3)``; none if started otherwise."""

    def __init__(self) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "")
        # a name that begins with @ is of Linux's abstract namespace
        self._address = "\0" + address[1:] if address.startswith("@") else address
        for_us = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        with contextlib.suppress(ValueError):
            self._watch_s = int(os.environ.get("WATCHDOG_USEC", "0")) * 1e-6 if for_us else 0.0
        self._stop = threading.Event()

    _watch_s = 0.0

    def tell(self, state: str) -> None:
        """Send a notification such as ``READY=1``; without a manager it is ignored."""
        if not self._address:
            return
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
            line.setblocking(False)  # a manager that does not read must not block the agent
            line.sendto(state.encode(), self._address)

    def beat_while(self, is_well: Callable[[], bool]) -> None:
        """Send ``WATCHDOG=1`` periodically while ``is_well``; nothing without a watchdog."""
        if self._address and self._watch_s > 0:
            threading.Thread(target=self._beat, args=(is_well,), name="heartbeat", daemon=True).start()

    def close(self) -> None:
        """End the heartbeat."""
        self._stop.set()

    def _beat(self, is_well: Callable[[], bool]) -> None:
        while True:
            if is_well():
                self.tell("WATCHDOG=1")
            if self._stop.wait(self._watch_s / BEATS):
                return


def systemd_unit(program: str, arguments: List[str], url: str) -> str:
    """Return a unit that keeps the agent running as a separate user with no other rights.

    Parameters
    ----------
    program : str
        Path of the bundle.
    arguments : list of str
        Command line.
    url : str
        Address of the host, which determines the rights.
    """
    serial = url.startswith("serial")
    device = url[len("serial://") :].split("?", maxsplit=1)[0]
    rights = (
        f"SupplementaryGroups=dialout\nDevicePolicy=closed\nDeviceAllow={device} rw\nPrivateNetwork=yes"
        if serial
        else "PrivateDevices=yes"
    )
    families = "AF_UNIX" if serial else "AF_UNIX AF_INET AF_INET6"
    command = " ".join(
        shlex.quote(word).replace("%", "%%") for word in ["/usr/bin/python3", program, *arguments]
    )
    return UNIT.format(command=command, rights=rights, families=families)


def program_path(argv0: str) -> str:
    """Return the absolute path of a bundle, as a unit needs it."""
    return str(Path(argv0).absolute())


UNIT = """\
# Flyaround's board agent. Once:
#   useradd --system --no-create-home --shell /usr/sbin/nologin flyaround
#   cp flyaround-board.service /etc/systemd/system/ && systemctl enable --now flyaround-board
# The bundle and the model must be readable to that user, a key file its own (chown flyaround, chmod 600).
[Unit]
Description=Flyaround board agent
Wants=network-online.target
After=network-online.target

[Service]
Type=notify
ExecStart={command}
User=flyaround
Restart=on-failure
RestartSec=1
# a mistake in the command line does not mend by itself
RestartPreventExitStatus=2
SuccessExitStatus=143
TimeoutStartSec=15min
TimeoutStopSec=10
# alive, though its estimator may be stuck: --watchdog sees to that first
WatchdogSec=30
# threads on matrices this small cost more than they give
Environment=OPENBLAS_NUM_THREADS=1
UMask=0077

CapabilityBoundingSet=
LockPersonality=yes
NoNewPrivileges=yes
PrivateTmp=yes
ProtectClock=yes
ProtectControlGroups=yes
ProtectHome=yes
ProtectHostname=yes
ProtectKernelLogs=yes
ProtectKernelModules=yes
ProtectKernelTunables=yes
ProtectProc=invisible
ProtectSystem=strict
RestrictAddressFamilies={families}
RestrictNamespaces=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
SystemCallArchitectures=native
SystemCallFilter=@system-service
{rights}

[Install]
WantedBy=multi-user.target
"""
