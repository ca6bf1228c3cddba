"""Board process of one flight, started when the host listens and stopped with the flight."""

from __future__ import annotations

import contextlib
import os
import subprocess
import tempfile
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from flyaround.hil.host.flight_run import FlightRun
    from flyaround.hil.host.ledger.summary import LedgerSummary

# Time-out for a board to end after its host's goodbye [s], after which it is killed.
EXIT_TIMEOUT_S = 20.0
# Silence time-out between host and board on a busy machine [s]; a closed connection is noticed immediately.
SILENCE_TIMEOUT_S = 60.0

# Maximum size of the stored output of a failed board [bytes].
MAX_BYTES = 1 << 20


def run_with_board_process(
    flight: FlightRun,
    command: Sequence[str],
    options: Sequence[str],
    log: Path | None = None,
    *,
    on_listening: Callable[[str, str | None], None] = lambda _url, _truth_url: None,
    **run: Any,  # noqa: ANN401 - those of FlightRun.run
) -> LedgerSummary:
    """Run a flight with a board process on this machine.

    Parameters
    ----------
    flight : FlightRun
        Flight to run.
    command : tuple of str
        Command line of a board, before the host's address.
    options : tuple of str
        Command line after the host's address.
    log : Path, optional
        File for the output of a board that failed.
    on_listening : callable
        Called with the host's URL and that of the truth endpoint, before the board is started.
    run : object
        Further arguments of `FlightRun.run`.

    Returns
    -------
    LedgerSummary
        Summary of the run, as of `FlightRun.run`.
    """
    with contextlib.ExitStack() as stack:

        def start(url: str, truth_url: str | None) -> None:
            on_listening(url, truth_url)
            stack.enter_context(_board((*command, url, "--silence", f"{SILENCE_TIMEOUT_S:g}", *options), log))

        return flight.run(on_listening=start, **run)


@contextlib.contextmanager
def _board(command: Sequence[str], log: Path | None) -> Iterator[None]:
    # one thread, as on a board: BLAS threads on small matrices compete with the renderer
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    with tempfile.TemporaryFile() as output:
        process = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT, env=environment)
        try:
            yield
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(EXIT_TIMEOUT_S)
        finally:
            process.kill()
            if process.wait() != 0 and log is not None:
                output.seek(0)
                log.write_bytes(output.read(MAX_BYTES))
