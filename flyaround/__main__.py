"""Entry point of the command line: reports user errors as one sentence, with exit code 2."""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys

from flyaround.cli.command_line import set_command_line
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.link.errors import LinkError
from flyaround.simulator.errors import UserError, machine_sentence
from flyaround.simulator.runtime.limits import limits_problem
from flyaround.simulator.runtime.memory import keep_freed_memory
from flyaround.simulator.runtime.threads import use_one_for_matrices
from flyaround.simulator.runtime.urls import without_secrets

DRAWING = frozenset({"render", "capture", "sim", "demo", "bench"})
"""Commands that open the graphics driver, which aborts the process if memory is short."""

INTERRUPTED, TERMINATED = 130, 143  # 128 plus the signal's number, as in shells


class Terminated(KeyboardInterrupt):
    """SIGTERM, raised as an exception: the command ends as on Ctrl-C, with files closed and child processes stopped."""


def _terminate(number: int, _frame: object) -> None:
    # a second signal often follows the first: ignore it, or it would interrupt the cleanup
    signal.signal(number, signal.SIG_IGN)
    raise Terminated


def main() -> None:
    """Run the command line and exit."""
    signal.signal(signal.SIGTERM, _terminate)
    keep_freed_memory()
    use_one_for_matrices()
    code = run(sys.argv[1:])
    # at its end the interpreter would search all objects for cycles, which takes the console a second
    gc.freeze()
    sys.exit(code)


def run(arguments: list[str]) -> int:
    """Run one command line, and return its exit code.

    Returns
    -------
    int
        0 for success, 1 for a failed check, 2 for a user's mistake, 130 after an interruption, 143 after SIGTERM. Any
        other code is the one with which the command line itself exited.
    """
    problem = limits_problem(drawing=bool(DRAWING.intersection(arguments)))
    if problem is not None:
        _print_error(problem)
        return 2
    try:
        _call(arguments)
    except (KeyboardInterrupt, SystemExit) as leave:
        stop = _cause_of_exit(leave)
        if stop is None:
            return leave.code if isinstance(leave, SystemExit) and isinstance(leave.code, int) else 0
        terminated = isinstance(stop, Terminated)
        verb = "terminated" if terminated else "interrupted"
        sys.stderr.write(f"flyaround: {verb}; files written so far are complete\n")
        return TERMINATED if terminated else INTERRUPTED
    except Exception as error:
        sentence = str(error) if _is_for_user(error) else machine_sentence(error)
        if sentence is None:
            raise
        _print_error(sentence)
        logging.getLogger("flyaround").debug("traceback", exc_info=True)
        if not _is_for_user(error):
            _discard_output()
        return 2
    return 0


def _call(arguments: list[str]) -> None:
    """Import the command line and call it. Under a low memory limit the import itself may fail."""
    from flyaround.cli.app import app  # noqa: PLC0415 - may fail

    with set_command_line(arguments):
        app(args=arguments, prog_name="flyaround")


def _is_for_user(error: Exception) -> bool:
    """Return True if an error message tells the user what to do."""
    return isinstance(error, UserError | LinkError | BoardModelError)


def _print_error(sentence: str) -> None:
    """Print a sentence as one line, without secrets in URLs; as plain text if memory is too short for Rich."""
    line = without_secrets(" ".join(sentence.splitlines()))
    try:
        from rich.text import Text  # noqa: PLC0415 - may fail

        from flyaround.cli.terminal import terminal  # noqa: PLC0415 - may fail

        text = Text.assemble(("flyaround: ", "red"), line)
        terminal(stderr=True).print(text, soft_wrap=True)
    except (ImportError, MemoryError, OSError):
        sys.stderr.write(f"flyaround: {line}\n")


def _discard_output() -> None:
    """Discard buffered standard output that could not be written, so that Python does not fail again at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _cause_of_exit(leave: BaseException) -> KeyboardInterrupt | None:
    """Return the interruption that an exit wraps: Click turns an interruption into an exit code."""
    error: BaseException | None = leave
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error


if __name__ == "__main__":
    main()
