"""Service integration: exit codes, systemd notifications, and the unit file."""

from __future__ import annotations

import contextlib
import os
import shlex
import socket
import threading
from enum import IntEnum
from pathlib import Path
from typing import Callable, List

# Heartbeats per watchdog period of the service manager.
HEARTBEATS_PER_PERIOD = 3.0
# Default watchdog time of the estimator [s].
WATCHDOG_S = 60.0


class ExitCode(IntEnum):
    """Exit codes of the agent; documented in docs/hil_board.md."""

    ORDERLY = 0
    HOST_VANISHED = 1
    MISTAKE = 2
    WATCHDOG = 3
    NO_SESSION = 4
    INTERRUPTED = 130
    TERMINATED = 143


class ServiceManager:
    """Service manager that started the agent, reached by ``sd_notify(3)``; all calls are no-ops without one."""

    def __init__(self) -> None:
        address = os.environ.get("NOTIFY_SOCKET", "")
        # a leading @ denotes Linux's abstract namespace
        self._address = "\0" + address[1:] if address.startswith("@") else address
        for_us = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        with contextlib.suppress(ValueError):
            self._watch_s = int(os.environ.get("WATCHDOG_USEC", "0")) * 1e-6 if for_us else 0.0
        self._stop = threading.Event()

    _watch_s = 0.0

    def notify(self, state: str) -> None:
        """Send a notification such as ``READY=1``."""
        if not self._address:
            return
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
            line.setblocking(False)  # a manager that does not read must not block the agent
            line.sendto(state.encode(), self._address)

    def start_heartbeat(self, is_responsive: Callable[[], bool]) -> None:
        """Send ``WATCHDOG=1`` periodically while ``is_responsive`` returns True, if the manager has a watchdog."""
        if self._address and self._watch_s > 0:
            threading.Thread(target=self._beat, args=(is_responsive,), name="heartbeat", daemon=True).start()

    def close(self) -> None:
        """Stop the heartbeat."""
        self._stop.set()

    def _beat(self, is_responsive: Callable[[], bool]) -> None:
        while True:
            if is_responsive():
                self.notify("WATCHDOG=1")
            if self._stop.wait(self._watch_s / HEARTBEATS_PER_PERIOD):
                return


def systemd_unit(program: str, arguments: List[str], url: str) -> str:
    """Return a systemd unit that runs the agent as an unprivileged user.

    Parameters
    ----------
    program : str
        Absolute path of the bundle.
    arguments : list of str
        Command-line arguments.
    url : str
        URL of the host, which determines the required permissions.
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
    """Return the absolute path of the bundle, as a systemd unit requires."""
    return str(Path(argv0).absolute())


UNIT = """\
# Flyaround's board agent. Installation:
#   useradd --system --no-create-home --shell /usr/sbin/nologin flyaround
#   cp flyaround-board.service /etc/systemd/system/ && systemctl enable --now flyaround-board
# That user must be able to read the bundle and the model, and must own a key file (chown flyaround, chmod 600).
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
# a restart does not mend an invalid command line
RestartPreventExitStatus=2
SuccessExitStatus=143
TimeoutStartSec=15min
TimeoutStopSec=10
# heartbeat of the agent; a hung estimator is handled by --watchdog before
WatchdogSec=30
# multi-threading slows these small matrices down
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
