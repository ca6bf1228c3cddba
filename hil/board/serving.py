"""Agent in operation: one session or repeated ones, under a service manager."""

from __future__ import annotations

import os
import sys
from typing import List, NoReturn

from flyaround.hil.board.agent import BoardAgent
from flyaround.hil.board.frame_server import BoardSummary
from flyaround.hil.board.service import ExitCode, ServiceManager
from flyaround.hil.link.errors import LinkError

# End of the log line that announces a restart.
RESTART_NOTE = "; the agent restarts"


class NoSessionError(LinkError):
    """A session could not be started: no connection, a refusal, or unsupported terms."""


def serve_sessions(agent: BoardAgent, *, reconnect: bool, start: List[str]) -> BoardSummary:
    """Serve one session, or repeated ones until stopped. Restart the program if the estimator hangs.

    Parameters
    ----------
    agent : BoardAgent
        Agent that serves the sessions.
    reconnect : bool
        True to connect again after each session.
    start : list of str
        Arguments that start this program again, after the interpreter's name.

    Returns
    -------
    BoardSummary
        Counts of the last session, and how it ended.

    Raises
    ------
    NoSessionError
        If the single session could not be started.
    """
    manager = ServiceManager()
    manager.start_heartbeat(lambda: agent.is_responsive)
    manager.notify("READY=1")
    try:
        if reconnect:
            summary = agent.serve_repeatedly(lambda sentence: _say(sentence, manager))
            _say(summary.ended + RESTART_NOTE, manager)
            _restart_process(start)
        try:
            return agent.serve()
        except LinkError as error:
            raise NoSessionError(str(error)) from error
    finally:
        manager.notify("STOPPING=1")
        manager.close()


def exit_code(summary: BoardSummary) -> ExitCode:
    """Return the exit code of a session.

    Returns
    -------
    ExitCode
        ``ORDERLY`` after the host's goodbye, ``WATCHDOG`` if the estimator hung, otherwise ``HOST_VANISHED``.
    """
    if summary.hung:
        return ExitCode.WATCHDOG
    return ExitCode.ORDERLY if summary.goodbye else ExitCode.HOST_VANISHED


def exit_at_once(code: int) -> NoReturn:
    """Exit without the interpreter's cleanup, which would wait for an estimator hung in compiled code."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _say(sentence: str, manager: ServiceManager) -> None:
    sys.stderr.write(sentence + "\n")
    sys.stderr.flush()
    manager.notify(f"STATUS={sentence}")


def _restart_process(start: List[str]) -> NoReturn:
    """Replace this process by a new run of the program; hung threads end with the old one."""
    # Python 3.10 and later also know the interpreter's own options
    command = getattr(sys, "orig_argv", [sys.executable, *start])
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, *command[1:]])  # noqa: S606 - itself
