"""Subprocesses with bounded memory and time, in which third-party decoders read untrusted bytes."""

from __future__ import annotations

import os
import subprocess
import sys

TIMEOUT_S = 120.0  # a decoder that runs longer is killed; the user waits for it, without progress


class DecoderError(Exception):
    """A decoder failed; the message says why."""


def run_decoder(module: str, arguments: list[str], data: bytes) -> bytes:
    """Run a module of this folder with bytes on its standard input; return its standard output.

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
        If it fails, is killed, or takes too long.
    """
    command = [sys.executable, "-P", "-m", f"flyaround.simulator.targets.importing.read.{module}", *arguments]
    # BLAS threads would take memory, which is limited there
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    try:
        process = subprocess.run(
            command, input=data, capture_output=True, timeout=TIMEOUT_S, check=False, env=environment
        )
    except subprocess.TimeoutExpired as error:
        raise DecoderError(f"the decoder found no end within {TIMEOUT_S:g} s") from error
    if process.returncode != 0:
        lines = process.stderr.decode("utf-8", "replace").strip().splitlines()
        raise DecoderError(
            lines[-1] if process.returncode == 1 and lines else f"the decoder ended with {process.returncode}"
        )
    return process.stdout


def bound_memory(max_bytes: int) -> None:
    """Limit the memory of this process, because a few bytes of input may request any amount."""
    try:
        import resource  # noqa: PLC0415 - Unix alone has it
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_AS, (max_bytes, max_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def finish(problem: str | None) -> int:
    """Return the exit code of a decoder, and print its problem on standard error."""
    if problem is not None:
        print(problem, file=sys.stderr)  # noqa: T201
    return int(problem is not None)
