"""Runs on the same images: by the host's own estimator and by an emulated board over each of its lines."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import subprocess
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.host.bundle import write_bundle
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.toml_text import to_toml
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.targets.library import load_target
from tools.boards.emulator import CPU, EmulatedBoard, emulated_board

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tools.boards.debian_image import BoardImage

SCENARIO, TARGET = "tango-flyaround", "tango"
# QEMU carries a few bytes per scheduling turn of its threads: 88 kB/s on an idle machine, 6 kB/s on a busy one
UART_BAUD = 38_400

# an estimate takes about forty times as long as on the host, the first frame longer
BOARD_WATCHDOG_S, ANSWER_S, READY_S = 600.0, 300.0, 1200.0
# the estimator holds the interpreter for seconds, during which the board does not answer
SILENT_S = 120.0

READY = "the board is ready"

# the unit as shipped, recognised by its first lines
RUN = """\
set -eu
useradd --system --no-create-home --shell /usr/sbin/nologin flyaround
mkdir -p /opt/flyaround
cp board.pyz /opt/flyaround/
python3 /opt/flyaround/board.pyz '{url}' --model {target} --watchdog {watchdog:g} --silence {silence:g} \\
  --systemd-unit > /etc/systemd/system/flyaround-board.service
systemctl enable --now flyaround-board || {{ systemctl status --no-pager --lines=50 flyaround-board; exit 1; }}
echo {ready}
exec journalctl --follow --output=cat --unit=flyaround-board
"""


@dataclass(frozen=True)
class BoardLine:
    """Connection between the host and an emulated board.

    Parameters
    ----------
    name : str
        Name on the command line.
    text : str
        Title for reports.
    scenario : str
        Scenario whose images are sent.
    binning : int
        Width and height of a binned pixel: the line carries a binned image in seconds.
    """

    name: str
    text: str
    scenario: str
    binning: int


LINES = {
    line.name: line
    for line in (
        BoardLine("net", "virtio-net, TCP", SCENARIO, 1),
        BoardLine("uart", f"UART (PL011), {UART_BAUD} baud", "tango-close-3m", 6),
    )
}


@contextlib.contextmanager
def served_board(image: BoardImage, line: BoardLine, folder: Path) -> Iterator[tuple[EmulatedBoard, str]]:
    """Run an emulated board whose agent is a service until the block is left; yield it and the URL for the host.

    Raises
    ------
    UserError
        If the board does not start.
    """
    port = free_port()
    url = f"tcp://10.0.2.2:{port}" if line.name == "net" else f"serial:///dev/ttyAMA0?baud={UART_BAUD}"
    bundle = folder / "board.pyz"
    write_bundle(bundle, [load_target(TARGET)])
    script = RUN.format(url=url, target=TARGET, watchdog=BOARD_WATCHDOG_S, silence=SILENT_S, ready=READY)
    with emulated_board(image, {"run": script.encode(), "board.pyz": bundle.read_bytes()}, folder) as board:
        board.wait_for(READY, READY_S)
        listen = (
            f"tcp://127.0.0.1:{port}" if line.name == "net" else f"serial://{board.uart}?baud={UART_BAUD}"
        )
        yield board, listen


def scenario_of(line: BoardLine, folder: Path) -> str:
    """Return the scenario of a line: a built-in one, or a file with binned pixels."""
    if line.binning == 1:
        return line.scenario
    scenario = load_scenario(line.scenario)
    sensor = msgspec.structs.replace(scenario.sensor, binning=line.binning)
    path = folder / "scenario.toml"
    path.write_text(
        to_toml(msgspec.to_builtins(msgspec.structs.replace(scenario, sensor=sensor))), encoding="utf-8"
    )
    return str(path)


def pictures(scenario: str, n: int, folder: Path) -> None:
    """Render a flight's images, identical for every board.

    Raises
    ------
    UserError
        If the images cannot be rendered.
    """
    _flyaround(["capture", scenario, "-n", str(n), "-o", str(folder)], folder.with_suffix(".log"))


def run_host(scenario: str, images: Path, n: int, url: str, log: Path, wait_s: float = READY_S) -> None:
    """Send the images to the board that connects to ``url``, and write the ledger.

    Raises
    ------
    UserError
        If the run fails.
    """
    options = ["--from", str(images), "-n", str(n), "--truth", "off", "--timeout", f"{ANSWER_S:g}"]
    more = [
        "--silence",
        f"{SILENT_S:g}",
        "--wait",
        f"{wait_s:g}",
        "--listen",
        url,
        "--log",
        str(log),
        "--send-sun",
    ]
    _flyaround(["hil", "host", scenario, *options, *more], log.with_suffix(".log"))


def run_here(scenario: str, images: Path, n: int, folder: Path) -> Path:
    """Run the host's own estimator from the same bundle as a process, and return the folder of its ledger.

    Raises
    ------
    UserError
        If the run fails.
    """
    bundle, url, log = folder / "board.pyz", f"tcp://127.0.0.1:{free_port()}", folder / "host"
    write_bundle(bundle, [load_target(TARGET)])
    with (folder / "board.log").open("wb") as out:
        board = subprocess.Popen(
            [sys.executable, "-I", str(bundle), url, "--model", TARGET],
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
            stdout=out,
            stderr=subprocess.STDOUT,
        )
        try:
            run_host(scenario, images, n, url, log)
        finally:
            board.kill()
            board.wait()
    return log


def emulated_processor() -> tuple[str, str]:
    """Return the names of processor and system of the emulated board for the table."""
    version = subprocess.run(
        ["qemu-system-aarch64", "--version"], capture_output=True, text=True, check=True
    ).stdout
    match = re.search(r"version (\S+)", version)
    return f"{CPU}, emulated (QEMU {match[1] if match else '?'})", "Debian 12, arm64"


def _flyaround(arguments: list[str], log: Path) -> None:
    with log.open("wb") as out:
        code = subprocess.run(
            [sys.executable, "-m", "flyaround", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            check=False,
        ).returncode
    if code:
        raise UserError(f"flyaround {' '.join(arguments[:2])} ended with code {code}: see {log}")


def free_port() -> int:
    """Return a free port of the loopback."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])
