"""Subprocess for foreign decoders of untrusted bytes, with bounded memory, time and output."""

from __future__ import annotations

import os
import subprocess
import sys

DEADLINE_S = 120.0


class DecoderError(Exception):
    """Failure of a decoder; its message says why."""


def run_decoder(module: str, arguments: list[str], data: bytes) -> bytes:
    """Run a module of this folder on bytes on its standard input. Return its standard output.

    Parameters
    ----------
    module : str
        Name of the module, which ends with `finish`.
    arguments : list of str
        Command line of the module.
    data : bytes
        Untrusted input.

    Raises
    ------
    DecoderError
        If it fails, is killed, or has not ended in time.
    """
    command = [sys.executable, "-P", "-m", f"flyaround.simulator.targets.importing.read.{module}", *arguments]
    # threads of a matrix library would take the memory that is bounded there
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    try:
        done = subprocess.run(
            command, input=data, capture_output=True, timeout=DEADLINE_S, check=False, env=environment
        )
    except subprocess.TimeoutExpired as error:
        raise DecoderError(f"the decoder found no end within {DEADLINE_S:g} s") from error
    if done.returncode != 0:
        said = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise DecoderError(
            said[-1] if done.returncode == 1 and said else f"the decoder ended with {done.returncode}"
        )
    return done.stdout


def bound_memory(most_bytes: int) -> None:
    """Limit the memory of this process, because a few bytes may request any size."""
    try:
        import resource  # noqa: PLC0415 - Unix alone has it
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (most_bytes, most_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def finish(problem: str | None) -> int:
    """Return the exit code of a decoder, with its problem on standard error."""
    if problem is not None:
        print(problem, file=sys.stderr)  # noqa: T201
    return int(problem is not None)
