"""Hosts and boards as processes of their own: to be killed, cut off, and weighed."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import contextmanager, suppress
from pathlib import Path

from flyaround.hil.host.ledger.frames_csv import read_ledger

ROOT = Path(__file__).parents[2]
HARNESS = Path(__file__).parent
PATIENCE_S = 60.0

# A host whose pictures are drawn before; what it is told comes as JSON. Its URL is the first line that it says.
HOST = f"""
import json, resource, sys, time
from pathlib import Path
sys.path.insert(0, {str(ROOT / "tests" / "harness")!r})
import numpy as np
from hil_loop import made_frame
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.hil.link.security import read_key
from flyaround.simulator.errors import UserError
told = json.loads(sys.argv[1])
drawn = [np.random.default_rng(k).integers(0, 255, (told["size"],) * 2, np.uint8) for k in range(30)]
def source():
    for k in range(told["n"]):
        if told["mode"] == "lockstep":
            time.sleep(told["every_s"])
        yield made_frame(k, drawn[k % len(drawn)], every_s=told["every_s"], t_m=(0.0, 0.0, float(k)))
def on_row(row):
    if row.frame_id == told["most_rows"]:
        size = (Path(told["log"]) / "frames.csv").stat().st_size + 20
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))
link = LinkConfig(url=told["url"], mode=told["mode"], truth=told["truth"], timeout_s=told["timeout_s"],
                  max_misses=told["max_misses"], silence_s=told["silence_s"], key=told["key"] and read_key(told["key"]))
config = RunConfig(link=link, log_dir=Path(told["log"]), connect_timeout_s=60.0)
try:
    summary = run_host(source(), config, on_row=on_row, on_listening=lambda url, _: print(url, flush=True))
except UserError as error:
    print(error, file=sys.stderr)
    sys.exit(2)
sys.exit(0 if summary.ended == "completed" else 1)
"""

# A board that answers at once, once for each frame of each host until it is stopped.
ECHO = f"""
import sys
sys.path.insert(0, {str(ROOT / "tests" / "harness")!r})
from estimators import Instant
from flyaround.hil.board import agent
agent.estimator_factory = lambda model, method: (Instant, "", "")
from flyaround.hil.board.__main__ import run_and_exit
run_and_exit("flyaround.hil.board")
"""


def free_url(host: str = "127.0.0.1") -> str:
    """An address that nobody listens on."""
    with socket.create_server((host, 0)) as free:
        return f"tcp://{host}:{free.getsockname()[1]}"


@contextmanager
def host_process(log: Path, prefix: tuple[str, ...] = (), **told):
    """A running host and its URL."""
    defaults = {"url": "tcp://127.0.0.1:0", "n": 10_000, "size": 64, "every_s": 0.02, "mode": "lockstep"}
    defaults |= {"timeout_s": 20.0, "max_misses": 3, "silence_s": 1.5, "log": str(log), "key": None}
    defaults |= {"truth": "off", "most_rows": -1}
    with started([*prefix, sys.executable, "-c", HOST, json.dumps(defaults | told)]) as process:
        yield process, process.stdout.readline().strip()


@contextmanager
def echo_board(url: str, *more: str, prefix: tuple[str, ...] = ()):
    """A running board."""
    with started([*prefix, sys.executable, "-c", ECHO, url, "--model", "none", *more]) as process:
        yield process


@contextmanager
def started(command):
    """A process that does not outlive the test."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=ROOT)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def children_of(pid: int) -> list[int]:
    """Process ids."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError, ValueError):
            if int(stat.read_text().rsplit(")", 1)[1].split()[1]) == pid:
                found.append(int(stat.parent.name))
    return found


def kill_all(pids) -> None:
    """As a loss of power does it: at once, nobody can say a last word."""
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    for pid in pids:
        os.kill(pid, signal.SIGKILL)


def resident_kib(pid: int) -> int:
    """Memory that a process holds, less what it shares with files."""
    text = Path(f"/proc/{pid}/status").read_text()
    return sum(int(line.split()[1]) for line in text.splitlines() if line.startswith(("RssAnon", "RssShmem")))


class Plug:
    """A cable between boards and a host, which can be pulled: then nothing passes, and nobody is told."""

    def __init__(self, host_url: str) -> None:
        self._port = int(host_url.rsplit(":", 1)[1])
        self._server = socket.create_server(("127.0.0.1", 0))
        self.url = f"tcp://127.0.0.1:{self._server.getsockname()[1]}"
        self.plugged = threading.Event()
        self.plugged.set()
        self._sockets: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                board, _ = self._server.accept()
                self._sockets.append(board)
                self.plugged.wait()
                host = socket.create_connection(("127.0.0.1", self._port))
                self._sockets.append(host)
                for one, other in ((board, host), (host, board)):
                    threading.Thread(target=self._copy, args=(one, other), daemon=True).start()

    def _copy(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                self.plugged.wait()
                sink.sendall(data)
        self.plugged.wait()
        for end in (source, sink):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Let everybody go."""
        self.plugged.set()
        for one in (self._server, *self._sockets):
            with suppress(OSError):
                one.close()


class Cable:
    """Two network namespaces, each a machine, and what is between them; wants the rights to make them.

    Parameters
    ----------
    host, board : what is put before a program's command to run it there.
    """

    def __init__(self) -> None:
        self._names = [f"fly{os.getpid()}{side}" for side in "hb"]
        self.host, self.board = (("ip", "netns", "exec", name) for name in self._names)

    def __enter__(self):
        near, far = self._names
        for name in self._names:
            self._ip("netns", "add", name)
        self._ip("link", "add", "v0", "netns", near, "type", "veth", "peer", "name", "v0", "netns", far)
        for k, name in enumerate(self._names):
            self._ip("-n", name, "addr", "add", f"10.77.0.{k + 1}/24", "dev", "v0")
            for device in ("lo", "v0"):
                self._ip("-n", name, "link", "set", device, "up")
        return self

    def __exit__(self, *_: object) -> None:
        for name in self._names:
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)

    def pull(self) -> None:
        """From now on packets go to a device that nobody has: no end of file, no refusal."""
        for k, name in enumerate(self._names):
            there = f"10.77.0.{2 - k}"
            self._ip("-n", name, "neigh", "replace", there, "lladdr", "02:00:00:00:00:99", "dev", "v0")

    @staticmethod
    def _ip(*words: str) -> None:
        subprocess.run(["ip", *words], check=True, capture_output=True)


def outcomes(log: Path) -> list[str]:
    """Return the outcomes in a ledger; nothing while it is not there or its last line is half written."""
    with suppress(Exception):
        return [row.outcome for row in read_ledger(log)]
    return []


def tell(sentence: str) -> None:
    """Print a sentence for whoever runs a test with ``-rA``."""
    sys.stdout.write(sentence + "\n")


def wait_until(condition: Callable[[], object]) -> float:
    """Wait for a condition and return how long it took [s]."""
    start = time.monotonic()
    while not condition():
        assert time.monotonic() - start < PATIENCE_S
        time.sleep(0.02)
    return time.monotonic() - start
