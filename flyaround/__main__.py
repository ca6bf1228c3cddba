"""Entry point of the command line: turns a user's mistake into one sentence and exit code 2."""

from __future__ import annotations

import logging
import os
import signal
import sys

from rich.text import Text

from flyaround.cli import app
from flyaround.commands.terminal import terminal
from hil.board.errors import BoardModelError
from hil.link.errors import LinkError
from simulator.errors import UserError, machine_sentence
from simulator.runtime.memory import keep_freed_memory
from simulator.runtime.threads import use_one_for_matrices

INTERRUPTED, TERMINATED = 130, 143  # 128 and the signal's number, as shells have it


class Terminated(KeyboardInterrupt):
    """SIGTERM, which ends a command as Ctrl-C does: files closed, children ended."""


def _terminate(number: int, _frame: object) -> None:
    # what ends a program often sends the signal twice: the second would break off what the first began
    signal.signal(number, signal.SIG_IGN)
    raise Terminated


def main() -> None:
    """Run the command line and exit."""
    signal.signal(signal.SIGTERM, _terminate)
    keep_freed_memory()
    use_one_for_matrices()
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command line and return its exit code: 0 success, 1 a check that failed, 2 a user's mistake."""
    try:
        app(args=arguments, prog_name="flyaround")
    except (UserError, LinkError, BoardModelError) as error:
        _tell(str(error))
        logging.getLogger("flyaround").debug("traceback", exc_info=True)
        return 2
    except (MemoryError, OSError, RecursionError) as error:
        _tell(machine_sentence(error))
        logging.getLogger("flyaround").debug("traceback", exc_info=True)
        _leave_full_output()
        return 2
    except (KeyboardInterrupt, SystemExit) as leave:
        stop = _stop_behind(leave)
        if stop is None:
            return leave.code if isinstance(leave, SystemExit) and isinstance(leave.code, int) else 0
        terminated = isinstance(stop, Terminated)
        how = "terminated" if terminated else "interrupted"
        terminal(stderr=True).print(f"flyaround: {how}; what was written so far is whole")
        return TERMINATED if terminated else INTERRUPTED
    return 0


def _tell(sentence: str) -> None:
    """Print what went wrong in one line, whatever names it repeats."""
    line = " ".join(sentence.splitlines())
    terminal(stderr=True).print(Text.assemble(("flyaround: ", "red"), line), soft_wrap=True)


def _leave_full_output() -> None:
    """What standard output cannot take is given up: at the end Python would try again, and fail louder."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _stop_behind(leave: BaseException) -> KeyboardInterrupt | None:
    """The interruption that an exit came of: the command line's library makes an exit code of it."""
    error: BaseException | None = leave
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error


if __name__ == "__main__":
    main()
