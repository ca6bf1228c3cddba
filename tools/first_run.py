"""Test of a new user's first steps: the wheel in an empty home, without a compiler, on a machine of few resources.

`python -m tools.first_run [PYTHON]` builds the wheel, installs it for another user without write access, and runs the
first commands with 64 MB of shared memory. It must be started as root; it drops its privileges before each command.
PYTHON (default: this interpreter) must be readable by other users. The limit of one minute for the first image holds on
an idle machine.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]
NOBODY = "65534"
SHARED_MEMORY = "64m"
MAX_CACHE_BYTES = 300e6  # limit of the cache after all commands
MAX_FIRST_PICTURE_S = 60.0  # limit of the first image's time [s]
COMMANDS = (
    "render tango-flyaround -o first.png",
    "demo",
    "capture tango-flyaround -o data -n 8 --workers 2",
    "check data",
    "doctor",
)
# a separate mount namespace: the machine's /dev/shm stays as it is
_AS_NOBODY = (
    f"mount -t tmpfs -o size={SHARED_MEMORY},mode=1777 tmpfs /dev/shm && exec setpriv --reuid {NOBODY} "
    f'--regid {NOBODY} --clear-groups env PATH=/nowhere "$@"'
)


@dataclass(frozen=True)
class Step:
    """One command and its result.

    Parameters
    ----------
    command : str
        Arguments after the program.
    seconds : float
        Its duration.
    processor_s : float
        Wall time.
    cache_bytes : int
        Size of the cache after the command.
    problem : str
        Reason for its failure, or empty.
    """

    command: str
    seconds: float
    processor_s: float
    cache_bytes: int
    problem: str


def installed(python: str, folder: Path) -> Path:
    """Return the program of a new virtual environment with the wheel that only its owner may change."""
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder / "dist", ROOT],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    environment = folder / "env"
    subprocess.run([python, "-m", "venv", environment], check=True)
    wheel = next((folder / "dist").glob("*.whl"))
    pip: list[str | Path] = [
        environment / "bin" / "python",
        "-m",
        "pip",
        "install",
        "--quiet",
        "-c",
        ROOT / "constraints.txt",
    ]
    subprocess.run([*pip, wheel], check=True)
    subprocess.run(["chmod", "-R", "a-w", environment], check=True)
    return environment / "bin" / "flyaround"


def run_as_nobody(program: Path, arguments: list[str], home: Path) -> subprocess.CompletedProcess[str]:
    """Run the program as a user without privileges, with an empty search path."""
    return subprocess.run(
        ["unshare", "--mount", "sh", "-c", _AS_NOBODY, "sh", program, *arguments],
        cwd=home,
        env={"HOME": str(home), "PATH": os.environ["PATH"]},
        capture_output=True,
        text=True,
        check=False,
    )


def first_steps(program: Path, home: Path) -> list[Step]:
    """Run each command in an empty home, and measure the cache after it."""
    steps: list[Step] = []
    for command in COMMANDS:
        start, worked = time.perf_counter(), _processor_s()
        done = run_as_nobody(program, command.split(), home)
        seconds, processor_s = time.perf_counter() - start, _processor_s() - worked
        cache_bytes = json.loads(run_as_nobody(program, ["cache", "--json"], home).stdout)["size_bytes"]
        problem = (done.stderr.strip().splitlines() or ["no word"])[-1] if done.returncode else ""
        if not steps and seconds > MAX_FIRST_PICTURE_S:
            problem = problem or f"took more than {MAX_FIRST_PICTURE_S:.0f} s"
        if cache_bytes > MAX_CACHE_BYTES:
            problem = problem or f"the cache exceeds {MAX_CACHE_BYTES / 1e6:.0f} MB"
        steps.append(Step(command, seconds, processor_s, cache_bytes, problem))
    return steps


def _processor_s() -> float:
    times = os.times()
    return times.children_user + times.children_system


def main() -> int:
    """Print time and cache size of each command; return 1 if one failed."""
    if os.geteuid() != 0:
        print("the test runs commands as another user: start it as root, for example in a container")
        return 2
    with TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        home = folder / "home"
        home.mkdir(mode=0o777)
        home.chmod(0o777)
        steps = first_steps(installed([*sys.argv, sys.executable][1], folder), home)
    for step in steps:
        print(
            f"{step.seconds:7.1f} s, {step.processor_s:6.1f} s of processor time, "
            f"cache {step.cache_bytes / 1e6:4.0f} MB: flyaround {step.command}  {step.problem}"
        )
    return int(any(step.problem for step in steps))


if __name__ == "__main__":
    sys.exit(main())
