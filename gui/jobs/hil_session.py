"""A session of the host's side of the link on the console's flight, and a board on this machine, both polled."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
from collections import Counter, deque
from typing import TYPE_CHECKING, Literal

import numpy as np

from flyaround.gui.jobs.hil_stream import DeclineCause, Event, SceneRequest, SessionNote, stream
from flyaround.gui.jobs.program import ChildProgram
from flyaround.hil.host.frame_record import DECLINED, FrameRecord
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.link_process.ipc import Close, Listening
from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from pathlib import Path

    from flyaround.hil.host.run import RunConfig
    from flyaround.simulator.piloting.session import FlightSession
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scenario.faults import CameraFault, LineFault

State = Literal["off", "starting", "waiting for a board", "streaming", "ending"]

KEPT_ROWS = 5000  # frames whose records are kept
RATE_OVER_S = 5.0
END_PATIENCE_S, KILL_PATIENCE_S, QUIT_PATIENCE_S = 3.0, 15.0, 0.5
"""Times after which a session that should end is interrupted, and killed; and until it is interrupted at the end."""
BIN_EDGES_MS = tuple(float(e) for e in np.round(np.geomspace(1.0, 10_000.0, 41), 3))
"""Bins of the latency distribution, uniform in the logarithm."""


class HilSession:
    """A session with a board: its process, the scenes that it requests, the rows of its ledger; only `close` waits."""

    def __init__(self) -> None:
        self._process: multiprocessing.context.SpawnProcess | None = None
        self._pipe: Connection | None = None
        self._board: ChildProgram | None = None
        self._next_board: tuple[str, str] | None = None
        self._reset(None, None)

    def _reset(self, session: FlightSession | None, log_dir: Path | None) -> None:
        """Discard the previous session, with its figures."""
        self._session, self.log_dir = session, log_dir
        self._scene_due = self._interrupted = False
        self._sent_t_s: float | None = None
        self._stop_s: float | None = None
        self._summary: LedgerSummary | None = None
        self._failed: UserError | None = None
        self.url = self.board_name = ""
        self.rows: deque[FrameRecord] = deque(maxlen=KEPT_ROWS)
        self._arrived_s: deque[float] = deque(maxlen=KEPT_ROWS)
        self.outcomes: Counter[str] = Counter()
        self.declined: Counter[str] = Counter()
        """Number of declined frames by reason."""
        self.cause = ""
        """Why the last picture was declined, and what to do, as far as the picture shows it."""
        self._causes: dict[int, str] = {}
        self.struck: Counter[str] = Counter()
        """Number of frames affected by each kind of fault."""
        self.sent = 0

    # --- requests of the operator

    @property
    def on(self) -> bool:
        """True while there is a session."""
        return self._process is not None

    @property
    def state(self) -> State:
        """State of the session."""
        if self._process is None:
            return "off"
        if self._stop_s is not None:
            return "ending"
        if not self.url:
            return "starting"
        return "streaming" if self.board_name else "waiting for a board"

    @property
    def pid(self) -> int | None:
        """Number of the host's process."""
        return None if self._process is None else self._process.pid

    def start(self, session: FlightSession, config: RunConfig, device_index: int | None = None) -> None:
        """Start on a flight.

        Raises
        ------
        UserError
            If there is a session already.
        """
        if self.on:
            raise UserError("a session with a board is under way: end it first")
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        # not a daemon, because it starts processes for drawing and for the link
        args = theirs, config, device_index
        self._process = context.Process(target=stream, args=args, name="flyaround hil host")
        self._process.start()
        theirs.close()
        self._reset(session, config.log_dir)

    def stop(self) -> None:
        """End the session: say goodbye to the board and close the ledger."""
        if self._process is None or self._stop_s is not None:
            return
        self._stop_s = time.monotonic()
        self._send(Close("the session was stopped in the console"))

    def add_fault(self, fault: CameraFault | LineFault) -> None:
        """Inject a fault from the next picture on.

        Raises
        ------
        UserError
            If there is no session.
        """
        if self._process is None or self._stop_s is not None:
            raise UserError("a fault needs a session with a board: start one first")
        self._send(fault)

    @property
    def board_running(self) -> bool:
        """True while a board runs on this machine."""
        return self._board is not None or self._next_board is not None

    def start_board(self, target: str, method: str) -> None:
        """Start a board's process on this machine, once the session's host listens.

        Parameters
        ----------
        target : str
            Name of the craft.
        method : str
            Name of the method.

        Raises
        ------
        UserError
            If one is running, or there is no session to connect to.
        """
        if self.board_running:
            raise UserError("a board runs on this machine already: stop it first")
        if not self.url:
            if not self.on:
                raise UserError("no host listens yet: start a session, then its board")
            self._next_board = (target, method)
            return
        arguments = "hil", "board", self.url, "--target", target, "--method", method
        self._board = ChildProgram(arguments)

    def stop_board(self) -> None:
        """End the board's process."""
        self._next_board = None
        if self._board is not None:
            self._board.stop()

    # --- once per turn

    def update(self, session: FlightSession) -> list[SessionNote]:
        """Take arrived events, send the newest scene, and return the news.

        Parameters
        ----------
        session : FlightSession
            The present flight; the session ends if it is not the one it began with.
        """
        notes = self._look_at_board()
        if self._process is None:
            return notes
        if session is not self._session and self._stop_s is None:
            notes.append(SessionNote("another flight was opened: the session with the board ends"))
            self.stop()
        self._take(notes)
        if self._scene_due and self._stop_s is None and session.t_s != self._sent_t_s:
            # a paused flight has no new scene, and the board waits
            self._scene_due, self._sent_t_s = False, session.t_s
            self._send(session.scene())
        self._hasten()
        if not self._process.is_alive():
            self._take(notes)
            notes.append(self._over(self._process.exitcode))
        return notes

    def _take(self, notes: list[SessionNote]) -> None:
        with contextlib.suppress(EOFError, OSError):
            while self._pipe is not None and self._pipe.poll():
                self._handle(self._pipe.recv(), notes)

    def _handle(self, event: Event, notes: list[SessionNote]) -> None:
        match event:
            case SceneRequest():
                self._scene_due = True
            case DeclineCause(frame_id, text):
                self._causes[frame_id] = text
            case FrameRecord():
                before, cause = self.cause.partition(":")[0], self._causes.pop(event.frame_id, "")
                self.cause = cause if event.outcome == DECLINED else ""
                is_new = event.reason not in self.declined or self.cause.partition(":")[0] not in {"", before}
                if event.outcome == DECLINED and is_new:
                    notes.append(SessionNote(f"the board declines: {event.reason}{cause and '; '}{cause}"))
                self._add(event)
            case Listening(url):
                self.url, text = url, "a board may connect: flyaround hil board"
                if self._next_board is not None:
                    board, self._next_board, text = self._next_board, None, "the board here connects to"
                    self.start_board(*board)
                notes.append(SessionNote(f"{text} {url}"))
            case SessionNote(text, warning):
                if text.startswith("board connected"):
                    self.board_name = text.partition(": ")[2]
                elif text.startswith("board gone"):
                    self.board_name = ""
                notes.append(SessionNote(text, warning and self._stop_s is None))
            case LedgerSummary():
                self._summary = event
            case UserError():
                self._failed = event

    def _add(self, row: FrameRecord) -> None:
        self.rows.append(row)
        self._arrived_s.append(time.monotonic())
        self.outcomes[row.outcome] += 1
        self.declined.update([row.reason] if row.outcome == DECLINED else [])
        self.struck.update(row.faults)
        self.sent += 1

    def _hasten(self) -> None:
        """Interrupt a process that should have ended; then kill it."""
        if self._stop_s is None or self._process is None or self._process.pid is None:
            return
        waited_s = time.monotonic() - self._stop_s
        if waited_s > END_PATIENCE_S and not self._interrupted:
            self._interrupted = True
            with contextlib.suppress(OSError):
                os.kill(self._process.pid, signal.SIGINT)
        if waited_s > KILL_PATIENCE_S:
            self._process.kill()

    def _over(self, exit_code: int | None) -> SessionNote:
        was_asked, listened = self._stop_s is not None, bool(self.url)
        self._forget_process()
        if self._failed is not None:
            # one that never listened was started wrongly
            return SessionNote(f"the session with the board ended: {self._failed}", warning=listened)
        if (s := self._summary) is None:
            text = f"the session with the board ended unexpectedly (exit code {exit_code})"
            return SessionNote(text, warning=True)
        text = f"the session with the board ended: {s.sent} pictures, {s.accepted} accepted, {s.dropped_total} dropped"
        if s.ended == "board_lost":
            text += f"; the board left ({s.board_gone})"
        if self.log_dir is not None:
            text += f"; for a report run in a terminal: flyaround hil report {self.log_dir}"
        return SessionNote(text, warning=not was_asked)

    def _look_at_board(self) -> list[SessionNote]:
        board = self._board
        if board is None or board.running:
            return []
        words, code, was_stopped = board.last_error_line(), board.exit_code, board.stopped
        board.close()
        self._board = None
        text = f"the board's process ended: {words or f'exit code {code}'}"
        return [SessionNote(text, bool(code) and not was_stopped)]

    def _send(self, message: object) -> None:
        if self._pipe is not None:
            with contextlib.suppress(OSError):
                self._pipe.send(message)

    def _forget_process(self) -> None:
        if self._process is not None and self._pipe is not None:
            self._process.join()
            self._pipe.close()
        self._process = self._pipe = self._session = self._stop_s = self._next_board = None
        self.url = self.board_name = ""

    def close(self) -> None:
        """End both, in bounded time."""
        self.stop()
        if self._board is not None:
            self._board.close(QUIT_PATIENCE_S)
            self._board = None
        if self._process is None:
            return
        # nobody waits for its last pictures
        self._stop_s = time.monotonic() - END_PATIENCE_S + QUIT_PATIENCE_S
        while self._process.is_alive():
            # unread rows must not block its last messages
            self._take([])
            self._hasten()
            self._process.join(0.05)
        self._forget_process()

    # --- figures

    @property
    def per_s(self) -> float:
        """Answers per second over the last seconds."""
        now = time.monotonic()
        recent = [t for t in self._arrived_s if now - t < RATE_OVER_S]
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 1 else 0.0

    @property
    def drops(self) -> dict[str, int]:
        """Number of frames without an answer, by cause."""
        outcomes = (name.partition("dropped:") for name in sorted(self.outcomes))
        return {cause: self.outcomes[of + cause] for before, of, cause in outcomes if of and not before}

    def latencies_ms(self) -> FloatArray:
        """Return (n,) times from the first byte sent to the pose received, for answered frames [ms]."""
        return np.array([r.e2e_ms for r in self.rows if r.e2e_ms is not None], float)

    def latency_counts(self) -> FloatArray:
        """Return (40,) numbers of answered frames by latency between `BIN_EDGES_MS`, the rest in the outer bins."""
        clipped = np.clip(self.latencies_ms(), BIN_EDGES_MS[0], BIN_EDGES_MS[-1])
        return np.histogram(clipped, BIN_EDGES_MS)[0].astype(float)
